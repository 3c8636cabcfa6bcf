"""The water's step on square tiles that know their neighbours: the same sums as on one grid.

Tiles lie in pools `z` and `prev`, (capacity, TILE, TILE). `neighbours[k]` are the slots of the nine
tiles around slot k, row by row from (-x, -y) to (+x, +y): itself in the middle, SLEEPING (a slot
that is always level) or WALL where there is none.
"""

import numpy as np
import numpy.typing as npt

from mjskip._jit import kernel

Pool = npt.NDArray[np.float32]
Slots = npt.NDArray[np.int32]

TILE = 64
"""Cells along a side: three rows and the sums of three more stay in the first-level cache."""

SLEEPING = 0
WALL = -1


@kernel
def step_tiles(
    z: Pool,
    prev: Pool,
    neighbours: Slots,
    first: int,
    last: int,
    q: np.float32,
    s: np.float32,
    rows: npt.NDArray[np.float32],
) -> None:
    """prev = z + q (z - prev) + s L(z) in tiles first..last; see `_wave_kernels.step_nine`.

    Every cell is the same sum in the same order as there, so the two agree to the last bit.
    """
    four = np.float32(4.0)
    thirty_six = np.float32(36.0)
    sixth = s / np.float32(6.0)
    n = TILE  # a constant, so that loops over a row have no remainder
    flat = z.reshape(z.size)
    for k in range(first, last):
        for r in range(-1, n + 1):
            # Which row this is: of this tile, of the one before or after, or its mirror at a wall.
            band, i = 3, r
            if r < 0:
                band, i = (0, n - 1) if neighbours[k, 1] != WALL else (3, 0)
            elif r == n:
                band, i = (6, 0) if neighbours[k, 7] != WALL else (3, n - 1)
            west, tile, east = neighbours[k, band], neighbours[k, band + 1], neighbours[k, band + 2]
            row = rows[(r + 3) % 3]
            if tile == SLEEPING:
                row[:] = np.float32(0.0)
            else:
                # One cell too far on either side (there is always a slot before and after), so that
                # the row is summed in one go; its two ends are then set right.
                start = (tile * n + i) * n
                wide = flat[start - 1 : start + n + 1]
                for j in range(n):
                    row[j] = (wide[j] + wide[j + 2]) + four * wide[j + 1]
            cells = z[tile, i]
            before = z[west, i, n - 1] if west != WALL else cells[0]
            after = z[east, i, 0] if east != WALL else cells[n - 1]
            row[0] = (before + cells[1]) + four * cells[0]
            row[n - 1] = (cells[n - 2] + after) + four * cells[n - 1]
            if r < 1:
                continue
            below, middle = rows[(r + 1) % 3], rows[(r + 2) % 3]
            here, out = z[k, r - 1], prev[k, r - 1]
            for j in range(n):
                level = here[j]
                bend = ((below[j] + row[j]) + four * middle[j]) - thirty_six * level
                out[j] = (level + q * (level - out[j])) + sixth * bend


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
