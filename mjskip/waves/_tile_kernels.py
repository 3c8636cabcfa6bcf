"""The water's step on square tiles that know their neighbours: the same sums as on one grid.

Tiles lie in pools `z` and `prev`, (capacity, TILE, TILE). `neighbours[k]` are the slots of the nine
tiles around slot k, row by row from (-x, -y) to (+x, +y): itself in the middle, SLEEPING (a slot
that is always level) or WALL where there is none.
"""

import numpy as np
import numpy.typing as npt

from mjskip._jit import kernel
from mjskip.waves._row import column_sum, step_rows

Pool = npt.NDArray[np.float32]
Slots = npt.NDArray[np.int32]

TILE = 64
"""Cells along a side, a whole number of vectors: its rows stay in the first-level cache."""

SLEEPING = 0
WALL = -1


@kernel
def step_tiles(
    z: Pool,
    prev: Pool,
    neighbours: Slots,
    first: int,
    last: int,
    q: float,
    s: float,
    sides: npt.NDArray[np.float32],
) -> None:
    """prev = z + q (z - prev) + s L(z) in tiles first..last; see `_wave_kernels.step_nine`.

    Every cell is the same sum in the same order as there, so the two agree to the last bit.

    Args:
        sides: (2, TILE + 2), for the cells beside a tile.
    """
    along, sixth = np.float32(q), np.float32(s) / np.float32(6.0)
    n = TILE
    cells, out = z.reshape(z.size), prev.reshape(prev.size)
    west, east = sides[0], sides[1]
    for k in range(first, last):
        # What lies beyond each side: the neighbour's rim, or at a wall the tile's own.
        south, north = neighbours[k, 1], neighbours[k, 7]
        own = k * n * n
        before = own if south == WALL else (south * n + n - 1) * n
        after = own + (n - 1) * n if north == WALL else north * n * n
        left, right = neighbours[k, 3], neighbours[k, 5]
        for r in range(n):
            west[r + 1] = z[left, r, n - 1] if left != WALL else z[k, r, 0]
            east[r + 1] = z[right, r, 0] if right != WALL else z[k, r, n - 1]
        west[0], east[0], west[n + 1], east[n + 1] = west[1], east[1], west[n], east[n]
        if south != WALL:
            left, right = neighbours[k, 0], neighbours[k, 2]
            west[0] = z[left, n - 1, n - 1] if left != WALL else z[south, n - 1, 0]
            east[0] = z[right, n - 1, 0] if right != WALL else z[south, n - 1, n - 1]
        if north != WALL:
            left, right = neighbours[k, 6], neighbours[k, 8]
            west[n + 1] = z[left, 0, n - 1] if left != WALL else z[north, 0, 0]
            east[n + 1] = z[right, 0, 0] if right != WALL else z[north, 0, n - 1]
        for r in range(0, n, 4):
            at = own + r * n
            starts = (
                before if r == 0 else at - n,
                at,
                at + n,
                at + 2 * n,
                at + 3 * n,
                after if r == n - 4 else at + 4 * n,
            )
            sums_west = (
                column_sum(west[r], west[r + 1], west[r + 2]),
                column_sum(west[r + 1], west[r + 2], west[r + 3]),
                column_sum(west[r + 2], west[r + 3], west[r + 4]),
                column_sum(west[r + 3], west[r + 4], west[r + 5]),
            )
            sums_east = (
                column_sum(east[r], east[r + 1], east[r + 2]),
                column_sum(east[r + 1], east[r + 2], east[r + 3]),
                column_sum(east[r + 2], east[r + 3], east[r + 4]),
                column_sum(east[r + 3], east[r + 4], east[r + 5]),
            )
            step_rows(cells, starts, out, n, sums_west, sums_east, along, sixth)


@kernel
def find_calls(
    z: Pool, neighbours: Slots, used: int, amplitude: np.float32, calls: npt.NDArray[np.int32]
) -> int:
    """List (slot, direction) of sleeping neighbours that a tile's rim now reaches; their number."""
    n = z.shape[1]
    found = 0
    for k in range(1, used):
        for direction in range(9):
            if neighbours[k, direction] != SLEEPING:
                continue
            x, y = direction // 3, direction % 3
            i0, i1 = (0, n) if x == 1 else ((0, 1) if x == 0 else (n - 1, n))
            j0, j1 = (0, n) if y == 1 else ((0, 1) if y == 0 else (n - 1, n))
            loud = False
            for i in range(i0, i1):
                for j in range(j0, j1):
                    loud = loud or abs(z[k, i, j]) > amplitude
            if loud:
                calls[found, 0], calls[found, 1] = k, direction
                found += 1
    return found


@kernel
def find_quiet(
    z: Pool, prev: Pool, used: int, amplitude: np.float32, quiet: npt.NDArray[np.int32]
) -> int:
    """List the slots of tiles whose last two levels both stay within the amplitude; their number."""
    found = 0
    for k in range(1, used):
        high = np.float32(0.0)
        for i in range(z.shape[1]):
            for j in range(z.shape[2]):
                high = max(high, max(abs(z[k, i, j]), abs(prev[k, i, j])))
            if high > amplitude:
                break
        if high <= amplitude:
            quiet[found] = k
            found += 1
    return found
