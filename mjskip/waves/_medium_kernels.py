"""The step where `_tile_kernels.step_fast` will not do: terrain, friction that varies, any weights, an open edge."""

from typing import Any, NamedTuple

import numpy as np

from mjskip._compile.jit import kernel
from mjskip._typing import SingleArray
from mjskip.waves._tile_kernels import COLUMNS, GENERAL, ROWS, USED, WALL, levels, step_fast


class Medium(NamedTuple):
    """What a grid needs besides its `Tiles` where steps are general; empty arrays where none is.

    Attributes:
        friction_x, friction_y: (rows,), (columns,) of the absorbing layer [1/s].
        around: (rows + 2, columns + 2) scratch for a tile and the cells about it.
    """

    friction_x: SingleArray
    friction_y: SingleArray
    around: SingleArray


@kernel
def _beyond(z: Any, neighbours: Any, k: int, r: int, c: int) -> Any:
    """A cell beside a tile: its neighbour's, or at a wall what that mirrors (in x, in y, or in both)."""
    rows, columns = neighbours[k, ROWS], neighbours[k, COLUMNS]
    x = 0 if r < 0 else (2 if r == rows else 1)
    y = 0 if c < 0 else (2 if c == columns else 1)
    tile = neighbours[k, 3 * x + y]
    if tile == WALL and neighbours[k, 3 + y] != WALL:
        tile, x = neighbours[k, 3 + y], 1
    elif tile == WALL and neighbours[k, 3 * x + 1] != WALL:
        tile, y = neighbours[k, 3 * x + 1], 1
    elif tile == WALL:
        tile, x, y = k, 1, 1
    i = neighbours[tile, ROWS] - 1 if x == 0 else (0 if x == 2 else min(max(r, 0), rows - 1))
    j = neighbours[tile, COLUMNS] - 1 if y == 0 else (0 if y == 2 else min(max(c, 0), columns - 1))
    return z[tile, i, j]


@kernel
def surround(z: Any, neighbours: Any, k: int, out: Any) -> None:
    """Copy a tile and the cells about it, (rows + 2, columns + 2)."""
    rows, columns = neighbours[k, ROWS], neighbours[k, COLUMNS]
    out[1 : rows + 1, 1 : columns + 1] = z[k, :rows, :columns]
    for c in range(-1, columns + 1):
        out[0, c + 1] = _beyond(z, neighbours, k, -1, c)
        out[rows + 1, c + 1] = _beyond(z, neighbours, k, rows, c)
    for r in range(rows):
        out[r + 1, 0] = _beyond(z, neighbours, k, r, -1)
        out[r + 1, columns + 1] = _beyond(z, neighbours, k, r, columns)


@kernel
def step_general(
    around: Any, water: Any, prev: Any, i0: int, i1: int, j0: int, j1: int,
    keep: np.float32, m: np.float32, r: np.float32, edge: np.float32, corner: np.float32,
    friction_x: Any, friction_y: Any, half: np.float32,
) -> None:  # fmt: skip
    """The step in cells i0..i1, j0..j1 of a tile, whatever the coast, the friction and the weights.

        z+ = z + (1 - f) / (1 + f) (z - z-) + r / (1 + f) L(z),    f = m + t / 2 (mu_x + mu_y)

    Each of the eight neighbours gives weight (its z - z) if it is water; on land z stays 0. What one cell gains
    its neighbour loses, so volume is conserved; and leaving terms out only lowers the frequencies, so the limit
    on the step holds.

    Args:
        around: a tile and the cells about it, (rows + 2, columns + 2).
        water: 1 in water and 0 on land, likewise.
        prev: the level before, of the tile; overwritten.
        keep: 1 in a step; another number instead of the first 1 above in a change of step.
        m, r: mu t / 2 and (c t / d)^2.
        edge, corner: weights of the neighbours.
        friction_x, friction_y: mu_x (rows,), mu_y (columns,) [1/s].
        half: t / 2 [s]; 0 in a change of step.
    """
    one, n = np.float32(1.0), j1 - j0
    for i in range(i0, i1):
        below, here, above = (
            around[i, j0 : j1 + 2],
            around[i + 1, j0 : j1 + 2],
            around[i + 2, j0 : j1 + 2],
        )
        wet_below, wet_here, wet_above = (
            water[i, j0 : j1 + 2],
            water[i + 1, j0 : j1 + 2],
            water[i + 2, j0 : j1 + 2],
        )
        soft, out = friction_y[j0:j1], prev[i, j0:j1]
        friction_row = m + half * friction_x[i]
        for j in range(n):
            level = here[j + 1]
            friction = friction_row + half * soft[j]
            beside = (wet_below[j + 1] + wet_above[j + 1]) + (wet_here[j] + wet_here[j + 2])
            across = (wet_below[j] + wet_below[j + 2]) + (wet_above[j] + wet_above[j + 2])
            edges = ((below[j + 1] + above[j + 1]) + (here[j] + here[j + 2])) - beside * level
            corners = ((below[j] + below[j + 2]) + (above[j] + above[j + 2])) - across * level
            bend = r * (edge * edges + corner * corners)
            change = ((keep - friction) * (level - out[j]) + bend) / (one + friction)
            out[j] = level + wet_here[j + 1] * change


@kernel
def fill_open_edge(z: Any, prev: Any, rows: int, columns: int, outgoing: np.float32) -> None:
    """Set the outermost cells of an absorbing field, (rows, columns) with them: waves leave through them.

    The one-way wave equation z_t + c z_n = 0: z_edge = z_in- + outgoing (z_in - z_edge-) with
    outgoing = (k - 1) / (k + 1), k = c t / d (G. Mur, IEEE Trans. EMC 23:377, 1981). A corner is the mean of the
    cells beside it.
    """
    top, right = rows - 1, columns - 1
    for i in range(1, top):
        z[i, 0] = prev[i, 1] + outgoing * (z[i, 1] - prev[i, 0])
        z[i, right] = prev[i, right - 1] + outgoing * (z[i, right - 1] - prev[i, right])
    for j in range(1, right):
        z[0, j] = prev[1, j] + outgoing * (z[1, j] - prev[0, j])
        z[top, j] = prev[top - 1, j] + outgoing * (z[top - 1, j] - prev[top, j])
    half = np.float32(0.5)
    z[0, 0] = half * (z[0, 1] + z[1, 0])
    z[0, right] = half * (z[0, right - 1] + z[1, right])
    z[top, 0] = half * (z[top, 1] + z[top - 1, 0])
    z[top, right] = half * (z[top, right - 1] + z[top - 1, right])


@kernel
def mirror_edge(z: Any, rows: int, columns: int) -> None:
    """Set the outermost cells of an absorbing field as walls would."""
    top, right = rows - 1, columns - 1
    for i in range(1, top):
        z[i, 0], z[i, right] = z[i, 1], z[i, right - 1]
    z[0, :columns] = z[1, :columns]
    z[top, :columns] = z[top - 1, :columns]


@kernel
def step_mixed(tiles: Any, medium: Any, q: float, s: float, numbers: Any, inner: int) -> None:
    """One sweep over all active tiles, general where it must be: see `WaveGrid.step`.

    Args:
        q, s: for `step_fast`.
        numbers: keep, m, r, edge, corner and half for `step_general`.
        inner: cells on each side of an absorbing field for which `step_fast` will not do, or 0 if it will do
            nowhere; -1 if the field does not absorb.
    """
    z, prev = levels(tiles)
    neighbours = tiles.neighbours
    keep, m, r = numbers[0], numbers[1], numbers[2]
    edge, corner, half = numbers[3], numbers[4], numbers[5]
    for k in range(1, tiles.numbers[USED]):
        rows, columns = neighbours[k, ROWS], neighbours[k, COLUMNS]
        if neighbours[k, GENERAL] == 0:
            step_fast(z, prev, neighbours, k, 0, rows, 0, q, s)
            continue
        ring = 0 if inner < 0 else 1
        low, high, wide = max(inner, ring), rows - max(inner, ring), columns - max(inner, ring)
        if inner > 0:
            step_fast(z, prev, neighbours, k, inner, rows - inner, inner, q, s)
            if inner == ring:
                continue
            frames = (
                (ring, low, ring, columns - ring),
                (high, rows - ring, ring, columns - ring),
                (low, high, ring, low),
                (low, high, wide, columns - ring),
            )
        else:
            nothing = (0, 0, 0, 0)
            frames = (ring, rows - ring, ring, columns - ring), nothing, nothing, nothing
        surround(z, neighbours, k, medium.around)
        for i0, i1, j0, j1 in frames:
            step_general(
                medium.around, tiles.water[k], prev[k], i0, i1, j0, j1,
                keep, m, r, edge, corner, medium.friction_x, medium.friction_y, half,
            )  # fmt: skip
