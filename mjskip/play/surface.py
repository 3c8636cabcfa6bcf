"""The water that the page draws: 300 x 100 vertices about the point of interest, wide to the horizon."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, SingleArray
from mjskip.draw._draw_kernels import box_means
from mjskip.waves.field import HeightField

SHAPE = (300, 100)
"""Vertices along the throw and across it."""

EVEN_VERTICES = (260, 80)
"""Of these, evenly spaced in the middle; the others leap to the horizon."""

STEP = 0.04
"""Between vertices near the stone: a fifth of the shortest rings that a hand-sized stone makes [m]."""

HORIZON = 70.0
"""[m]."""


def axis(count: int, even: int, step: float) -> Array:
    """Distances (count,) [m] from the middle: even at first, then each gap wider by one factor."""
    each = (count - even) // 2
    middle = step * (np.arange(even) - 0.5 * (even - 1))
    powers = np.arange(1, each + 1)
    low, high = 1.0, 10.0
    for _ in range(60):  # bisection: 60 halvings leave no bit of a double open
        factor = 0.5 * (low + high)
        reach = middle[-1] + step * float(np.sum(factor**powers))
        low, high = (factor, high) if reach < HORIZON else (low, factor)
    outer = middle[-1] + step * np.cumsum(factor**powers)
    return np.concatenate([-outer[::-1], middle, outer])


class DrawnWater:
    """Heights of a water surface at the vertices of a grid that moves in whole steps, so that nothing shimmers."""

    def __init__(self, step: float = STEP) -> None:
        """A grid, even in the middle with this step [m]."""
        self.step = step
        self._axes = tuple(axis(n, e, step) for n, e in zip(SHAPE, EVEN_VERTICES, strict=True))
        self._reach = tuple(0.5 * step * (e + 4) for e in EVEN_VERTICES)
        # a vertex stands for what is nearer to it than to its neighbours
        self._boxes = []
        for at in self._axes:
            between = 0.5 * (at[1:] + at[:-1])
            ends = 2.0 * at[0] - between[0], 2.0 * at[-1] - between[-1]
            borders = np.concatenate([[ends[0]], between, [ends[1]]])
            self._boxes.append(np.column_stack([borders[:-1], borders[1:]]))
        self._height, self._slope = np.empty(SHAPE), np.empty((2, *SHAPE))
        self.faces = _faces()

    def place(self, x: float, y: float) -> tuple[float, float]:
        """Where the middle of the grid stands for a point of interest (x, y) [m]."""
        return self.step * round(x / self.step), self.step * round(y / self.step)

    def vertices(self, field: HeightField | None, *, middle: tuple[float, float]) -> SingleArray:
        """Vertices (30000, 3) [m] relative to the middle of the grid; still water without a field."""
        found = np.zeros((SHAPE[0] * SHAPE[1], 3), np.float32)
        found[:, 0] = np.repeat(self._axes[0], SHAPE[1])
        found[:, 1] = np.tile(self._axes[1], SHAPE[0])
        if field is None:
            return found
        spacing = field.spacing
        cells = tuple(int(2.0 * reach / spacing) + 4 for reach in self._reach)
        window, x, y = field.window(*middle, (cells[0], cells[1]))
        boxes = [
            (box + at - (float(cell[0]) - 0.5 * spacing)) / spacing
            for box, at, cell in zip(self._boxes, middle, (x, y), strict=True)
        ]
        scratch = np.empty((2, cells[1]))
        box_means(
            window, spacing, boxes[0], boxes[1], scratch[0], scratch[1],
            self._height, self._slope[0], self._slope[1],
        )  # fmt: skip
        found[:, 2] = self._height.ravel()
        return found


def _faces() -> npt.NDArray[np.uint32]:
    """Triangles (n, 3), counter-clockwise from above."""
    index = np.arange(SHAPE[0] * SHAPE[1], dtype=np.uint32).reshape(SHAPE)
    corners = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    a, b, c, d = (corner.ravel() for corner in corners)
    return np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
