"""Tiles of cells that know their neighbours: how they are stored, found, activated and stepped.

A grid is cut into tiles of equal size; at the far walls of a bounded one they may be smaller. Only active tiles
are stored, in slots 1, 2, ... of two pools, one a level of the surface; slot 0 is still water for ever. A field
without sleep is one tile that is always active.

With m = mu t / 2, r = (c t / d)^2 and the discrete Laplacian L (times d^2), a step is

    z+ = z + q (z - z-) + s L(z),    q = (1 - m) / (1 + m),    s = r / (1 + m)

which is equation (7) of Lee & Baek with its terms gathered so that the weights of a level surface cancel in
floating point too. z+ is written over z-, so a step reads two levels and writes one.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from mjskip._compile.jit import inlined, kernel
from mjskip._compile.pointers import address_of, as_singles
from mjskip._typing import Array, Integers, SingleArray
from mjskip.waves._row import column_sum, step_rows

STILL, WALL = 0, -1
"""Instead of a neighbour's slot: a tile that is not active, and no tile."""

ROWS, COLUMNS, GENERAL = 9, 10, 11
"""Columns of `neighbours` behind the nine neighbours: cells along x and y, and whether `step_fast` will not do."""
NEIGHBOUR_COLUMNS = 12

USED, PARITY, NX, NY, PERIODIC, FULL, SURVEYED = range(7)
"""Of `numbers`: slots in use (the still one included), which pool is the present level, cells (0 if endless),
whether what leaves on one side comes in on the other, whether a tile found no room, and up to which slot it is
known where land is."""

TILE = 64
"""Cells along a side of a tile where tiles may be still: its rows stay in the first-level cache."""

CACHE_CELLS = 1 << 15
"""Cells of each of two levels that stay in the second-level cache together."""


class Tiles(NamedTuple):
    """The arrays of a grid.

    Attributes:
        first, second: the two levels, (capacity, rows, stride) each [m]; which is the present one alternates.
        neighbours: (capacity, NEIGHBOUR_COLUMNS); of each slot the slots of the tiles around it, row by row from (-x, -y) to
            (+x, +y), itself in the middle, and its size.
        names: (capacity, 2) place of each slot's tile.
        table: hash table of slots by name; 0 is empty.
        numbers: see above.
        water: (capacity, rows + 2, columns + 2) 1 in water, 0 on land, of a tile and the cells about it; empty
            where all steps are `step_fast`.
        lost: (1,) sum over the cells of tiles that were deactivated [m].
        called: (8 * capacity, 2) scratch: a slot and a direction.
    """

    first: SingleArray
    second: SingleArray
    neighbours: npt.NDArray[np.int32]
    names: Integers
    table: npt.NDArray[np.int32]
    numbers: Integers
    water: SingleArray
    lost: Array
    called: npt.NDArray[np.int32]


@kernel
def levels(tiles: Any) -> Any:
    """The present level and the one before."""
    if tiles.numbers[PARITY] == 0:
        return tiles.first, tiles.second
    return tiles.second, tiles.first


# Which tile is where -----------------------------------------------------------------------------


@kernel
def _place(table: Any, a: int, b: int) -> int:
    """Where a name's search begins; the primes are those of Teschner et al. (VMV 2003)."""
    return int(((a * 73856093) ^ (b * 19349663)) & (table.size - 1))


@kernel
def find_tile(tiles: Any, a: int, b: int) -> int:
    """Slot of an active tile by its name; STILL if it is not active."""
    table, names = tiles.table, tiles.names
    at = _place(table, a, b)
    while table[at] != 0:
        slot = table[at]
        if names[slot, 0] == a and names[slot, 1] == b:
            return int(slot)
        at = (at + 1) & (table.size - 1)
    return STILL


@kernel
def _enter(tiles: Any, slot: int) -> None:
    table = tiles.table
    at = _place(table, tiles.names[slot, 0], tiles.names[slot, 1])
    while table[at] != 0:
        at = (at + 1) & (table.size - 1)
    table[at] = slot


@kernel
def enter_all(tiles: Any) -> None:
    """Make the hash table anew."""
    tiles.table[:] = 0
    for slot in range(1, tiles.numbers[USED]):
        _enter(tiles, slot)


@kernel
def name_of(tiles: Any, a: int, b: int) -> Any:
    """The name of a tile, and whether there is one: it may be beyond a wall, or round a period."""
    nx, ny = tiles.numbers[NX], tiles.numbers[NY]
    if nx == 0:
        return a, b, True
    high, wide = tiles.neighbours[STILL, ROWS], tiles.neighbours[STILL, COLUMNS]
    tiles_x, tiles_y = (nx + high - 1) // high, (ny + wide - 1) // wide
    if tiles.numbers[PERIODIC] != 0:
        return a % tiles_x, b % tiles_y, True
    return a, b, 0 <= a < tiles_x and 0 <= b < tiles_y


@kernel
def locate(tiles: Any, i: int, j: int) -> Any:
    """Slot of a cell (WALL beyond the walls, STILL if its tile is not active), row and column there, and how
    many cells from it on lie in the same row of that tile."""
    nx, ny = tiles.numbers[NX], tiles.numbers[NY]
    high, wide = tiles.neighbours[STILL, ROWS], tiles.neighbours[STILL, COLUMNS]
    if nx != 0:
        if tiles.numbers[PERIODIC] != 0:
            i, j = i % nx, j % ny
        elif not (0 <= i < nx and 0 <= j < ny):
            return WALL, 0, 0, 1 if j >= 0 or not 0 <= i < nx else -j
    a, b = i // high, j // wide
    column = j - b * wide
    run = wide - column if ny == 0 else min(wide, ny - b * wide) - column
    return find_tile(tiles, a, b), i - a * high, column, run


@kernel
def _link_neighbours(tiles: Any, slot: int) -> None:
    """Link a tile and its neighbours both ways."""
    neighbours = tiles.neighbours
    a, b = tiles.names[slot, 0], tiles.names[slot, 1]
    for direction in range(9):
        c, d, there = name_of(tiles, a + direction // 3 - 1, b + direction % 3 - 1)
        other = find_tile(tiles, c, d) if there else WALL
        neighbours[slot, direction] = other
        if other > 0:
            neighbours[other, 8 - direction] = slot


@kernel
def activate_tile(tiles: Any, a: int, b: int) -> int:
    """Slot of a tile, still water if it was not active; WALL if it is beyond a wall or there is no room.

    Without room FULL is set, and the caller has to give more and ask again.
    """
    a, b, there = name_of(tiles, a, b)
    if not there:
        return WALL
    slot = find_tile(tiles, a, b)
    if slot > 0:
        return slot
    numbers, neighbours = tiles.numbers, tiles.neighbours
    slot = numbers[USED]
    if slot == tiles.first.shape[0]:
        numbers[FULL] = 1
        return WALL
    numbers[USED] += 1
    tiles.first[slot] = 0.0
    tiles.second[slot] = 0.0
    tiles.names[slot, 0], tiles.names[slot, 1] = a, b
    high, wide = neighbours[STILL, ROWS], neighbours[STILL, COLUMNS]
    neighbours[slot, ROWS] = high if numbers[NX] == 0 else min(high, numbers[NX] - a * high)
    neighbours[slot, COLUMNS] = wide if numbers[NY] == 0 else min(wide, numbers[NY] - b * wide)
    neighbours[slot, GENERAL] = neighbours[STILL, GENERAL]
    _enter(tiles, slot)
    _link_neighbours(tiles, slot)
    return int(slot)


@kernel
def activate_block(tiles: Any, i: int, j: int, nx: int, ny: int) -> bool:
    """Activate all tiles under a block of cells; False if there was no room."""
    high, wide = tiles.neighbours[STILL, ROWS], tiles.neighbours[STILL, COLUMNS]
    for a in range(i // high, (i + nx - 1) // high + 1):
        for b in range(j // wide, (j + ny - 1) // wide + 1):
            activate_tile(tiles, a, b)
    full = tiles.numbers[FULL] != 0
    return not full


@kernel
def is_active(tiles: Any, i: int, j: int, nx: int, ny: int) -> bool:
    """Whether a tile under a block of cells is active."""
    if tiles.numbers[USED] == 1:
        return False
    high, wide = tiles.neighbours[STILL, ROWS], tiles.neighbours[STILL, COLUMNS]
    for a in range(i // high, (i + nx - 1) // high + 1):
        for b in range(j // wide, (j + ny - 1) // wide + 1):
            c, d, there = name_of(tiles, a, b)
            if there and find_tile(tiles, c, d) > 0:
                return True
    return False


@kernel
def activate_called(tiles: Any, amplitude: float) -> bool:
    """Activate every tile that a wave above the amplitude has come next to; False if there was no room."""
    z, _ = levels(tiles)
    neighbours, called = tiles.neighbours, tiles.called
    found = 0
    for k in range(1, tiles.numbers[USED]):
        rows, columns = neighbours[k, ROWS], neighbours[k, COLUMNS]
        for direction in range(9):
            if neighbours[k, direction] != STILL:
                continue
            x, y = direction // 3, direction % 3
            i0, i1 = (0, rows) if x == 1 else ((0, 1) if x == 0 else (rows - 1, rows))
            j0, j1 = (0, columns) if y == 1 else ((0, 1) if y == 0 else (columns - 1, columns))
            reached = False
            for i in range(i0, i1):
                for j in range(j0, j1):
                    reached = reached or abs(z[k, i, j]) > amplitude
            if reached:
                called[found, 0], called[found, 1] = k, direction
                found += 1
    for n in range(found):
        k, direction = called[n, 0], called[n, 1]
        a, b = tiles.names[k, 0] + direction // 3 - 1, tiles.names[k, 1] + direction % 3 - 1
        activate_tile(tiles, a, b)
    full = tiles.numbers[FULL] != 0
    return not full


@kernel
def deactivate_calm_tiles(tiles: Any, amplitude: float) -> int:
    """Give up the tiles whose two levels both stay within the amplitude; their number."""
    z, prev = levels(tiles)
    numbers, names, neighbours = tiles.numbers, tiles.names, tiles.neighbours
    gone = 0
    for slot in range(numbers[USED] - 1, 0, -1):  # from the last: what takes its place stays
        highest = np.float32(0.0)
        for i in range(neighbours[slot, ROWS]):
            for j in range(neighbours[slot, COLUMNS]):
                highest = max(highest, max(abs(z[slot, i, j]), abs(prev[slot, i, j])))
            if highest > amplitude:
                break
        if highest > amplitude:
            continue
        for i in range(neighbours[slot, ROWS]):
            for j in range(neighbours[slot, COLUMNS]):
                tiles.lost[0] += z[slot, i, j]
        for direction in range(9):
            other = neighbours[slot, direction]
            if other > 0:
                neighbours[other, 8 - direction] = STILL
        gone += 1
        numbers[USED] -= 1
        last = numbers[USED]
        if last != slot:
            z[slot], prev[slot] = z[last], prev[last]
            names[slot], neighbours[slot] = names[last], neighbours[last]
            if tiles.water.size > 0:
                tiles.water[slot] = tiles.water[last]
        enter_all(tiles)
        if last != slot:
            _link_neighbours(tiles, slot)
    numbers[SURVEYED] = min(numbers[SURVEYED], numbers[USED])
    return gone


# Steps -------------------------------------------------------------------------------------------


@inlined
def _corner(z: Any, neighbours: Any, k: int, x: int, y: int) -> Any:
    """The cell beyond a corner of a tile, x and y being 0 or 2; a wall mirrors."""
    tile, beside, along = neighbours[k, 3 * x + y], neighbours[k, 3 * x + 1], neighbours[k, 3 + y]
    if beside == WALL:
        tile, x, beside = (along, 2 - x, k) if along != WALL else (k, 2 - x, k)
        if along == WALL:
            y = 2 - y
    elif tile == WALL:
        tile, y = beside, 2 - y
    i = neighbours[tile, ROWS] - 1 if x == 0 else 0
    j = neighbours[tile, COLUMNS] - 1 if y == 0 else 0
    return z[tile, i, j]


@kernel
def step_fast(
    z: Any, prev: Any, neighbours: Any, k: int, i0: int, i1: int, margin: int, q: float, s: float
) -> None:
    """prev = z + q (z - prev) + s L(z) in rows i0..i1 of tile k, but for `margin` columns on each side.

    L = [1 4 1; 4 -20 4; 1 4 1] / 6 = ([1 4 1]^T [1 4 1] - 36) / 6, the nine-point Laplacian; four rows a pass
    share what they load. With a margin, rows i0 - 1 and i1 must be in the tile.
    """
    along, sixth = np.float32(q), np.float32(s) / np.float32(6.0)
    rows, columns, stride = neighbours[k, ROWS], neighbours[k, COLUMNS], z.shape[2]
    size, n = z.shape[1] * stride, columns - 2 * margin
    cells, out = z.reshape(z.size), prev.reshape(prev.size)
    own = k * size + margin

    # what lies beyond each side: the neighbour's rim, or at a wall the tile's own
    south, north, west_tile, east_tile = (
        neighbours[k, 1],
        neighbours[k, 7],
        neighbours[k, 3],
        neighbours[k, 5],
    )
    before = own if south == WALL else south * size + (neighbours[south, ROWS] - 1) * stride
    after = own + (rows - 1) * stride if north == WALL else north * size
    west, east = own - 1, own + n
    if margin == 0:
        west = own if west_tile == WALL else west_tile * size + neighbours[west_tile, COLUMNS] - 1
        east = own + n - 1 if east_tile == WALL else east_tile * size
    south_west, south_east = _corner(z, neighbours, k, 0, 0), _corner(z, neighbours, k, 0, 2)
    north_west, north_east = _corner(z, neighbours, k, 2, 0), _corner(z, neighbours, k, 2, 2)

    beside = as_singles(address_of(cells))  # of arrays numba checks every index for being negative
    i = i0
    while i < i1:
        at, w, e = own + i * stride, west + i * stride, east + i * stride
        count = 4 if i + 4 <= i1 else 1
        first, last = i == 0, i + count == rows
        below = before if first else at - stride
        above = after if last else at + count * stride
        w_below = south_west if first else beside[w - stride]
        e_below = south_east if first else beside[e - stride]
        w_above = north_west if last else beside[w + count * stride]
        e_above = north_east if last else beside[e + count * stride]
        if count == 4:
            w0, w1, w2, w3 = (
                beside[w],
                beside[w + stride],
                beside[w + 2 * stride],
                beside[w + 3 * stride],
            )
            e0, e1, e2, e3 = (
                beside[e],
                beside[e + stride],
                beside[e + 2 * stride],
                beside[e + 3 * stride],
            )
            starts = below, at, at + stride, at + 2 * stride, at + 3 * stride, above
            left = (
                column_sum(w_below, w0, w1),
                column_sum(w0, w1, w2),
                column_sum(w1, w2, w3),
                column_sum(w2, w3, w_above),
            )
            right = (
                column_sum(e_below, e0, e1),
                column_sum(e0, e1, e2),
                column_sum(e1, e2, e3),
                column_sum(e2, e3, e_above),
            )
            if n == TILE:  # a number that the compiler knows: a quarter faster
                step_rows(cells, starts, out, TILE, left, right, along, sixth)
            else:
                step_rows(cells, starts, out, n, left, right, along, sixth)
        else:
            one = (column_sum(w_below, beside[w], w_above),)
            other = (column_sum(e_below, beside[e], e_above),)
            step_rows(cells, (below, at, above), out, n, one, other, along, sixth)
        i += count


@kernel
def step_tiles(tiles: Any, q: float, s: float) -> None:
    """`step_fast` of all active tiles."""
    z, prev = levels(tiles)
    for k in range(1, tiles.numbers[USED]):
        step_fast(z, prev, tiles.neighbours, k, 0, tiles.neighbours[k, ROWS], 0, q, s)


@kernel
def step_band(
    z: Any, prev: Any, neighbours: Any, i0: int, i1: int, q: float, s: float,
    depth: int, low: int, high: int,
) -> None:  # fmt: skip
    """Several steps of rows i0..i1 of the one tile of a walled field, in one pass over memory.

    The levels change roles after each step. Step m (from 0) covers rows i0 + m low .. i1 - m high. It follows
    the step before it a row behind, where that one has been and will not come again, so that rows are stepped
    while they are in the cache.
    """
    chunk = max(4, (CACHE_CELLS // z.shape[2] - depth) // 4 * 4)
    done, end = np.empty(depth, np.int64), np.empty(depth, np.int64)
    for m in range(depth):
        done[m], end[m] = i0 + m * low, i1 - m * high
    while done[depth - 1] < end[depth - 1]:
        for m in range(depth):
            if m == 0:
                until = min(done[0] + chunk, end[0])
            else:
                until = end[m] if done[m - 1] == end[m - 1] else min(done[m - 1] - 1, end[m])
            if until > done[m]:
                if m % 2 == 0:
                    step_fast(z, prev, neighbours, 1, done[m], until, 0, q, s)
                else:
                    step_fast(prev, z, neighbours, 1, done[m], until, 0, q, s)
                done[m] = until
