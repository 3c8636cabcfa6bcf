"""A picture of the water, pixel by pixel: rays from the eye strike the surface and part there.

See `_ray_kernels` for how arrays are passed, and for the cache.
"""

import math

import numpy as np
import numpy.typing as npt

from mjskip._compile.jit import picture_kernel as kernel
from mjskip.draw._optics_kernels import AWAY, INDEX, Vector, fresnel, refract, surface
from mjskip.draw._ray_kernels import (
    BLOCK,
    EYE,
    FIELD,
    STILL,
    WATER,
    above,
    below,
    height_near,
    ripple,
    sounding,
)

Array = npt.NDArray[np.float64]
SingleArray = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]
Image = npt.NDArray[np.uint8]

ALIKE = 0.1  # of full brightness: neighbours that differ by less need nothing traced between them


@kernel
def meet(
    heights: SingleArray, levels: Indices, tall: SingleArray, numbers: Array,
    d: Vector, t: float, width: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Where a ray from the eye first meets the waves, from where it meets still water [m].

    Marched through the layer that the waves near by fill, then narrowed by the secant.

    Returns:
        Distance along the ray, height [m], slopes.
    """
    x, y, z = numbers[EYE], numbers[EYE + 1], numbers[EYE + 2]
    near = height_near(tall, numbers, x + t * d[0], y + t * d[1])
    if near < STILL:
        return t, 0.0, 0.0, 0.0
    cell = numbers[FIELD + 2]
    span = min(abs(near / d[2]), BLOCK * cell)  # beyond, the blocks are no longer known
    steps = min(int(span / cell), 16)
    if steps == 0:
        h, p, q, _ = surface(heights, levels, numbers, x + t * d[0], y + t * d[1], width)
        t += h / d[2]
        return t, h, p, q
    before, gap = t - span, 0.0
    last = 0.0
    for k in range(steps + 1):
        at = t - span + 2.0 * span * k / steps
        h, _, _, _ = surface(heights, levels, numbers, x + at * d[0], y + at * d[1], width)
        over = z + at * d[2] - h
        if k == 0:
            gap = over
        elif over * gap <= 0.0 or k == steps:
            last = at
            if over != gap:
                last = min(max(before - gap * (at - before) / (over - gap), before), at)
            break
        before, gap = at, over
    h, p, q, _ = surface(heights, levels, numbers, x + last * d[0], y + last * d[1], width)
    return last, h, p, q


@kernel
def strike(
    heights: SingleArray, levels: Indices, tall: SingleArray, ripples: SingleArray, numbers: Array,
    d: Vector, reach: float,
) -> tuple[float, Vector, Vector, float, float]:  # fmt: skip
    """Where a ray from the eye strikes the water.

    Returns:
        Distance [m], `AWAY` if it meets no water nearer than `reach`; the point; the normal there on
        the side of the eye; the variance of slopes finer than a pixel; the width of a pixel [m].
    """
    nowhere = (0.0, 0.0, 0.0)
    side = 1.0 if numbers[EYE + 2] > 0.0 else -1.0
    if d[2] * side > -1e-5:
        return AWAY, nowhere, nowhere, 0.0, 0.0
    t = -numbers[EYE + 2] / d[2]
    if t > 1.1 * reach + 0.3:
        return AWAY, nowhere, nowhere, 0.0, 0.0
    width = t * numbers[EYE + 12] / math.sqrt(max(abs(d[2]), 0.02))  # wider along the view
    t, height, sx, sy = meet(heights, levels, tall, numbers, d, t, width)
    if t > reach or t <= 0.0:
        return AWAY, nowhere, nowhere, 0.0, 0.0
    x, y = numbers[EYE] + t * d[0], numbers[EYE + 1] + t * d[1]
    p, q, variance = ripple(ripples, numbers, x, y, width)
    sx += p
    sy += q
    up = side / math.sqrt(1.0 + sx * sx + sy * sy)
    n = (-sx * up, -sy * up, up)
    lean = 0.03 + d[0] * n[0] + d[1] * n[1] + d[2] * n[2]
    if lean > 0.0:  # the far side of a wave is seen edge on: as much of it as leans to the eye
        n = (n[0] - lean * d[0], n[1] - lean * d[1], n[2] - lean * d[2])
        scale = 1.0 / math.sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])
        n = (n[0] * scale, n[1] * scale, n[2] * scale)
    return t, (x, y, height), n, variance, width


@kernel
def ray(numbers: Array, a: float, b: float) -> tuple[Vector, float]:
    """Unit direction through a place (-1 to 1) of the picture, and its length per length ahead."""
    dx = numbers[EYE + 3] + a * numbers[EYE + 6] + b * numbers[EYE + 9]
    dy = numbers[EYE + 4] + a * numbers[EYE + 7] + b * numbers[EYE + 10]
    dz = numbers[EYE + 5] + a * numbers[EYE + 8] + b * numbers[EYE + 11]
    scale = math.sqrt(dx * dx + dy * dy + dz * dz)
    one = 1.0 / scale
    return (dx * one, dy * one, dz * one), scale


@kernel
def reflection(d: Vector, n: Vector) -> tuple[float, Vector]:
    """Share of the light that is mirrored towards an eye above the water, and where it comes from."""
    cosine = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2])
    x, y = d[0] + 2.0 * cosine * n[0], d[1] + 2.0 * cosine * n[1]
    z = max(d[2] + 2.0 * cosine * n[2], 0.01)
    one = 1.0 / math.sqrt(x * x + y * y + z * z)
    return fresnel(cosine, 1.0 / INDEX), (x * one, y * one, z * one)


@kernel
def sketch(
    heights: SingleArray, levels: Indices, tall: SingleArray, ripples: SingleArray,
    ground: SingleArray, bottom: SingleArray, panorama: Image, stones: Array, sky: Array,
    numbers: Array, first: int, last: int, out: SingleArray,
) -> None:  # fmt: skip
    """The water through each point of a coarse picture, as if nothing were in front.

    Args:
        first: row of `out`.
        last: one past the last.
        out: (h, w, 8) colours seen under water and depth of the bottom [m]; for an eye above it the
            colours of the water and one over its distance [1/m], 0 where there is none; rows from
            the top; others as in `shade`.
    """
    h, w = out.shape[0], out.shape[1]
    side = 1.0 if numbers[EYE + 2] > 0.0 else -1.0
    for row in range(first, last):
        b = 1.0 - (2.0 * row + 1.0) / h
        for column in range(w):
            d, _ = ray(numbers, (2.0 * column + 1.0) / w - 1.0, b)
            t, point, n, variance, width = strike(heights, levels, tall, ripples, numbers, d, 200.0)
            if t == AWAY:
                out[row, column, 7] = 0.0
                if side > 0.0:
                    out[row, column, 3] = AWAY
                    continue
                point, down, width = (numbers[EYE], numbers[EYE + 1], numbers[EYE + 2]), d, 0.0
            elif side > 0.0:
                down = refract(d, n, 1.0 / INDEX)
            else:
                k = -2.0 * (d[0] * n[0] + d[1] * n[1] + d[2] * n[2])
                down = (d[0] + k * n[0], d[1] + k * n[1], min(d[2] + k * n[2], -0.01))
            colour, depth = below(
                heights, levels, tall, ripples, ground, bottom, stones, numbers, point, down, width
            )
            out[row, column, 3] = depth
            for k in range(3):
                out[row, column, k] = colour[k]
            if side > 0.0:
                part, up = reflection(d, n)
                seen = above(stones, sky, panorama, numbers, point, up, variance)
                for k in range(3):
                    out[row, column, 4 + k] = min(part * seen[k] + (1.0 - part) * colour[k], 1.0)
                out[row, column, 7] = 1.0 / t


@kernel
def find_smooth(coarse: SingleArray, smooth: Image) -> None:
    """Where four neighbours of a coarse picture are so alike that what is between them is too.

    Args:
        coarse: from `sketch`.
        smooth: out (h, w), 1 where the point and its neighbours right and below are.
    """
    h, w = coarse.shape[0], coarse.shape[1]
    smooth[h - 1] = 0
    smooth[:, w - 1] = 0
    for i in range(h - 1):
        for j in range(w - 1):
            least = min(
                min(coarse[i, j, 7], coarse[i, j + 1, 7]),
                min(coarse[i + 1, j, 7], coarse[i + 1, j + 1, 7]),
            )
            alike = least > 0.0
            for k in range(4, 7):
                a, b, c, d = (
                    coarse[i, j, k],
                    coarse[i, j + 1, k],
                    coarse[i + 1, j, k],
                    coarse[i + 1, j + 1, k],
                )
                if max(max(a, b), max(c, d)) - min(min(a, b), min(c, d)) > ALIKE:
                    alike = False
            smooth[i, j] = 1 if alike else 0


@kernel
def between(coarse: SingleArray, i: int, j: int, s: float, t: float, k: int) -> float:
    """Bilinear sample of a channel, a share t down and s right of a point."""
    top = (1.0 - s) * coarse[i, j, k] + s * coarse[i, j + 1, k]
    found: float = (1.0 - t) * top + t * (
        (1.0 - s) * coarse[i + 1, j, k] + s * coarse[i + 1, j + 1, k]
    )
    return found


@kernel
def shade(
    heights: SingleArray, levels: Indices, tall: SingleArray, ripples: SingleArray,
    bottom: SingleArray, panorama: Image, stones: Array, sky: Array, numbers: Array,
    coarse: SingleArray, smooth: Image, picture: Image, distances: SingleArray, first: int, last: int, out: Image,
) -> None:  # fmt: skip
    """Draw the water into rows first to last of a picture of everything else.

    The two parts of the light, reflected and refracted, are weighted by R and 1 - R: together they
    are all of it.

    Args:
        heights: the surface and its means over squares of 2, 4, ... cells, one after another [m].
        levels: (n, 3) where each begins, and its cells along x and y.
        tall: (m, k) greatest height in each block of cells and those around it [m].
        ripples: (l, n, n, 3) tiles of slopes and Laplacian [1/m] of a breath of wind.
        bottom: (m, k) heights of the bottom [m].
        panorama: see `above`.
        stones: (s, 16), see `mjskip.draw.optics.pack_stones`.
        sky: (n, 3) colours by the vertical part of the direction, 0 to 1.
        numbers: (52,) see the top of this file.
        coarse: from `sketch`, half as many points each way: what is seen through water is soft.
        smooth: from `find_smooth`: where that is enough; elsewhere every pixel is traced.
        picture: (h, w, 3) without water, rows from the bottom as OpenGL gives them.
        distances: (h, w) along the view [m], likewise.
        first: row of `out`.
        last: one past the last.
        out: (h, w, 3), rows from the top.
    """
    h, w = distances.shape
    sunk = numbers[EYE + 2] < 0.0
    rows, columns = smooth.shape
    for row in range(first, last):
        line = h - 1 - row
        down = min(max((row + 0.5) / h * rows - 0.5, 0.0), rows - 1.001)
        i, v = int(down), down - int(down)
        for column in range(w):
            a, b = (column + 0.5) / w, (row + 0.5) / h
            right = min(max(a * columns - 0.5, 0.0), columns - 1.001)
            j, u = int(right), right - int(right)
            d, scale = ray(numbers, 2.0 * a - 1.0, 1.0 - 2.0 * b)
            reach = distances[line, column] * scale
            share, length, t = 1.0, reach, AWAY
            red, green, blue = 0.0, 0.0, 0.0
            if smooth[i, j] == 1 and not sunk:
                t = 1.0 / between(coarse, i, j, u, v, 7)
                if t > reach:
                    t = AWAY
                else:
                    red = between(coarse, i, j, u, v, 4)
                    green = between(coarse, i, j, u, v, 5)
                    blue = between(coarse, i, j, u, v, 6)
            else:
                t, point, n, variance, _ = strike(heights, levels, tall, ripples, numbers, d, reach)
                if t < AWAY:
                    length = t
                    k, y = (i + 1, 0.0) if coarse[i, j, 3] == AWAY else (i, v)  # over the horizon
                    if sunk:
                        cosine = -(d[0] * n[0] + d[1] * n[1] + d[2] * n[2])
                        part, beyond = 1.0 - fresnel(cosine, INDEX), refract(d, n, INDEX)
                    else:
                        part, beyond = reflection(d, n)
                    rest = 1.0 - part
                    red = rest * between(coarse, k, j, u, y, 0)
                    green = rest * between(coarse, k, j, u, y, 1)
                    blue = rest * between(coarse, k, j, u, y, 2)
                    if part > 0.0:
                        seen = above(stones, sky, panorama, numbers, point, beyond, variance)
                        red += part * seen[0]
                        green += part * seen[1]
                        blue += part * seen[2]
            if t == AWAY:
                if not sunk:
                    for k in range(3):
                        out[row, column, k] = picture[line, column, k]
                    continue
                # an eye under water, a ray that stays there
                x, y = numbers[EYE] + reach * d[0], numbers[EYE + 1] + reach * d[1]
                share = 0.0
                if numbers[EYE + 2] + reach * d[2] < sounding(bottom, numbers, x, y) + 0.03:
                    red = between(coarse, i, j, u, v, 0)
                    green = between(coarse, i, j, u, v, 1)
                    blue = between(coarse, i, j, u, v, 2)
                    share, length = 1.0, 0.0
            elif not sunk:  # the bank goes on into the water as it is drawn
                depth = between(coarse, i, j, u, v, 3)
                share = min(max(depth, 0.0) / 0.3, 1.0)
            colour = (red, green, blue)
            for k in range(3):
                value = 255.0 * colour[k]
                if share < 1.0:
                    value = share * value + (1.0 - share) * picture[line, column, k]
                if sunk:
                    kept = math.exp(-length * numbers[WATER + k])
                    value = kept * value + 255.0 * (1.0 - kept) * numbers[WATER + 3 + k]
                out[row, column, k] = int(min(max(value, 0.0), 255.0) + 0.5)
