"""Any water as a picture shows it: heights on a grid about what is looked at."""

from __future__ import annotations

import math
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, SingleArray
from mjskip.coupling.water_surface import (
    SQUARE,
    SQUARE_SPACING,
    GridElevation,
    WaterSurface,
    sea_square,
)
from mjskip.draw._draw_kernels import fill_surface

BLOCK = 16
"""Cells a side of the blocks of which the greatest height is known; `water.glsl` knows it too."""

BORDER = 12
"""Cells around a field over which what is drawn fades into still water."""

WINDOW = 512
"""Cells a side of what is drawn of water without end."""

SEA_CLOSE = 10.0
"""Distance from which on cells of a sea become larger [m]."""


@runtime_checkable
class Surface(Protocol):
    """Water inside walls: `mjskip.HeightField` is one."""

    @property
    def elevation(self) -> SingleArray: ...  # (nx, ny) [m]
    @property
    def spacing(self) -> float: ...  # [m]
    @property
    def centre(self) -> tuple[float, float]: ...  # [m]


class Patch(NamedTuple):
    """Heights on a grid: a `Surface`.

    Attributes:
        elevation: (nx, ny) [m].
        spacing: side of a cell [m].
        centre: of the grid (x, y) [m].
    """

    elevation: SingleArray
    spacing: float
    centre: tuple[float, float]

    @property
    def origin(self) -> tuple[float, float]:
        """Where the first cell is (x, y) [m]."""
        nx, ny = self.elevation.shape
        x, y = self.centre
        return x - 0.5 * (nx - 1) * self.spacing, y - 0.5 * (ny - 1) * self.spacing


STILL = Patch(np.zeros((2, 2), np.float32), 1.0, (0.0, 0.0))


def patch_of(
    water: Any,
    *,
    focus: tuple[float, float] = (0.0, 0.0),
    distance: float = 0.0,
    time: float = 0.0,
    spacing: float | None = None,
    centre: tuple[float, float] = (0.0, 0.0),
    data: Any = None,
) -> Patch:
    """What is drawn of any water.

    Args:
        water: None for still water; an array (nx, ny) of heights [m] with its spacing; a `HeightField`;
            anything else with its `window`; a recording, which is asked for its surface at a time;
            a coupling of bodies and water, which is asked for the height of its surface; a `WaterSurface`.
        focus: of water without end, the part about this point is drawn (x, y) [m].
        distance: from the eye to there: a sea is drawn the coarser and the wider, the farther it is [m].
        time: of a recording [s].
        spacing: side of a cell of an array [m].
        centre: of an array (x, y) [m].
        data: the `mujoco.MjData` whose water it is, for a coupling; without it its water is still.

    Raises:
        ValueError: the water is none of these, or an array is of no use.
    """
    if water is None:
        return STILL
    if isinstance(water, np.ndarray):
        return _patch_of_array(water, spacing, centre)
    if callable(getattr(water, "at", None)):  # a recording
        return patch_of(water.at(time), focus=focus, time=time)
    if isinstance(water, WaterSurface):
        return Patch(water.level.astype(np.float32), water.spacing, water.centre)
    if callable(getattr(water, "grid_elevation", None)):  # a coupling, or the plugin's sea
        if data is None or water.surface is None:
            return STILL
        return _patch_of_sea(water, data, focus, distance)
    endless = getattr(water, "boundary", None) in ("endless", "periodic")
    if isinstance(water, Surface) and not endless:
        return Patch(water.elevation, water.spacing, water.centre)
    if callable(getattr(water, "window", None)):
        heights, x, y = water.window(*focus, (WINDOW, WINDOW))
        middle = float(x[[0, -1]].mean()), float(y[[0, -1]].mean())
        return Patch(heights, float(water.spacing), middle)
    raise ValueError(
        f"water is a {type(water).__name__}: give a coupling, a HeightField, a recording, an array "
        "(nx, ny) of heights with its spacing, or None for still water"
    )


def _patch_of_sea(
    sea: GridElevation, data: Any, focus: tuple[float, float], distance: float
) -> Patch:
    """A sea: the square about a point that is looked at from a distance [m]."""
    step = SQUARE_SPACING * 2.0 ** max(0, round(math.log2(max(distance, 1e-9) / SEA_CLOSE)))
    middle = tuple(step * round(at / step) for at in focus)  # whole steps: nothing shimmers
    axis: Array = step * (np.arange(SQUARE, dtype=np.float64) - 0.5 * (SQUARE - 1))
    found = sea_square(sea, data, np.add(middle[0], axis), np.add(middle[1], axis))
    return Patch(found.astype(np.float32), step, (middle[0], middle[1]))


def _patch_of_array(
    heights: npt.NDArray[Any], spacing: float | None, centre: tuple[float, float]
) -> Patch:
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ValueError(
            f"water has shape {heights.shape}: give heights (nx, ny) of at least 2 x 2 cells"
        )
    if spacing is None or not spacing > 0.0:
        raise ValueError(
            f"spacing is {spacing!r}: give the side of a cell of the water [m], above 0"
        )
    return Patch(np.asarray(heights, np.float32), float(spacing), centre)


class ShaderSurface:
    """Room for a patch as the water's shaders read it.

    Attributes:
        heights: (nx + 2 BORDER, ny + 2 BORDER) [m].
        bends: Laplacians there [1/m].
        tallest: greatest height or depth in each block of BLOCK x BLOCK cells and the eight around it [m].
    """

    def __init__(self) -> None:
        self.heights, self.bends, self.tallest = (np.empty((0, 0), np.float32) for _ in range(3))

    def fill(self, patch: Patch, *, blur: float) -> None:
        """Take a patch; its Laplacian is a mean over about `blur` [m]."""
        nx, ny = (n + 2 * BORDER for n in patch.elevation.shape)
        if self.heights.shape != (nx, ny):
            self.heights, self.bends = np.empty((2, nx, ny), np.float32)
            self.tallest = np.empty((-(-nx // BLOCK), -(-ny // BLOCK)), np.float32)
        stride = max(1, round(blur / patch.spacing))
        fill_surface(
            patch.elevation, BORDER, stride, patch.spacing, BLOCK, self.heights, self.bends,
            self.tallest,
        )  # fmt: skip
