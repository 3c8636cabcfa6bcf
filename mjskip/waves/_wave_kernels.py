"""Kernels of the water surface: equations (5)-(8) of Lee & Baek, repaired, float32, in place.

With m = mu t / 2, r = (c t / d)^2 and the discrete Laplacian L (times d^2), the update is

    z+ = z + q (z - z-) + s L(z),    q = (1 - m) / (1 + m),    s = r / (1 + m)

which is equation (7) with its terms gathered so that the weights of a level surface cancel in
floating point too. z+ is written over z-, so a step reads two grids and writes one.

Layout: row 0 and the last row are ghosts, column `FIRST - 1` and the one after the last cell too.
`FIRST` puts the first cell of every row on a 64-byte boundary, which the aligned loads need.
"""

import numpy as np
import numpy.typing as npt

from mjskip._compile.jit import kernel
from mjskip.waves._row import column_sum, step_rows

Grid = npt.NDArray[np.float32]

FIRST = 16
"""Column of the first cell; with a row stride of a multiple of 16 every row starts aligned."""

CACHE_CELLS = 1 << 15
"""Cells of each of two grids that stay in the second-level cache together."""

REFLECT, PERIODIC, OUTGOING = 0, 1, 2
BOUNDARY_CODES = {"reflect": REFLECT, "periodic": PERIODIC, "absorb": OUTGOING}


@kernel
def step_nine(
    z: Grid,
    prev: Grid,
    i0: int,
    i1: int,
    j0: int,
    j1: int,
    q: float,
    s: float,
    mirrored: bool,
) -> None:
    """prev = z + q (z - prev) + s L(z) in rows i0..i1, nine-point L.

    If `mirrored`, the grid ends in walls as in `fill_ghosts`, whose ghosts are then neither read nor
    needed; j0..j1 are all its cells.

    L = [1 4 1; 4 -20 4; 1 4 1] / 6 = ([1 4 1]^T [1 4 1] - 36) / 6; four rows a pass share what they load.
    """
    along, sixth = np.float32(q), np.float32(s) / np.float32(6.0)
    cells, out, stride, n = z.reshape(z.size), prev.reshape(prev.size), z.shape[1], j1 - j0
    wall = 1 if mirrored else 0
    low, high = wall, z.shape[0] - 1 - wall
    west, east = z[:, j0 - 1 + wall], z[:, j1 - wall]
    i = i0
    while i < i1:
        below = max(i - 1, low)
        if i + 4 <= i1:
            above = min(i + 4, high)
            starts = (
                below * stride + j0,
                i * stride + j0,
                (i + 1) * stride + j0,
                (i + 2) * stride + j0,
                (i + 3) * stride + j0,
                above * stride + j0,
            )
            left = (
                column_sum(west[below], west[i], west[i + 1]),
                column_sum(west[i], west[i + 1], west[i + 2]),
                column_sum(west[i + 1], west[i + 2], west[i + 3]),
                column_sum(west[i + 2], west[i + 3], west[above]),
            )
            right = (
                column_sum(east[below], east[i], east[i + 1]),
                column_sum(east[i], east[i + 1], east[i + 2]),
                column_sum(east[i + 1], east[i + 2], east[i + 3]),
                column_sum(east[i + 2], east[i + 3], east[above]),
            )
            step_rows(cells, starts, out, n, left, right, along, sixth)
            i += 4
        else:
            above = min(i + 1, high)
            step_rows(
                cells,
                (below * stride + j0, i * stride + j0, above * stride + j0),
                out,
                n,
                (column_sum(west[below], west[i], west[above]),),
                (column_sum(east[below], east[i], east[above]),),
                along,
                sixth,
            )
            i += 1


@kernel
def step_nine_deep(
    z: Grid,
    prev: Grid,
    i0: int,
    i1: int,
    j0: int,
    j1: int,
    q: float,
    s: float,
    depth: int,
    shrink_low: int,
    shrink_high: int,
) -> None:
    """Several steps between walls in one pass: z and prev change roles after each of them.

    Step m (from 0) covers rows i0 + m shrink_low .. i1 - m shrink_high. It follows the step before it a
    row behind, where that one has been and will not come again, so that rows are stepped while they are
    in the cache.
    """
    chunk = max(4, (CACHE_CELLS // z.shape[1] - depth) // 4 * 4)
    done, end = np.empty(depth, np.int64), np.empty(depth, np.int64)
    for m in range(depth):
        done[m], end[m] = i0 + m * shrink_low, i1 - m * shrink_high
    while done[depth - 1] < end[depth - 1]:
        for m in range(depth):
            if m == 0:
                until = min(done[0] + chunk, end[0])
            else:
                until = end[m] if done[m - 1] == end[m - 1] else min(done[m - 1] - 1, end[m])
            if until > done[m]:
                if m % 2 == 0:
                    step_nine(z, prev, done[m], until, j0, j1, q, s, True)
                else:
                    step_nine(prev, z, done[m], until, j0, j1, q, s, True)
                done[m] = until


@kernel
def step_five(
    z: Grid,
    prev: Grid,
    i0: int,
    i1: int,
    j0: int,
    j1: int,
    q: float,
    s: float,
) -> None:
    """prev = z + q (z - prev) + s L(z) in rows i0..i1, five-point L."""
    n, along, scale = j1 - j0, np.float32(q), np.float32(s)
    four = np.float32(4.0)
    for i in range(i0, i1):
        below, here, above = z[i - 1, j0:j1], z[i, j0 - 1 : j1 + 1], z[i + 1, j0:j1]
        out = prev[i, j0:j1]
        for j in range(n):
            level = here[j + 1]
            bend = ((below[j] + above[j]) + (here[j] + here[j + 2])) - four * level
            out[j] = (level + along * (level - out[j])) + scale * bend


@kernel
def step_sponge(
    z: Grid,
    prev: Grid,
    i0: int,
    i1: int,
    j0: int,
    j1: int,
    m: np.float32,
    r: np.float32,
    edge: np.float32,
    corner: np.float32,
    sponge_x: Grid,
    sponge_y: Grid,
) -> None:
    """The same step where friction varies: m + sponge_x[i] + sponge_y[j], any L of nine weights.

    `sponge_x`, `sponge_y` are indexed like the rows and columns of z and hold mu t / 2.
    """
    n = j1 - j0
    one = np.float32(1.0)
    four = np.float32(4.0)
    for i in range(i0, i1):
        below, here = z[i - 1, j0 - 1 : j1 + 1], z[i, j0 - 1 : j1 + 1]
        above = z[i + 1, j0 - 1 : j1 + 1]
        soft, out = sponge_y[j0:j1], prev[i, j0:j1]
        friction_x = m + sponge_x[i]
        for j in range(n):
            level = here[j + 1]
            friction = friction_x + soft[j]
            edges = ((below[j + 1] + above[j + 1]) + (here[j] + here[j + 2])) - four * level
            corners = ((below[j] + below[j + 2]) + (above[j] + above[j + 2])) - four * level
            bend = r * (edge * edges + corner * corners)
            out[j] = level + ((one - friction) * (level - out[j]) + bend) / (one + friction)


@kernel
def step_masked(
    z: Grid,
    prev: Grid,
    i0: int,
    i1: int,
    j0: int,
    j1: int,
    keep: np.float32,
    m: np.float32,
    r: np.float32,
    edge: np.float32,
    corner: np.float32,
    sponge_x: Grid,
    sponge_y: Grid,
    wet: Grid,
) -> None:
    """The step around obstacles: `wet` is 1 in water, 0 on land, where the surface stays at 0.

    Each neighbour gives weight (z_neighbour - z) if it is wet. What one cell gains its neighbour
    loses, so volume is conserved; and leaving terms out only lowers the frequencies, so the limit
    on the step holds. `keep` is 1 in a step.
    """
    n = j1 - j0
    one = np.float32(1.0)
    for i in range(i0, i1):
        below, here = z[i - 1, j0 - 1 : j1 + 1], z[i, j0 - 1 : j1 + 1]
        above = z[i + 1, j0 - 1 : j1 + 1]
        wet_below, wet_here = wet[i - 1, j0 - 1 : j1 + 1], wet[i, j0 - 1 : j1 + 1]
        wet_above = wet[i + 1, j0 - 1 : j1 + 1]
        soft, out = sponge_y[j0:j1], prev[i, j0:j1]
        friction_x = m + sponge_x[i]
        for j in range(n):
            level = here[j + 1]
            friction = friction_x + soft[j]
            edges = (
                wet_below[j + 1] * (below[j + 1] - level)
                + wet_above[j + 1] * (above[j + 1] - level)
            ) + (wet_here[j] * (here[j] - level) + wet_here[j + 2] * (here[j + 2] - level))
            corners = (
                wet_below[j] * (below[j] - level) + wet_below[j + 2] * (below[j + 2] - level)
            ) + (wet_above[j] * (above[j] - level) + wet_above[j + 2] * (above[j + 2] - level))
            change = (keep - friction) * (level - out[j]) + r * (edge * edges + corner * corners)
            out[j] = level + wet_here[j + 1] * change / (one + friction)


@kernel
def fill_ghosts(
    z: Grid, prev: Grid, i1: int, j0: int, j1: int, boundary: int, outgoing: np.float32
) -> None:
    """Set the ghosts of z, cells being rows 1..i1 and columns j0..j1.

    REFLECT mirrors about the cell's outer face: no flux through it, so volume is conserved.
    PERIODIC copies from the other side. OUTGOING is the one-way wave equation z_t + c z_n = 0,
    z_ghost = z_in- + outgoing (z_in - z_ghost-) with outgoing = (k - 1) / (k + 1), k = c t / d
    (G. Mur, IEEE Trans. EMC 23:377, 1981).
    """
    last = i1 - 1
    right = j1 - 1
    if boundary == OUTGOING:
        for i in range(1, i1):
            z[i, j0 - 1] = prev[i, j0] + outgoing * (z[i, j0] - prev[i, j0 - 1])
            z[i, j1] = prev[i, right] + outgoing * (z[i, right] - prev[i, j1])
        for j in range(j0, j1):
            z[0, j] = prev[1, j] + outgoing * (z[1, j] - prev[0, j])
            z[i1, j] = prev[last, j] + outgoing * (z[last, j] - prev[i1, j])
        half = np.float32(0.5)
        z[0, j0 - 1] = half * (z[0, j0] + z[1, j0 - 1])
        z[0, j1] = half * (z[0, right] + z[1, j1])
        z[i1, j0 - 1] = half * (z[i1, j0] + z[last, j0 - 1])
        z[i1, j1] = half * (z[i1, right] + z[last, j1])
        return
    if boundary == PERIODIC:
        for i in range(1, i1):
            z[i, j0 - 1] = z[i, right]
            z[i, j1] = z[i, j0]
        z[0, j0 - 1 : j1 + 1] = z[last, j0 - 1 : j1 + 1]
        z[i1, j0 - 1 : j1 + 1] = z[1, j0 - 1 : j1 + 1]
        return
    for i in range(1, i1):
        z[i, j0 - 1] = z[i, j0]
        z[i, j1] = z[i, right]
    z[0, j0 - 1 : j1 + 1] = z[1, j0 - 1 : j1 + 1]
    z[i1, j0 - 1 : j1 + 1] = z[last, j0 - 1 : j1 + 1]


@kernel
def add_head(
    out: Grid,
    head: Grid,
    first_i: int,
    first_j: int,
    i1: int,
    j0: int,
    j1: int,
    boundary: int,
    edge: float,
    corner: float,
    wet: Grid,
) -> None:
    """out += edge-and-corner Laplacian of `head`, whose cell (0, 0) is cell (first_i, first_j).

    Cells of the head that lie outside the grid are dropped (PERIODIC: they come in on the other
    side); at the walls it is mirrored as the surface is, so that what is added sums to zero. `wet`
    is the mask of `step_masked`, or empty.
    """
    masked = wet.size > 0
    nx, ny = i1 - 1, j1 - j0
    high, wide = head.shape
    for a in range(-1, high + 1):
        i = first_i + a - 1
        if boundary != PERIODIC and not 0 <= i < nx:
            continue
        for b in range(-1, wide + 1):
            j = first_j + b - j0
            if boundary != PERIODIC and not 0 <= j < ny:
                continue
            if masked and wet[1 + i % nx, j0 + j % ny] == 0.0:
                continue
            total = 0.0
            here = 0.0
            if 0 <= a < high and 0 <= b < wide:
                here = head[a, b]
            for da in range(-1, 2):
                for db in range(-1, 2):
                    if da == 0 and db == 0:
                        continue
                    c, d = a + da, b + db
                    if boundary != PERIODIC:
                        c = min(max(i + da, 0), nx - 1) - i + a
                        d = min(max(j + db, 0), ny - 1) - j + b
                    if masked and wet[1 + (i + c - a) % nx, j0 + (j + d - b) % ny] == 0.0:
                        continue
                    there = 0.0
                    if 0 <= c < high and 0 <= d < wide:
                        there = head[c, d]
                    total += (edge if da == 0 or db == 0 else corner) * (there - here)
            out[1 + i % nx, j0 + j % ny] += np.float32(total)


@kernel
def sample_points(
    z: Grid,
    prev: Grid,
    i1: int,
    j0: int,
    j1: int,
    boundary: int,
    at: npt.NDArray[np.float64],
    spacing: float,
    timestep: float,
    out: npt.NDArray[np.float64],
) -> None:
    """Bilinear elevation, slopes and vertical speed at points given in cells, (n, 2) -> (n, 4).

    Slopes are central differences at the cells, interpolated. Still water outside the grid.
    """
    nx, ny = i1 - 1, j1 - j0
    for k in range(at.shape[0]):
        x, y = at[k, 0], at[k, 1]
        out[k] = 0.0
        if not (-0.5 <= x <= nx - 0.5 and -0.5 <= y <= ny - 0.5):
            continue
        i, j = int(np.floor(x)), int(np.floor(y))
        for di in range(2):
            for dj in range(2):
                weight = (x - i if di else 1.0 - x + i) * (y - j if dj else 1.0 - y + j)
                a, b = i + di, j + dj
                if boundary == PERIODIC:
                    a, west, east = a % nx, (a - 1) % nx, (a + 1) % nx
                    b, south, north = b % ny, (b - 1) % ny, (b + 1) % ny
                else:
                    west, east = min(max(a - 1, 0), nx - 1), min(max(a + 1, 0), nx - 1)
                    south, north = min(max(b - 1, 0), ny - 1), min(max(b + 1, 0), ny - 1)
                    a, b = min(max(a, 0), nx - 1), min(max(b, 0), ny - 1)
                level = z[1 + a, j0 + b]
                out[k, 0] += weight * level
                out[k, 1] += weight * (z[1 + east, j0 + b] - z[1 + west, j0 + b])
                out[k, 2] += weight * (z[1 + a, j0 + north] - z[1 + a, j0 + south])
                out[k, 3] += weight * (level - prev[1 + a, j0 + b])
        out[k, 1] /= 2.0 * spacing
        out[k, 2] /= 2.0 * spacing
        out[k, 3] = out[k, 3] / timestep if timestep > 0.0 else 0.0
