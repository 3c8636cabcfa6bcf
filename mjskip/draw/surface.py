"""Any water as a picture shows it: heights on a grid about what is looked at."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

BLOCK = 16
"""Cells a side of the blocks of which the greatest height is known; `water.glsl` knows it too."""

BORDER = 12
"""Cells around a field over which what is drawn fades into still water."""

WINDOW = 512
"""Cells a side of what is drawn of water without end."""

SingleArray = npt.NDArray[np.float32]


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
    time: float = 0.0,
    spacing: float | None = None,
    centre: tuple[float, float] = (0.0, 0.0),
) -> Patch:
    """What is drawn of any water.

    Args:
        water: None for still water; an array (nx, ny) of heights [m] with its spacing; a `HeightField`;
            anything with the window of a `Lake`; a recording, which is asked for its surface at a time;
            a coupling of bodies and water, which is asked for its surface.
        focus: of water without end, the part about this point is drawn (x, y) [m].
        time: of a recording [s].
        spacing: side of a cell of an array [m].
        centre: of an array (x, y) [m].

    Raises:
        ValueError: the water is none of these, or an array is of no use.
    """
    if water is None:
        return STILL
    if isinstance(water, np.ndarray):
        return _patch_of_array(water, spacing, centre)
    if callable(getattr(water, "at", None)):  # a recording
        return patch_of(water.at(time), focus=focus, time=time)
    if hasattr(water, "surface"):  # a coupling: None where its water is still
        return patch_of(water.surface, focus=focus, time=time)
    if isinstance(water, Surface):
        return Patch(water.elevation, water.spacing, water.centre)
    if callable(getattr(water, "window", None)):
        heights, x, y = water.window(*focus, (WINDOW, WINDOW))
        middle = float(x[[0, -1]].mean()), float(y[[0, -1]].mean())
        return Patch(heights, float(water.spacing), middle)
    if hasattr(water, "blocks") and hasattr(water, "water"):  # a coupling over still water
        return STILL
    raise ValueError(
        f"water is a {type(water).__name__}: give a coupling, a HeightField or Lake, a recording, an array "
        "(nx, ny) of heights with its spacing, or None for still water"
    )


def _patch_of_array(
    heights: npt.NDArray[Any], spacing: float | None, centre: tuple[float, float]
) -> Patch:
    if heights.ndim != 2 or min(heights.shape) < 2:
        raise ValueError(
            f"water has shape {heights.shape}: give heights (nx, ny) of at least 2 x 2 cells"
        )
    if spacing is None or not spacing > 0.0:
        raise ValueError(f"spacing is {spacing!r}: give the side of a cell of the water [m], above 0")
    return Patch(np.asarray(heights, np.float32), float(spacing), centre)


def faded(elevation: SingleArray) -> SingleArray:
    """Heights with a border of `BORDER` cells in which they fade into still water."""
    n = BORDER
    nx, ny = elevation.shape
    found = np.empty((nx + 2 * n, ny + 2 * n), np.float32)
    found[n:-n, n:-n] = elevation
    kept = (0.5 + 0.5 * np.cos(np.pi * np.arange(1, n + 1) / n)).astype(np.float32)
    found[:n, n:-n] = kept[::-1, None] * elevation[0]
    found[-n:, n:-n] = kept[:, None] * elevation[-1]
    found[:, :n] = kept[::-1] * found[:, n : n + 1]
    found[:, -n:] = kept * found[:, -n - 1 : -n]
    return found


def tallest(heights: SingleArray) -> SingleArray:
    """Greatest height or depth in each block of cells and the eight around it [m]."""
    from scipy.ndimage import maximum_filter

    nx, ny = (-(-n // BLOCK) for n in heights.shape)
    padded = np.zeros((nx * BLOCK, ny * BLOCK), np.float32)
    np.abs(heights, out=padded[: heights.shape[0], : heights.shape[1]])
    blocks = padded.reshape(nx, BLOCK, ny * BLOCK).max(axis=1).reshape(nx, ny, BLOCK).max(axis=2)
    return np.asarray(maximum_filter(blocks, 3, mode="nearest"))
