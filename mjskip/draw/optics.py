"""Water worth looking at: sky, sun and stones in it, and the bottom through it.

Everything here is arithmetic on arrays: no OpenGL, no MuJoCo. `Lake.shade` adds the water to a
picture of everything else; `mjskip.draw.render` makes that picture.

A breath of wind is drawn on the water as ripples of a few millimetres, so that still water looks like
a lake and not like glass. It is drawn only: no stone feels it, and it is in no result.
"""

from __future__ import annotations

import functools
import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter, maximum_filter
from scipy.spatial import cKDTree

from mjskip.draw._optics_kernels import INDEX as INDEX
from mjskip.draw._optics_kernels import fresnel as fresnel
from mjskip.draw._optics_kernels import refract as refract
from mjskip.draw._ray_kernels import BLOCK, NUMBERS
from mjskip.draw._shade_kernels import find_smooth, shade, sketch

Array = npt.NDArray[np.float64]
SingleArray = npt.NDArray[np.float32]
Image = npt.NDArray[np.uint8]

LARGEST = 800  # cells a side: of a larger field a window about what is looked at is enough
_COARSE = 3  # pixels of the picture a side of one of the sketch
_LEVELS = 6
_THREADS = min(4, os.cpu_count() or 1)
_RIPPLE_SIDE = 2.56  # [m]
_SLOPE = 0.006  # root mean square of a slope of one sheet of ripples, along an axis
_GROUND_SIDE = 3.0  # [m]


@dataclass(frozen=True, kw_only=True, eq=False)
class Eye:
    """A pinhole camera.

    Attributes:
        position: (3,) [m].
        forward: unit (3,).
        up: unit (3,), across forward.
        half_height: tangent of half the vertical angle of view.
        aspect: width over height of the picture.
    """

    position: Array
    forward: Array
    up: Array
    half_height: float
    aspect: float

    @property
    def right(self) -> Array:
        """Unit (3,)."""
        return np.cross(self.forward, self.up)

    def project(self, points: Array) -> tuple[Array, Array]:
        """Where points (n, 3) are seen: (n, 2) in -1 to 1 from bottom left, and how far ahead [m]."""
        to = np.asarray(points) - self.position
        ahead = to @ self.forward
        with np.errstate(divide="ignore", invalid="ignore"):
            place = np.column_stack([to @ self.right / self.aspect, to @ self.up])
            place /= self.half_height * ahead[:, None]
        return place, ahead


@dataclass(frozen=True, kw_only=True, eq=False)
class Ellipsoid:
    """A stone as the optics sees it.

    Attributes:
        centre: (3,) [m].
        rotation: (3, 3) body to world.
        semi_axes: (3,) [m].
        colour: (3,) 0 to 1.
    """

    centre: Array
    rotation: Array
    semi_axes: Array
    colour: Array


def pack_stones(stones: Sequence[Ellipsoid]) -> Array:
    """Rows (n, 16): centre, the matrix that makes it a unit sphere, colour, largest semi-axis."""
    rows = np.empty((len(stones), 16))
    for row, stone in zip(rows, stones, strict=True):
        row[:3] = stone.centre
        row[3:12] = (stone.rotation / stone.semi_axes).T.ravel()
        row[12:15] = stone.colour
        row[15] = stone.semi_axes.max()
    return rows


@dataclass(frozen=True, kw_only=True, eq=False)
class Panorama:
    """The scenery all around, for reflections.

    Attributes:
        colours: (rows, columns, 4) colours and 250 over the horizontal distance [1/m]; rows by the
            tangent above the horizon, columns by the pseudo-angle y / (|x| + |y|) that goes once round
            from -1 to 3.
        place: where it was taken (3,) [m].
        tangents: of the lowest and the highest row.
    """

    colours: Image
    place: tuple[float, float, float]
    tangents: tuple[float, float]


EMPTY = Panorama(
    colours=np.empty((0, 0, 4), np.uint8), place=(0.0, 0.0, 0.0), tangents=(-2.0, -1.0)
)
"""No scenery: a sky alone."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lake:
    """Light and ground of a lake.

    Attributes:
        sun: unit direction towards it (3,).
        sky: (n, 3) colours by the vertical part of the direction, 0 to 1.
        bottom: (m, k) heights of the ground [m].
        place: x, y of its first point and their distance [m].
        panorama: the scenery that the water mirrors.
        absorption: of red, green and blue [1/m].
        deep: colour of water without a bottom (3,).
        sunlight: colour of the sun (3,).
        wind: how much of the drawn ripples there is; 0 for a lake like glass.
    """

    sun: Array
    sky: Array
    bottom: SingleArray
    place: Array
    panorama: Panorama = EMPTY
    absorption: tuple[float, float, float] = (0.95, 0.36, 0.30)
    deep: tuple[float, float, float] = (0.012, 0.13, 0.17)
    sunlight: tuple[float, float, float] = (1.0, 0.95, 0.84)
    wind: float = 1.0

    def __post_init__(self) -> None:
        if not math.isclose(float(np.linalg.norm(self.sun)), 1.0, rel_tol=1e-6):
            raise ValueError(f"sun is {self.sun!r}: give a unit direction towards it")
        if not self.sun[2] > 0.0:
            raise ValueError(f"sun is {self.sun!r}: it must be above the horizon")

    def draw(
        self,
        eye: Eye,
        picture: Image,
        distances: SingleArray,
        *,
        elevation: npt.NDArray[np.float32],
        spacing: float,
        centre: tuple[float, float],
        stones: Sequence[Ellipsoid] = (),
        focus: tuple[float, float] = (0.0, 0.0),
        time: float = 0.0,
    ) -> Image:
        """A picture (h, w, 3), rows from the top, of a scene with its water.

        Args:
            eye: the camera.
            picture: (h, w, 3) of the scene without water, rows from the bottom as OpenGL gives them.
            distances: (h, w) to what is in it, along the view [m], likewise.
            elevation: (nx, ny) of the surface [m].
            spacing: side of a cell [m].
            centre: of the field [m].
            stones: that are mirrored, cast shadows and are seen under water.
            focus: of a large field only a window about this point is drawn [m].
            time: of the wind's ripples [s].
        """
        first, parts = [], []
        for count, middle, at in zip(elevation.shape, centre, focus, strict=True):
            start = middle - 0.5 * (count - 1) * spacing
            low = round((at - start) / spacing) - LARGEST // 2
            low = min(max(low, 0), max(count - LARGEST, 0))
            parts.append(slice(low, low + min(count, LARGEST)))
            first.append(start + low * spacing)
        part = elevation[parts[0], parts[1]]
        heights, levels = _pyramid(part)
        ripples, lost = self._ripples
        high, wide, _ = picture.shape
        numbers = np.concatenate(
            [
                [*first, spacing],
                [_RIPPLE_SIDE, time, _RIPPLE_SIDE / ripples.shape[1]],
                [_GROUND_SIDE, _GROUND_SIDE / _ground().shape[1]],
                self.place,
                self.sun,
                self.sunlight,
                self.absorption,
                self.deep,
                self.panorama.place,
                self.panorama.tangents,
                eye.position,
                eye.forward,
                eye.half_height * eye.aspect * eye.right,
                eye.half_height * eye.up,
                [2.0 / wide * eye.half_height * eye.aspect],
                lost,
            ]
        )
        numbers = np.append(numbers, np.zeros(NUMBERS - len(numbers)))
        out: Image = np.empty((high, wide, 3), np.uint8)
        coarse = np.empty((-(-high // _COARSE), -(-wide // _COARSE), 8), np.float32)
        smooth = np.empty(coarse.shape[:2], np.uint8)
        packed, tall, views = pack_stones(stones), _tall(part), self.panorama.colours

        def share_rows(kernel: Callable[..., None], count: int, *given: Any) -> None:
            """Each thread draws its rows; the kernels release Python's lock."""
            cuts = np.linspace(0, count, _THREADS + 1).astype(int).tolist()

            def draw(first: int, last: int) -> None:
                kernel(*given[:-1], first, last, given[-1])

            list(_pool().map(draw, cuts[:-1], cuts[1:]))

        share_rows(
            sketch, len(coarse), heights, levels, tall, ripples, _ground(), self.bottom, views,
            packed, self.sky, numbers, coarse,
        )  # fmt: skip
        find_smooth(coarse, smooth)
        share_rows(
            shade, high, heights, levels, tall, ripples, self.bottom, views, packed, self.sky,
            numbers, coarse, smooth, picture, distances, out,
        )  # fmt: skip
        return out

    @functools.cached_property
    def _ripples(self) -> tuple[SingleArray, Array]:
        tiles, lost = _breath()
        return np.float32(self.wind) * tiles, self.wind**2 * lost


@functools.cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_THREADS, thread_name_prefix="mjskip optics")


def _tall(elevation: npt.NDArray[np.float32]) -> SingleArray:
    """Greatest height or depth in each block of cells and the eight around it."""
    nx, ny = (-(-n // BLOCK) for n in elevation.shape)
    padded = np.zeros((nx * BLOCK, ny * BLOCK), np.float32)
    np.abs(elevation, out=padded[: elevation.shape[0], : elevation.shape[1]])
    blocks = padded.reshape(nx, BLOCK, ny, BLOCK).max(axis=3).max(axis=1)
    return np.asarray(maximum_filter(blocks, 3, mode="nearest"))


def _pyramid(elevation: npt.NDArray[np.float32]) -> tuple[SingleArray, npt.NDArray[np.int64]]:
    """A surface and its means over squares of 2 to 32 cells, flat; where each begins, its shape."""
    grids = [np.asarray(elevation, np.float32)]
    while len(grids) < _LEVELS and min(grids[-1].shape) >= 2:
        fine = grids[-1]
        nx, ny = (n // 2 * 2 for n in fine.shape)
        rows = fine[0:nx:2, :ny] + fine[1:nx:2, :ny]
        grids.append(np.float32(0.25) * (rows[:, 0::2] + rows[:, 1::2]))
    begins = np.cumsum([0, *(grid.size for grid in grids[:-1])])
    levels = [(at, *grid.shape) for at, grid in zip(begins, grids, strict=True)]
    return np.concatenate([grid.ravel() for grid in grids]), np.array(levels, np.int64)


@functools.cache
def _breath() -> tuple[SingleArray, Array]:
    """Ripples as tiles of slopes and Laplacian, (levels, n, n, 3), and the variance of each lost."""
    n = 256
    k = 2.0 * math.pi * np.fft.fftfreq(n, _RIPPLE_SIDE / n)
    kx, ky = k[:, None], k[None, :]
    number = np.hypot(kx, ky)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (0.8 * kx + 0.6 * ky) / number
        shape = number**-2.2 * np.exp(-((number * 0.008) ** 2)) * (0.25 + along**2)
    shape[(number < 2.0 * math.pi / 0.8) | (number == 0.0)] = 0.0
    random = np.random.default_rng(4)
    waves = shape * np.fft.fft2(random.normal(size=(n, n)))
    slopes = [np.fft.ifft2(1j * axis * waves).real for axis in (kx, ky)]
    waves *= _SLOPE / math.sqrt(np.mean([s**2 for s in slopes]))
    tiles, left = [], []
    for level in range(_LEVELS):
        blur = waves * np.exp(-0.5 * (0.5 * 2.0**level * _RIPPLE_SIDE / n * number) ** 2)
        parts = [np.fft.ifft2(f * blur).real for f in (1j * kx, 1j * ky, -(number**2))]
        tiles.append(np.stack(parts, axis=-1))
        left.append(float(np.mean([p**2 for p in parts[:2]])))
    lost = 2.0 * np.maximum(_SLOPE**2 - np.array([*left, 0.0]), 0.0)
    return _shrunk(tiles), lost


@functools.cache
def _ground() -> SingleArray:
    """Sand with pebbles: (levels, n, n, 3) colours of a tile that repeats."""
    n, count = 512, 2400
    random = np.random.default_rng(7)

    def noise(size: float) -> Array:
        rough = gaussian_filter(random.normal(size=(n, n)), size, mode="wrap")
        return np.asarray(rough / rough.std())

    at = random.uniform(0.0, n, (count, 2))
    rows, columns = np.meshgrid(np.arange(n) + 0.5, np.arange(n) + 0.5, indexing="ij")
    wobble = np.stack([rows + 1.5 * noise(5.0), columns + 1.5 * noise(5.0)], axis=-1) % n
    found = cKDTree(at, boxsize=np.array([n, n])).query(wobble, k=2)
    distance, nearest = np.asarray(found[0]), np.asarray(found[1])
    rim = distance[..., 1] - distance[..., 0]  # 0 where two pebbles would touch
    which = nearest[..., 0]
    crowd = gaussian_filter(random.normal(size=(n, n)), 60.0, mode="wrap")
    crowd /= crowd.std()
    shown = (random.normal(size=count) < 0.9 * crowd[at[:, 0].astype(int), at[:, 1].astype(int)])[
        which
    ]
    size = (random.uniform(2.5, 7.5, count))[which]
    inside = np.clip((np.minimum(rim, size - distance[..., 0]) - 0.5) / 2.0, 0.0, 1.0) * shown
    bulge = np.sqrt(np.clip(1.0 - (distance[..., 0] / size) ** 2, 0.0, 1.0))
    sand = np.array([0.80, 0.69, 0.50]) * (1.0 + 0.05 * noise(0.7) + 0.05 * noise(12.0))[..., None]
    tints = np.array(
        [
            [0.52, 0.50, 0.47],
            [0.40, 0.36, 0.33],
            [0.68, 0.64, 0.57],
            [0.55, 0.43, 0.34],
            [0.30, 0.31, 0.33],
            [0.86, 0.83, 0.77],
        ]
    )
    tint = (tints[random.integers(len(tints), size=count)] * random.uniform(0.8, 1.15, (count, 1)))[
        which
    ]
    tint = tint * ((0.6 + 0.5 * bulge) * (1.0 + 0.05 * noise(1.0)))[..., None]
    shadow = 1.0 - 0.35 * np.roll(inside, (2, 2), axis=(0, 1)) * (1.0 - inside)
    colour = sand * shadow[..., None] * (1.0 - inside[..., None]) + tint * inside[..., None]
    levels = [colour]
    for level in range(1, _LEVELS):
        levels.append(gaussian_filter(colour, (0.5 * 2.0**level,) * 2 + (0,), mode="wrap"))
    return np.clip(_shrunk(levels), 0.0, 1.0)


def _shrunk(levels: Sequence[Array]) -> SingleArray:
    """Tiles (levels, n, n, 3), each level by half smaller than the one before, in a corner.

    A level is already smooth on its own scale; means over the squares keep it in its place.
    """
    packed = np.zeros((len(levels), *levels[0].shape), np.float32)
    for k, level in enumerate(levels):
        n, size = len(level) >> k, 1 << k
        packed[k, :n, :n] = level.reshape(n, size, n, size, 3).mean(axis=(1, 3))
    return packed
