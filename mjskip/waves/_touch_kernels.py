"""Between a stone and the tiles under it: the patch it feels, and its load pressed on the water.

Blocks of cells reach the tiles through `slots`, (a, b) slots of the tiles under them (see `_tile_kernels`;
0 sleeps, -1 is outside), and the place (i, j) of the block's first cell in the first of those tiles.
"""

import math
from typing import Any

import numpy as np

from mjskip._jit import kernel


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
    z: Any, slots: Any, first_i: int, first_j: int, i: int, j: int, nx: int, ny: int,
    head: Any, bent: Any, edge: float, corner: float, weight: float, work: float, loss: float,
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
        bent: for L(h), two cells more each way than the head.
        work: sum h D.
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
    linear = -weight * work
    share = largest_share(linear, square, loss)
    for p in range(-1, high + 1):
        for q in range(-1, wide + 1):
            a, b = (i + p - first_i) // tile, (j + q - first_j) // tile
            slot = slots[a, b]
            if slot > 0:
                r, s = i + p - first_i - a * tile, j + q - first_j - b * tile
                z[slot, r, s] += np.float32(share * bent[p + 1, q + 1])
    return share, share * linear + share * share * square
