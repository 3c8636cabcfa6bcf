"""Where the cells of a water surface are, and blocks of them: what `HeightField` is built on."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from mjskip._typing import Array, Flags, SingleArray
from mjskip.checks import check_memory, check_number, fault
from mjskip.waves import _block_kernels as kernels
from mjskip.waves._stencil import reach_of
from mjskip.waves.grid import WaveGrid

TerrainMask: TypeAlias = Callable[[Array, Array], Flags]
"""Whether cells at x (nx,) and y (ny,) [m] are land: (nx, ny)."""

FARTHEST = 1e9
"""Places farther than this from the first cell, in cells, cannot be told apart there: they are refused."""


class CellBlocks:
    """Cells of a rectangle of water, or of water without an end, by their places and in blocks.

    Attributes:
        shape: cells along x and y; None if endless.
        spacing: side of a cell [m].
        boundary: "reflect", "absorb", "periodic" or "endless".
        centre: (x, y) of the middle; of cell (0, 0) if endless [m].
        terrain_mask: where land is: `shape`, or a function of places.
        grid: the cells and how they are stepped.
    """

    shape: tuple[int, int] | None
    spacing: float
    boundary: str
    centre: tuple[float, float]
    terrain_mask: Flags | TerrainMask | None
    grid: WaveGrid
    _margin: int

    def contains(self, x: float, y: float) -> bool:
        """Whether a point is inside the walls, if there are any.

        Args:
            x, y: of the point [m].
        """
        if self.shape is None or self.boundary == "periodic":
            return True
        return (
            abs(x - self.centre[0]) <= 0.5 * self.shape[0] * self.spacing
            and abs(y - self.centre[1]) <= 0.5 * self.shape[1] * self.spacing
        )

    def cell_position(self, i: int, j: int) -> tuple[float, float]:
        """Where a cell is (x, y) [m].

        Args:
            i, j: of the stored cells, those outside an absorbing field included.
        """
        margin = self._margin
        return (
            float(self._positions(0, i - margin, 1)[0]),
            float(self._positions(1, j - margin, 1)[0]),
        )

    def _positions(self, axis: int, first: int, count: int) -> Array:
        """(count,) positions of cells of the field [m]."""
        n = self.shape[axis] if self.shape else 1
        cells = first + np.arange(count)
        return np.asarray(self.centre[axis] + (cells - (n - 1) / 2) * self.spacing, np.float64)

    def _in_cells(self, x: Array | float, y: Array | float) -> tuple[Array, Array]:
        """Positions in cells, (0, 0) being the first stored cell."""
        nx, ny = self.shape or (1, 1)
        first = self.centre[0] - (nx - 1) / 2 * self.spacing
        second = self.centre[1] - (ny - 1) / 2 * self.spacing
        margin = self._margin
        at_x, at_y = (x - first) / self.spacing + margin, (y - second) / self.spacing + margin
        return np.asarray(at_x), np.asarray(at_y)

    def _whole_cell(self, at: float) -> int:
        if not abs(at) < FARTHEST:
            raise ValueError(
                f"a place {at * self.spacing:g} m from the first cell is too far: give at most "
                f"{FARTHEST * self.spacing:g} m"
            )
        return round(float(at))

    def _extent(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """First cell of the field, and how many there are; of endless water those of all tiles that move."""
        if self.shape is not None:
            return (0, 0), self.shape
        names, (rows, columns) = self.grid.names, self.grid.tile
        if not len(names):
            return (0, 0), (0, 0)
        (a, b), (c, d) = names.min(axis=0).tolist(), names.max(axis=0).tolist()
        return (a * rows, b * columns), ((c - a + 1) * rows, (d - b + 1) * columns)

    def _whole(self, level: int) -> SingleArray:
        """The present level, or the one before, of the whole field."""
        first, shape = self._extent()
        if self.grid.is_whole:
            i, j = first[0] + self._margin, first[1] + self._margin
            cells = (self.grid.z, self.grid.prev)[level][0, i : i + shape[0], j : j + shape[1]]
        else:
            cells = self._read(first, shape)[level]
        cells.flags.writeable = False
        return cells

    def _read(
        self, first: tuple[int, int], shape: tuple[int, int]
    ) -> tuple[SingleArray, SingleArray]:
        """Copies of the two levels in a block of cells of the field."""
        both = np.empty((2, *shape), np.float32)
        margin = self._margin
        kernels.read_block(self.grid.tiles, first[0] + margin, first[1] + margin, both[0], both[1])
        return both[0], both[1]

    def _raise(
        self, block: SingleArray | None, first: tuple[int, int],
        *, before: SingleArray | None = None, inside: bool = False,
    ) -> None:  # fmt: skip
        """Raise the water in a block of stored cells, both levels unless told otherwise; land stays.

        Args:
            block: (nx, ny) [m]; None leaves the present level.
            first: its first cell.
            before: of the level before; `block` if None.
            inside: whether all of it is known to be inside the walls.
        """
        before = block if before is None else before
        assert before is not None
        block = np.zeros_like(before) if block is None else block
        if self._margin and not inside:  # only the field itself is raised
            assert self.shape is not None
            for axis, (i, n) in enumerate(zip(first, self.shape, strict=True)):
                cells = i + np.arange(block.shape[axis]) - self._margin
                np.moveaxis(block, axis, 0)[(cells < 0) | (cells >= n)] = 0.0
        if self.terrain_mask is not None:
            water = ~self._is_land(*first, *block.shape)
            block, before = block * water, before * water
        self.grid.activate(first, block.shape)
        kernels.raise_block(self.grid.tiles, *first, block, before)
        if not inside:
            self.grid.activate_called()

    def _round_block(
        self, x: float, y: float, radius: float
    ) -> tuple[SingleArray, int, int, tuple[float, float], float] | None:
        """Room for a round load, its first stored cell, and centre and reach in cells of the block.

        None if the load is all outside.
        """
        x, y = check_number("x", x, unit="m"), check_number("y", y, unit="m")
        reach = reach_of(radius, self.spacing)
        p, q = (float(at) for at in self._in_cells(x, y))
        margin = self._margin
        if not self.contains(x, y) and self.shape is not None:
            cells = [n + 2 * margin - (2 if margin else 0) for n in self.shape]
            low = 1 if margin else 0
            if not all(
                low - reach < at < low + n - 1 + reach for at, n in zip((p, q), cells, strict=True)
            ):
                return None
        i, j = self._whole_cell(math.ceil(p - reach)), self._whole_cell(math.ceil(q - reach))
        check_memory(
            f"a round load of {radius:g} m on cells of {self.spacing:g} m",
            16.0 * (2.0 * reach + 1.0) ** 2,
            "give a smaller radius, or a larger spacing",
        )
        block = np.zeros((math.floor(p + reach) - i + 1, math.floor(q + reach) - j + 1), np.float32)
        return block, i, j, (p - i, q - j), reach

    def _is_land(self, i: int, j: int, nx: int, ny: int) -> Flags:
        """Which of a block of stored cells are land; none outside the field."""
        margin, mask = self._margin, self.terrain_mask
        if callable(mask):
            return mask(self._positions(0, i, nx), self._positions(1, j, ny))
        assert mask is not None
        land = np.ones((nx, ny), np.bool_)
        cells = []
        for axis, (first, count, n) in enumerate(zip((i, j), (nx, ny), mask.shape, strict=True)):
            at = first - margin + np.arange(count)
            if self.boundary == "periodic":
                at %= n
            np.moveaxis(land, axis, 0)[(at < 0) | (at >= n)] = False
            cells.append(np.clip(at, 0, n - 1))
        found: Flags = land & mask[np.ix_(*cells)]
        return found


def checked_shape(shape: tuple[int, int], low: int = 3) -> tuple[int, int]:
    """Two whole numbers that are not too low."""
    try:
        nx, ny = (int(n) for n in shape)
        if (nx, ny) == tuple(shape) and min(nx, ny) >= low and max(nx, ny) <= FARTHEST:
            return nx, ny
    except (TypeError, ValueError, OverflowError):
        pass
    raise fault(
        "shape", shape, f"give two whole numbers from {low} to {FARTHEST:g}, (cells x, cells y)"
    )
