"""Blocks of cells anywhere in a grid of tiles: read, raised, pressed on, and sampled at points.

A block is (nx, ny) cells from cell (i, j) on. It may lie over several tiles, over walls, and over tiles that are not
active, which are still water; nothing lies beyond walls.
"""

from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip.waves._tile_kernels import NX, NY, PERIODIC, STILL, levels, locate


@kernel
def read_block(tiles: Any, i: int, j: int, level_out: Any, before_out: Any) -> None:
    """Both levels of a block; 0 beyond walls and in still water."""
    z, prev = levels(tiles)
    nx, ny = level_out.shape
    for p in range(nx):
        q = 0
        while q < ny:
            slot, row, column, run = locate(tiles, i + p, j + q)
            for n in range(min(run, ny - q)):
                if slot > STILL:
                    level_out[p, q + n] = z[slot, row, column + n]
                    before_out[p, q + n] = prev[slot, row, column + n]
                else:
                    level_out[p, q + n] = 0.0
                    before_out[p, q + n] = 0.0
            q += run


@kernel
def highest_in(tiles: Any, i: int, j: int, nx: int, ny: int) -> float:
    """Greatest |z| in a block."""
    z, _ = levels(tiles)
    highest = np.float32(0.0)
    for p in range(nx):
        q = 0
        while q < ny:
            slot, row, column, run = locate(tiles, i + p, j + q)
            if slot > STILL:
                for n in range(min(run, ny - q)):
                    highest = max(highest, abs(z[slot, row, column + n]))
            q += run
    return float(highest)


@kernel
def raise_block(tiles: Any, i: int, j: int, level: Any, before: Any) -> None:
    """Add to both levels of a block, whose tiles are active."""
    z, prev = levels(tiles)
    nx, ny = level.shape
    for p in range(nx):
        q = 0
        while q < ny:
            slot, row, column, run = locate(tiles, i + p, j + q)
            if slot > STILL:
                for n in range(min(run, ny - q)):
                    z[slot, row, column + n] += np.float32(level[p, q + n])
                    prev[slot, row, column + n] += np.float32(before[p, q + n])
            q += run


@kernel
def _is_water(tiles: Any, i: int, j: int) -> bool:
    """Whether a cell is water, as far as its tile is active."""
    if tiles.water.size == 0:
        return True
    slot, row, column, _ = locate(tiles, i, j)
    return bool(slot <= STILL or tiles.water[slot, row + 1, column + 1] != 0.0)


@kernel
def press_block(tiles: Any, i: int, j: int, pressure_head: Any, edge: float, corner: float) -> None:
    """z += edge-and-corner Laplacian of a pressure head, whose first cell is cell (i, j) and whose tiles are active.

    At the walls the head is mirrored as the surface is, so that what is added sums to zero; so it does at a
    coast.

    Args:
        pressure_head: p / (rho g), (nx, ny) [m].
        edge, corner: weights of the Laplacian times r / (1 + m), see `_tile_kernels`.
    """
    z, _ = levels(tiles)
    nx, ny = tiles.numbers[NX], tiles.numbers[NY]
    walls = nx != 0 and tiles.numbers[PERIODIC] == 0
    masked = tiles.water.size > 0
    high, wide = pressure_head.shape
    for a in range(-1, high + 1):
        for b in range(-1, wide + 1):
            total = 0.0
            here = np.float64(pressure_head[a, b]) if 0 <= a < high and 0 <= b < wide else 0.0
            for da in range(-1, 2):
                for db in range(-1, 2):
                    if da == 0 and db == 0:
                        continue
                    c, d = a + da, b + db
                    if walls:
                        c = min(max(i + c, 0), nx - 1) - i
                        d = min(max(j + d, 0), ny - 1) - j
                    if masked and not _is_water(tiles, i + c, j + d):
                        continue
                    there = (
                        np.float64(pressure_head[c, d]) if 0 <= c < high and 0 <= d < wide else 0.0
                    )
                    total += (edge if da == 0 or db == 0 else corner) * (there - here)
            if total == 0.0 or (masked and not _is_water(tiles, i + a, j + b)):
                continue
            slot, row, column, _ = locate(tiles, i + a, j + b)
            if slot > STILL:
                z[slot, row, column] += np.float32(total)


@kernel
def read_moving_block(
    tiles: Any,
    i: int,
    j: int,
    numbers: Any,
    wide: Any,
    level_out: Any,
    rate_out: Any,
    open_out: Any,
) -> Any:
    """What a body feels of the surface over a step, on a block of cells: its level and its speed without loads.

        rate = (z_free - z-) / (2 t),    z_free = z + q (z - z-) + s L(z)

    Args:
        numbers: q, s times the weights of edges and corners, and 1 / (2 t).
        wide: scratch, two of (nx + 2, ny + 2).
        level_out, rate_out: (nx, ny) [m], [m/s]; 0 beyond walls.
        open_out: (nx, ny), 1 in water and 0 on land and beyond walls.

    Returns:
        Greatest |level| [m] and |rate| [m/s].
    """
    q, edge, corner, per_two_steps = numbers
    z, before = wide
    read_block(tiles, i - 1, j - 1, z, before)
    nx, ny = level_out.shape
    walls = tiles.numbers[NX] != 0 and tiles.numbers[PERIODIC] == 0
    masked = tiles.water.size > 0
    highest = fastest = 0.0
    for p in range(nx):
        for r in range(ny):
            here, old = z[p + 1, r + 1], before[p + 1, r + 1]
            if walls or masked:
                water = _is_open(tiles, i + p, j + r, walls, masked)
                edges, corners = _bent_at_coast(tiles, z, i, j, p, r, walls, masked)
            else:
                water = 1.0
                edges = (z[p, r + 1] + z[p + 2, r + 1]) + (z[p + 1, r] + z[p + 1, r + 2])
                corners = (z[p, r] + z[p, r + 2]) + (z[p + 2, r] + z[p + 2, r + 2])
                edges, corners = edges - 4.0 * here, corners - 4.0 * here
            free = here + q * (here - old) + edge * edges + corner * corners
            level_out[p, r] = here
            rate_out[p, r] = water * per_two_steps * (free - old)
            open_out[p, r] = water
            highest, fastest = max(highest, abs(here)), max(fastest, abs(rate_out[p, r]))
    return highest, fastest


@kernel
def _is_open(tiles: Any, i: int, j: int, walls: bool, masked: bool) -> float:
    """1 if a cell is water, 0 on land and beyond walls."""
    if walls and not (0 <= i < tiles.numbers[NX] and 0 <= j < tiles.numbers[NY]):
        return 0.0
    return 0.0 if masked and not _is_water(tiles, i, j) else 1.0


@kernel
def _bent_at_coast(
    tiles: Any, z: Any, i: int, j: int, p: int, r: int, walls: bool, masked: bool
) -> Any:
    """Sums of z less its own over the four edges and the four corners that are water; walls mirror."""
    edges = corners = 0.0
    for da in range(-1, 2):
        for db in range(-1, 2):
            a, b = p + da, r + db
            if walls:
                a = min(max(i + a, 0), tiles.numbers[NX] - 1) - i
                b = min(max(j + b, 0), tiles.numbers[NY] - 1) - j
            if masked and not _is_water(tiles, i + a, j + b):
                continue
            if not (-1 <= a < z.shape[0] - 1 and -1 <= b < z.shape[1] - 1):
                continue  # of a cell beyond walls
            if da == 0 or db == 0:
                edges += z[a + 1, b + 1] - z[p + 1, r + 1]
            else:
                corners += z[a + 1, b + 1] - z[p + 1, r + 1]
    return edges, corners


@kernel
def fill_round_head(
    pressure_head: Any, centre_x: float, centre_y: float, reach: float, volume: float
) -> None:
    """Pressure head of a round load: (1 - (r / reach)^2)^2 inside `reach`, its sum = `volume`.

    Lengths are in cells and (centre_x, centre_y) is the centre in indices of the head. The sum is
    taken over the cells themselves, so the load is exact wherever the centre falls between them.
    """
    total = 0.0
    scale = 1.0 / (reach * reach)
    for i in range(pressure_head.shape[0]):
        for j in range(pressure_head.shape[1]):
            inside = 1.0 - ((i - centre_x) ** 2 + (j - centre_y) ** 2) * scale
            if inside > 0.0:
                pressure_head[i, j] = inside * inside
                total += inside * inside
            else:
                pressure_head[i, j] = 0.0
    pressure_head *= np.float32(volume / total)


@kernel
def sample_points(
    tiles: Any, edge: int, at: Any, spacing: float, timestep: float, out: Any
) -> None:  # fmt: skip
    """Bilinear elevation, slopes and vertical speed at points given in cells, (n, 2) -> (n, 4).

    Slopes are central differences at the cells, interpolated; at walls the surface is mirrored, and beyond them
    and at points that are not finite it is still. `edge` cells along the walls are not sampled.
    """
    z, prev = levels(tiles)
    nx, ny = tiles.numbers[NX], tiles.numbers[NY]
    walls = nx != 0 and tiles.numbers[PERIODIC] == 0
    cell = np.empty((4, 4), np.float32)
    before = np.empty((4, 4), np.float32)
    for k in range(at.shape[0]):
        x, y = at[k, 0], at[k, 1]
        out[k] = 0.0
        if not (np.isfinite(x) and np.isfinite(y) and abs(x) < 1e15 and abs(y) < 1e15):
            continue
        if walls and not (
            edge - 0.5 <= x <= nx - edge - 0.5 and edge - 0.5 <= y <= ny - edge - 0.5
        ):
            continue
        i, j = int(np.floor(x)), int(np.floor(y))
        for p in range(4):
            for q in range(4):
                a, b = i + p - 1, j + q - 1
                if walls:
                    a, b = min(max(a, edge), nx - 1 - edge), min(max(b, edge), ny - 1 - edge)
                slot, row, column, _ = locate(tiles, a, b)
                cell[p, q] = z[slot, row, column] if slot > STILL else 0.0
                before[p, q] = prev[slot, row, column] if slot > STILL else 0.0
        for di in range(2):
            for dj in range(2):
                weight = (x - i if di else 1.0 - x + i) * (y - j if dj else 1.0 - y + j)
                p, q = 1 + di, 1 + dj
                out[k, 0] += weight * cell[p, q]
                out[k, 1] += weight * (cell[p + 1, q] - cell[p - 1, q])
                out[k, 2] += weight * (cell[p, q + 1] - cell[p, q - 1])
                out[k, 3] += weight * (cell[p, q] - before[p, q])
        out[k, 1] /= 2.0 * spacing
        out[k, 2] /= 2.0 * spacing
        out[k, 3] = out[k, 3] / timestep if timestep > 0.0 else 0.0
