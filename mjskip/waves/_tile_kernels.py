"""The water's step on square tiles that know their neighbours, and what passes between them and a stone.

Tiles lie in pools `z` and `prev`, (capacity, TILE, TILE). `neighbours[k]` are the slots of the nine
tiles around slot k, row by row from (-x, -y) to (+x, +y): itself in the middle, SLEEPING (a slot
that is always level) or WALL where there is none.

Blocks of cells, patches that stones feel and heads that they press, reach the tiles through `slots`, (a, b)
slots of the tiles under them, and the place (i, j) of the block's first cell in the first of those tiles.
"""

import math
from typing import Any

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
    z: Pool, neighbours: Slots, used: int, amplitude: float, calls: npt.NDArray[np.int32]
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
def step_and_listen(
    z: Pool,
    prev: Pool,
    neighbours: Slots,
    used: int,
    q: float,
    s: float,
    sides: npt.NDArray[np.float32],
    amplitude: float,
    calls: npt.NDArray[np.int32],
) -> int:
    """Step all tiles that are awake, and `find_calls` at the level after it, which is in prev."""
    step_tiles(z, prev, neighbours, 1, used, q, s, sides)
    return find_calls(prev, neighbours, used, amplitude, calls)


@kernel
def find_quiet(
    z: Pool, prev: Pool, used: int, amplitude: float, quiet: npt.NDArray[np.int32]
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


@kernel
def add_to_patch(z: Any, prev: Any, slots: Any, i: int, j: int, rate: float, points: Any) -> float:
    """points += elevation and vertical speed, (2, n, n); the greatest |elevation| there is then.

    rate = 1 / time step.
    """
    n, tile = points.shape[1], z.shape[1]
    for a in range(slots.shape[0]):
        for b in range(slots.shape[1]):
            slot = slots[a, b]
            if slot <= 0:
                continue
            first, east = i - a * tile, j - b * tile  # the block's first cell, seen from this tile
            for p in range(max(0, -first), min(n, tile - first)):
                for q in range(max(0, -east), min(n, tile - east)):
                    level = np.float64(z[slot, first + p, east + q])
                    points[0, p, q] += level
                    points[1, p, q] += (level - prev[slot, first + p, east + q]) * rate
    highest = 0.0
    for p in range(n):
        for q in range(n):
            highest = max(highest, abs(points[0, p, q]))
    return highest


@kernel
def work_under(z: Any, prev: Any, slots: Any, i: int, j: int, head: Any) -> float:
    """Sum of head times (z - prev) over the cells of a head."""
    tile = z.shape[1]
    work = 0.0
    for p in range(head.shape[0]):
        for q in range(head.shape[1]):
            a, b = (i + p) // tile, (j + q) // tile
            slot = slots[a, b]
            if slot > 0:
                r, s = i + p - a * tile, j + q - b * tile
                work += head[p, q] * (np.float64(z[slot, r, s]) - prev[slot, r, s])
    return work


@kernel
def largest_share(linear: float, square: float, loss: float) -> float:
    """Largest s in [0, 1] with s linear + s^2 square <= loss; square and loss are at least 0."""
    if linear + square <= loss:
        return 1.0
    root = math.sqrt(linear * linear + 4.0 * square * loss)
    if linear > 0.0:
        return min(1.0, 2.0 * loss / (linear + root))
    return min(1.0, 0.5 * (root - linear) / square)


@kernel
def press(
    z: Any, prev: Any, slots: Any, first_i: int, first_j: int, i: int, j: int, nx: int, ny: int,
    head: Any, bent: Any, edge: float, corner: float, weight: float, elsewhere: float, loss: float,
) -> tuple[float, float]:  # fmt: skip
    """z += s L(head), s the largest share that gives the waves no more than the loss; s and the gain.

    With heads h the waves gain W = -w sum h (z+ - z) over the step, w the weight of a head of a metre on
    a cell. The free step gave z+ - z = D, a share s of the head adds s L(h), L with weights edge and
    corner, so

        W(s) = -w (s sum h D + s^2 sum h L(h)),    sum h L(h) <= 0

    Args:
        slots: of the tiles under the head and one cell all round it.
        first_i, first_j: first cell of the first tile.
        i, j: first cell of the head.
        nx, ny: cells inside walls, which mirror the head; 0 without walls.
        bent: for L(h), at least two cells more each way than the head.
        elsewhere: sum h D in other waters whose waves add up with these.
    """
    tile = z.shape[1]
    high, wide = head.shape
    square = 0.0
    for p in range(-1, high + 1):
        for q in range(-1, wide + 1):
            bent[p + 1, q + 1] = 0.0
            if nx and not (0 <= i + p < nx and 0 <= j + q < ny):
                continue
            inside = 0 <= p < high and 0 <= q < wide
            here = np.float64(head[p, q]) if inside else 0.0
            total = 0.0
            for dp in range(-1, 2):
                for dq in range(-1, 2):
                    c, d = p + dp, q + dq
                    if nx:
                        c = min(max(i + c, 0), nx - 1) - i
                        d = min(max(j + d, 0), ny - 1) - j
                    there = 0.0
                    if 0 <= c < high and 0 <= d < wide:
                        there = np.float64(head[c, d])
                    if dp != 0 or dq != 0:
                        total += (edge if dp == 0 or dq == 0 else corner) * (there - here)
            bent[p + 1, q + 1] = total
            square += here * total
    square *= -weight
    work = work_under(z, prev, slots, i - first_i, j - first_j, head)
    linear = -weight * (work + elsewhere)
    share = largest_share(linear, square, loss)
    for p in range(-1, high + 1):
        for q in range(-1, wide + 1):
            a, b = (i + p - first_i) // tile, (j + q - first_j) // tile
            slot = slots[a, b]
            if slot > 0:
                r, s = i + p - first_i - a * tile, j + q - first_j - b * tile
                z[slot, r, s] += np.float32(share * bent[p + 1, q + 1])
    return share, share * linear + share * share * square
