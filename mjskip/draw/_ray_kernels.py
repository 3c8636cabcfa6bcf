"""What rays see that leave the water's surface: the bottom and stones below, scenery and sky above.

Arrays go from kernel to kernel one by one, and single numbers in one array: numba counts references
to what comes out of tuples, for every pixel. Its cache looks at the age of the file of the outermost
kernel only: touch `_shade_kernels` after a change here or in `_optics_kernels`.
"""

import math

import numpy as np
import numpy.typing as npt

from mjskip._compile.jit import picture_kernel as kernel
from mjskip.draw._optics_kernels import (
    AWAY,
    INDEX,
    Vector,
    aureole,
    bottom_at,
    caustic,
    ellipsoid,
    glint,
    lit_stone,
    sky_at,
    surface,
    tile_at,
)

Array = npt.NDArray[np.float64]
SingleArray = npt.NDArray[np.float32]
Indices = npt.NDArray[np.int64]
Image = npt.NDArray[np.uint8]

# where in `numbers`
FIELD = 0  # x, y of the first cell, side of a cell [m]
BREATH = 3  # side of a tile of ripples [m], time [s], texel [m]
PATCH = 6  # side of a tile of ground [m], texel [m]
PLACE = 8  # x, y of the first sounding, their distance [m]
SUN = 11  # towards it, its colour
WATER = 17  # absorption [1/m], colour of deep water
PANORAMA = 23  # where it was taken x, y, z [m], lowest and highest tangent above the horizon
EYE = 28  # position, forward, right and up scaled by the half widths, pixel over half width
LOST = 41  # variance of slopes that each level of the ripples no longer shows
NUMBERS = 52

FAR = 20.0  # [m]: nothing is seen so far through water
SHALLOW = 0.15  # [m]: from about this depth comes the light that deep water scatters
MIXED = 0.1  # of the depth: finer waves cast light that has mixed before it is on the bottom
BLOCK = 16  # cells a side of the blocks of which the greatest height is known
STILL = 5e-5  # [m]: what is lower is drawn as still water


@kernel
def ripple(
    ripples: SingleArray, numbers: Array, x: float, y: float, width: float
) -> tuple[float, float, float]:
    """Slopes of the wind's ripples, and the variance of those finer than a pixel.

    Two sheets of one tile drift over one another, the second turned by (cos, sin) = (0.8, 0.6) and
    1.37 times as large: together they do not repeat in sight.
    """
    side, time, texel = numbers[BREATH], numbers[BREATH + 1], numbers[BREATH + 2]
    last = ripples.shape[0]
    level = int(math.log2(width / texel) + 0.5) if width > texel else 0
    if level >= last:
        return 0.0, 0.0, numbers[LOST + last]
    p, q, _ = tile_at(ripples, level, x / side + 0.07 * time, y / side + 0.03 * time)
    u, v = (0.8 * x + 0.6 * y) / (1.37 * side), (0.8 * y - 0.6 * x) / (1.37 * side)
    r, s, _ = tile_at(ripples, level, u - 0.05 * time, v + 0.04 * time)
    return p + 0.8 * r - 0.6 * s, q + 0.6 * r + 0.8 * s, numbers[LOST + level]


@kernel
def height_near(tall: SingleArray, numbers: Array, x: float, y: float) -> float:
    """Greatest height or depth of the surface in the block about a point and those around it [m]."""
    size = BLOCK * numbers[FIELD + 2]
    i = math.floor((x - numbers[FIELD]) / size)
    j = math.floor((y - numbers[FIELD + 1]) / size)
    if i < 0.0 or j < 0.0 or i >= tall.shape[0] or j >= tall.shape[1]:
        return 0.0
    return float(tall[int(i), int(j)])


@kernel
def sounding(bottom: SingleArray, numbers: Array, x: float, y: float) -> float:
    """Height of the bottom [m]."""
    step = numbers[PLACE + 2]
    return bottom_at(bottom, (x - numbers[PLACE]) / step, (y - numbers[PLACE + 1]) / step)


@kernel
def light_below(
    heights: SingleArray, levels: Indices, tall: SingleArray, ripples: SingleArray, stones: Array,
    numbers: Array, x: float, y: float, z: float, width: float,
) -> float:  # fmt: skip
    """Sunlight at a point under water over that under still water: caustics and stones' shadows."""
    sun = (numbers[SUN], numbers[SUN + 1], numbers[SUN + 2])
    k = 1.0 / math.sqrt(INDEX * INDEX - 1.0 + sun[2] * sun[2])  # (k x, k y, 1): the sun under water
    u, v = x - z * k * sun[0], y - z * k * sun[1]
    bend = 0.0
    if height_near(tall, numbers, u, v) > STILL:
        _, _, _, bend = surface(heights, levels, numbers, u, v, max(width, MIXED * -z))
    texel = numbers[BREATH + 2]
    level = int(math.log2(width / texel) + 0.5) if width > texel else 0
    if level < ripples.shape[0]:
        side, time = numbers[BREATH], numbers[BREATH + 1]
        _, _, wind = tile_at(ripples, level, u / side + 0.07 * time, v / side + 0.03 * time)
        bend += 1.4 * wind  # for both sheets
    light = caustic(-z, bend)
    for n in range(len(stones)):
        near = AWAY
        if stones[n, 2] - stones[n, 15] < 0.0:
            scale = 1.0 / math.sqrt((k * sun[0]) ** 2 + (k * sun[1]) ** 2 + 1.0)
            up = (k * sun[0] * scale, k * sun[1] * scale, scale)
            _, near = ellipsoid(stones, n, (x, y, z), up)
        if near > 1.5 and stones[n, 2] + stones[n, 15] > 0.0:
            _, near = ellipsoid(stones, n, (u, v, 0.0), sun)
        if near < 1.5:  # a soft edge: the sun is no point, and the water no pane
            share = min(max((near - 0.6) / 0.9, 0.0), 1.0)
            light *= share * share * (3.0 - 2.0 * share)
    return light


@kernel
def below(
    heights: SingleArray, levels: Indices, tall: SingleArray, ripples: SingleArray,
    ground: SingleArray, bottom: SingleArray, stones: Array, numbers: Array,
    o: Vector, d: Vector, width: float,
) -> tuple[Vector, float]:  # fmt: skip
    """What a ray sees that travels under water: its colour, and the depth of the bottom there [m].

    Beer-Lambert: light loses exp(-absorption length), along the ray and on its way down from the
    surface, and the colour of deep water takes its place.
    """
    z = sounding(bottom, numbers, o[0], o[1])
    length = AWAY
    if d[2] < -1e-3 and (z - o[2]) / d[2] < FAR:
        for _ in range(2):
            length = (min(z, o[2] - 0.02) - o[2]) / d[
                2
            ]  # before a bank that rises out of the water
            z = sounding(bottom, numbers, o[0] + length * d[0], o[1] + length * d[1])
    hit = -1
    for k in range(len(stones)):
        if stones[k, 2] - stones[k, 15] < 0.0:
            t, _ = ellipsoid(stones, k, o, d)
            if t < length and o[2] + t * d[2] < 0.0:
                length, hit = t, k
    glow = 1.0  # light that the water scatters: brighter under a crest, which gathers it
    if height_near(tall, numbers, o[0], o[1]) > STILL:
        _, _, _, bend = surface(heights, levels, numbers, o[0], o[1], width)
        glow = 0.3 + 0.7 * caustic(SHALLOW, bend)
    deep = (glow * numbers[WATER + 3], glow * numbers[WATER + 4], glow * numbers[WATER + 5])
    if length > FAR:
        return deep, -z
    if hit >= 0:
        sun = (numbers[SUN], numbers[SUN + 1], numbers[SUN + 2])
        r, g, b = lit_stone(stones, hit, o, d, length, sun)
        down = max(-(o[2] + length * d[2]), 0.0)
    else:
        x, y = o[0] + length * d[0], o[1] + length * d[1]
        down = max(-z, 0.0)
        side, texel = numbers[PATCH], numbers[PATCH + 1]
        last = ground.shape[0] - 1
        level = min(int(math.log2(width / texel) + 0.5), last) if width > texel else 0
        r, g, b = tile_at(ground, level, x / side, y / side)
        # banks of sand, metres wide: otherwise the tile is seen to repeat
        _, patchy, _ = tile_at(ground, last, (0.6 * x - 0.8 * y) / 7.3, (0.8 * x + 0.6 * y) / 7.3)
        sunny = light_below(heights, levels, tall, ripples, stones, numbers, x, y, z, width)
        light = (0.6 + 0.9 * patchy) * (0.45 + 0.6 * sunny)
        r, g, b = light * r, light * g, light * b
    path = -length - 1.15 * down
    p = math.exp(path * numbers[WATER])
    q = math.exp(path * numbers[WATER + 1])
    s = math.exp(path * numbers[WATER + 2])
    return (
        p * r + (1.0 - p) * deep[0],
        q * g + (1.0 - q) * deep[1],
        s * b + (1.0 - s) * deep[2],
    ), -z


@kernel
def above(
    stones: Array, sky: Array, panorama: Image, numbers: Array,
    o: Vector, d: Vector, variance: float,
) -> Vector:  # fmt: skip
    """What a ray sees that travels up from the water: stones, the scenery all around, sky, sun.

    Args:
        panorama: (rows, columns, 4) colours of the scenery and 250 over its horizontal distance [1/m],
            seen from one place; rows by the tangent above the horizon, columns by the pseudo-angle
            y / (|x| + |y|), which goes round once from -1 to 3; (0, 0, 4) for a sky alone.
    """
    for k in range(len(stones)):
        t, _ = ellipsoid(stones, k, o, d)
        if t < AWAY:
            return lit_stone(stones, k, o, d, t, (numbers[SUN], numbers[SUN + 1], numbers[SUN + 2]))
    rows, columns = panorama.shape[0], panorama.shape[1]
    level = math.sqrt(d[0] * d[0] + d[1] * d[1])
    low, high = numbers[PANORAMA + 3], numbers[PANORAMA + 4]
    colour = (0.0, 0.0, 0.0)
    t = AWAY
    if d[2] < high * level:
        x, y, z = (
            o[0] - numbers[PANORAMA],
            o[1] - numbers[PANORAMA + 1],
            o[2] - numbers[PANORAMA + 2],
        )
        reach = 8.0 / level
        s = 0.0
        for step in range(3):  # where the ray meets what the panorama shows in that direction
            u, v = x + reach * d[0], y + reach * d[1]
            sharp = v / (abs(u) + abs(v))
            away = math.sqrt(u * u + v * v)
            s = (1.0 + (sharp if u >= 0.0 else 2.0 - sharp)) * 0.25 * columns
            t = ((z + reach * d[2]) / away - low) / (high - low) * rows
            if step < 2:
                i, j = min(max(int(t), 0), rows - 1), min(max(int(s), 0), columns - 1)
                reach = max(reach + (250.0 / (panorama[i, j, 3] + 0.5) - away) / level, 0.5)
        if t < rows - 1.5:
            s, t = max(s - 0.5, 0.0), max(t - 0.5, 0.0)
            i, j = int(t), min(int(s), columns - 2)
            s, t = min(s - j, 1.0), t - i
            a, b = (1.0 - t) / 255.0, t / 255.0
            p, q = (1.0 - s) * a, s * a
            r = p * panorama[i, j, 0] + q * panorama[i, j + 1, 0]
            g = p * panorama[i, j, 1] + q * panorama[i, j + 1, 1]
            w = p * panorama[i, j, 2] + q * panorama[i, j + 1, 2]
            p, q = (1.0 - s) * b, s * b
            r += p * panorama[i + 1, j, 0] + q * panorama[i + 1, j + 1, 0]
            g += p * panorama[i + 1, j, 1] + q * panorama[i + 1, j + 1, 1]
            w += p * panorama[i + 1, j, 2] + q * panorama[i + 1, j + 1, 2]
            colour = (r, g, w)
        else:
            t = AWAY
    if t == AWAY:
        colour = sky_at(sky, d[2])
    toward = d[0] * numbers[SUN] + d[1] * numbers[SUN + 1] + d[2] * numbers[SUN + 2]
    shine = glint(toward, variance) + aureole(toward)
    return (
        colour[0] + shine * numbers[SUN + 3],
        colour[1] + shine * numbers[SUN + 4],
        colour[2] + shine * numbers[SUN + 5],
    )
