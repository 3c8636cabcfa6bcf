"""Light at a water surface: what a camera sees of it, pixel by pixel."""

import math

import numpy as np
import numpy.typing as npt

from mjskip._compile.jit import picture_kernel as kernel

Array = npt.NDArray[np.float64]
SingleArray = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]
Vector = tuple[float, float, float]

INDEX = 1.333  # of refraction of water
AWAY = 1e9  # [m]: a distance that nothing is at
BLUNT = 0.1  # square of the width of a focus, in units of unfocused light
EDGE = 12.0  # cells over which the surface fades into still water at the border of its field


@kernel
def fresnel(cosine: float, ratio: float) -> float:
    """Share of unpolarised light that is reflected.

    R = (r_s^2 + r_p^2) / 2, with r_s = (n1 c1 - n2 c2) / (n1 c1 + n2 c2) and
    r_p = (n2 c1 - n1 c2) / (n2 c1 + n1 c2).

    Args:
        cosine: c1, of the angle of incidence, 0 to 1.
        ratio: n1 / n2, of the side that the light comes from over the other.
    """
    sine2 = ratio * ratio * (1.0 - cosine * cosine)
    if sine2 >= 1.0:
        return 1.0
    beyond = math.sqrt(1.0 - sine2)
    s = (ratio * cosine - beyond) / (ratio * cosine + beyond)
    p = (cosine - ratio * beyond) / (cosine + ratio * beyond)
    return 0.5 * (s * s + p * p)


@kernel
def refract(d: Vector, n: Vector, ratio: float) -> Vector:
    """Snell's law: a unit direction beyond a surface; (0, 0, 0) where all is reflected.

    Args:
        d: unit direction of travel.
        n: unit normal on the side that the light comes from, d . n < 0.
        ratio: n1 / n2, of that side over the other.
    """
    cosine = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2])
    sine2 = ratio * ratio * (1.0 - cosine * cosine)
    if sine2 >= 1.0:
        return 0.0, 0.0, 0.0
    k = ratio * cosine - math.sqrt(1.0 - sine2)
    return ratio * d[0] + k * n[0], ratio * d[1] + k * n[1], ratio * d[2] + k * n[2]


@kernel
def caustic(depth: float, curvature: float) -> float:
    """Brightness of the bottom relative to flat water.

    Rays that cross the surface at x land at x + (1 - 1/n) depth grad(z): to first order their density
    is one over |J|, J = 1 + (1 - 1/n) depth lap(z). The sun's width blunts the focus, and well beyond
    it rays from all around mix to an even light.
    """
    bend = (1.0 - 1.0 / INDEX) * depth * curvature
    light = math.sqrt((1.0 + BLUNT) / ((1.0 + bend) * (1.0 + bend) + BLUNT))
    return 1.0 + (light - 1.0) * math.exp(-0.15 * bend * bend)


@kernel
def ellipsoid(stones: Array, k: int, o: Vector, d: Vector) -> tuple[float, float]:
    """Where a ray meets an ellipsoid [m], and how near it comes in units of the semi-axes, squared.

    The distance is `AWAY` where it does not; the nearness is that of points ahead.

    Args:
        stones: (n, 16) rows as `mjskip.draw.optics.pack_stones` makes them.
        k: which row.
        o: origin [m].
        d: unit direction.
    """
    x, y, z = o[0] - stones[k, 0], o[1] - stones[k, 1], o[2] - stones[k, 2]
    along = x * d[0] + y * d[1] + z * d[2]
    reach = 1.3 * stones[k, 15]
    if x * x + y * y + z * z - along * along > reach * reach or along > reach:
        return AWAY, AWAY
    u, v, w = (
        stones[k, 3] * x + stones[k, 4] * y + stones[k, 5] * z,
        stones[k, 6] * x + stones[k, 7] * y + stones[k, 8] * z,
        stones[k, 9] * x + stones[k, 10] * y + stones[k, 11] * z,
    )
    p, q, r = (
        stones[k, 3] * d[0] + stones[k, 4] * d[1] + stones[k, 5] * d[2],
        stones[k, 6] * d[0] + stones[k, 7] * d[1] + stones[k, 8] * d[2],
        stones[k, 9] * d[0] + stones[k, 10] * d[1] + stones[k, 11] * d[2],
    )
    a, b, c = p * p + q * q + r * r, u * p + v * q + w * r, u * u + v * v + w * w
    near = c - b * b / a if b < 0.0 else c
    if near >= 1.0 or b >= 0.0:
        return AWAY, near
    t = (-b - math.sqrt(b * b - a * (c - 1.0))) / a
    return (t if t > 0.0 else AWAY), near


@kernel
def lit_stone(stones: Array, k: int, o: Vector, d: Vector, t: float, sun: Vector) -> Vector:
    """Colour of an ellipsoid where a ray meets it, in the light of sun and sky."""
    x = o[0] + t * d[0] - stones[k, 0]
    y = o[1] + t * d[1] - stones[k, 1]
    z = o[2] + t * d[2] - stones[k, 2]
    u, v, w = (
        stones[k, 3] * x + stones[k, 4] * y + stones[k, 5] * z,
        stones[k, 6] * x + stones[k, 7] * y + stones[k, 8] * z,
        stones[k, 9] * x + stones[k, 10] * y + stones[k, 11] * z,
    )
    p, q, r = (
        stones[k, 3] * u + stones[k, 6] * v + stones[k, 9] * w,
        stones[k, 4] * u + stones[k, 7] * v + stones[k, 10] * w,
        stones[k, 5] * u + stones[k, 8] * v + stones[k, 11] * w,
    )
    scale = 1.0 / math.sqrt(p * p + q * q + r * r)
    light = 0.5 + 0.2 * r * scale
    light += 0.6 * max(0.0, scale * (p * sun[0] + q * sun[1] + r * sun[2]))
    return light * stones[k, 12], light * stones[k, 13], light * stones[k, 14]


@kernel
def spline(
    z: SingleArray, first: int, nx: int, ny: int, x: float, y: float
) -> tuple[float, float, float, float]:
    """Height, slopes and Laplacian at a point by cubic B-splines, in cells; still outside.

    Twice continuously differentiable: reflections have no creases where cells meet.

    Args:
        z: heights one after another [m].
        first: where the (nx, ny) of this surface begin.
        nx: cells along x.
        ny: cells along y.
        x: [cells].
        y: [cells].
    """
    edge = min(min(x, nx - 1.0 - x), min(y, ny - 1.0 - y)) - 1.0
    if not edge > 0.0:
        return 0.0, 0.0, 0.0, 0.0
    i, j = int(x), int(y)
    s, t = x - i, y - j
    a, b = 1.0 - s, 1.0 - t
    # fmt: off
    wx = (a * a * a / 6.0, 2 / 3 - s * s * (1.0 - 0.5 * s), 2 / 3 - a * a * (1.0 - 0.5 * a), s * s * s / 6.0)
    wy = (b * b * b / 6.0, 2 / 3 - t * t * (1.0 - 0.5 * t), 2 / 3 - b * b * (1.0 - 0.5 * b), t * t * t / 6.0)
    dx = (-0.5 * a * a, s * (1.5 * s - 2.0), -a * (1.5 * a - 2.0), 0.5 * s * s)
    dy = (-0.5 * b * b, t * (1.5 * t - 2.0), -b * (1.5 * b - 2.0), 0.5 * t * t)
    ddx = (a, 3.0 * s - 2.0, 3.0 * a - 2.0, s)
    ddy = (b, 3.0 * t - 2.0, 3.0 * b - 2.0, t)
    # fmt: on
    height = sx = sy = bend = 0.0
    at = first + (i - 1) * ny + j - 1
    for k in range(4):
        r0, r1, r2, r3 = z[at], z[at + 1], z[at + 2], z[at + 3]
        row = wy[0] * r0 + wy[1] * r1 + wy[2] * r2 + wy[3] * r3
        height += wx[k] * row
        sx += dx[k] * row
        sy += wx[k] * (dy[0] * r0 + dy[1] * r1 + dy[2] * r2 + dy[3] * r3)
        bend += ddx[k] * row + wx[k] * (ddy[0] * r0 + ddy[1] * r1 + ddy[2] * r2 + ddy[3] * r3)
        at += ny
    fade = 1.0
    if edge < EDGE:
        fade = edge / EDGE
        fade = fade * fade * (3.0 - 2.0 * fade)
    return fade * height, fade * sx, fade * sy, fade * bend


@kernel
def surface(
    z: SingleArray, levels: Indices, field: Array, x: float, y: float, width: float
) -> tuple[float, float, float, float]:
    """Height [m], slopes and Laplacian [1/m] of the water, averaged over about `width` [m].

    Args:
        z: the field, and means of it over squares of 2, 4, 8, ... cells, one after another [m].
        levels: (n, 3) where each begins and its cells along x and y.
        field: x and y of the first cell [m], side of a cell [m].
        x: [m].
        y: [m].
        width: of a pixel on the water [m].
    """
    u, v = (x - field[0]) / field[2], (y - field[1]) / field[2]
    level, share = 0, 0.0
    if width > field[2]:
        fine = math.log2(width / field[2])
        level = min(int(fine), len(levels) - 1)
        share = min(fine - level, 1.0) if level < len(levels) - 1 else 0.0
    height = sx = sy = bend = 0.0
    for step in range(2):
        weight = share if step else 1.0 - share
        if weight > 0.01:
            size = float(1 << (level + step))
            p, q = (u + 0.5) / size - 0.5, (v + 0.5) / size - 0.5
            row = level + step
            h, a, b, c = spline(z, levels[row, 0], levels[row, 1], levels[row, 2], p, q)
            cell = size * field[2]
            height += weight * h
            sx += weight * a / cell
            sy += weight * b / cell
            bend += weight * c / (cell * cell)
    return height, sx, sy, bend


@kernel
def tile_at(tiles: SingleArray, level: int, u: float, v: float) -> Vector:
    """Bilinear sample of a periodic tile; u and v in tiles.

    Args:
        tiles: (levels, n, n, 3), n a power of two; each level is half as large as the one before and
            fills a corner.
        level: which.
        u: along the first axis [tiles].
        v: along the second [tiles].
    """
    n = tiles.shape[1] >> level
    x, y = u * n, v * n
    i, j = math.floor(x), math.floor(y)
    s, t = x - i, y - j
    i0, j0 = int(i) & (n - 1), int(j) & (n - 1)
    i1, j1 = (i0 + 1) & (n - 1), (j0 + 1) & (n - 1)
    a, b, c, d = (1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t
    red = a * tiles[level, i0, j0, 0] + b * tiles[level, i1, j0, 0]
    green = a * tiles[level, i0, j0, 1] + b * tiles[level, i1, j0, 1]
    blue = a * tiles[level, i0, j0, 2] + b * tiles[level, i1, j0, 2]
    return (
        red + c * tiles[level, i0, j1, 0] + d * tiles[level, i1, j1, 0],
        green + c * tiles[level, i0, j1, 1] + d * tiles[level, i1, j1, 1],
        blue + c * tiles[level, i0, j1, 2] + d * tiles[level, i1, j1, 2],
    )


@kernel
def bottom_at(bottom: SingleArray, u: float, v: float) -> float:
    """Bilinear sample, held beyond the edges; u and v in points."""
    u = min(max(u, 0.0), bottom.shape[0] - 1.001)
    v = min(max(v, 0.0), bottom.shape[1] - 1.001)
    i, j = int(u), int(v)
    s, t = u - i, v - j
    low = (1.0 - t) * float(bottom[i, j]) + t * float(bottom[i, j + 1])
    high = (1.0 - t) * float(bottom[i + 1, j]) + t * float(bottom[i + 1, j + 1])
    return (1.0 - s) * low + s * high


@kernel
def sky_at(sky: Array, z: float) -> Vector:
    """Colour of the sky in a direction of vertical part z, from a table over 0 to 1."""
    u = min(max(z, 0.0), 1.0) * (len(sky) - 1.001)
    i = int(u)
    s = u - i
    return (
        sky[i, 0] + s * (sky[i + 1, 0] - sky[i, 0]),
        sky[i, 1] + s * (sky[i + 1, 1] - sky[i, 1]),
        sky[i, 2] + s * (sky[i + 1, 2] - sky[i, 2]),
    )


@kernel
def glint(toward: float, variance: float) -> float:
    """Radiance of the sun mirrored by small waves, over that of the sun itself.

    A normal distribution of directions, so that rougher water spreads the same light wider.

    Args:
        toward: cosine between the mirrored ray and the sun.
        variance: of the slopes that are finer than a pixel, per axis.
    """
    spread = 4.0 * variance + 1.2e-4  # a slope turns the ray twice; the sun and its aureole
    off = 2.0 * (1.0 - toward)
    if off > 12.0 * spread:
        return 0.0
    return 2.2e-3 / spread * math.exp(-0.5 * off / spread)


@kernel
def aureole(toward: float) -> float:
    """How much brighter the sky is about the sun, from the cosine of the angle to it."""
    off = 1.0 - toward
    return 0.45 * math.exp(-off / 0.05) if off < 0.4 else 0.0
