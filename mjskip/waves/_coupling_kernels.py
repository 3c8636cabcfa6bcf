"""Bodies and the surface act on each other: one implicit solve a step, energy closed.

Wet faces i with area A_i, outward normal n_i, arm r_i and load f_i >= 0 along -n_i:

    f_i    = A_i (a rho (vn_i)+^2 + b rho U (vn_i)+)                       the law, of the relative normal speed
    vn_i   = n_i . (V + omega x r_i) - n_iz S_i (z[n+1] - z[n-1]) / (2 dt)
    p      = sum_i S_i^T (-f_i n_iz) / d^2                                 pressure on the cells
    z[n+1] = z_free[n+1] - dt^2 / (1 + mu dt / 2) G p / rho

S_i are weights of the bump (1 - r^2 / e^2)^2 about the face's load point, with a fixed radius e in metres; they
sum to 1, and the same weights sample the surface and spread the load. What z[n+1] owes to the loads themselves
makes vn = free - M f with a symmetric M >= 0, and f is monotone in vn: there is one solution. Gauss-Seidel finds
it, each face in closed form.

Faces that would recede from the surface if none were loaded stay unloaded: with f_i = 0 the balance of energy holds
as well, and they need no row of M.

A *surface* is a local block of cells: frame (x and y of its first cell, spacing, greatest |level| and |rate|), level z[n],
rate (z_free[n+1] - z[n-1]) / (2 dt) and open cells (0 on land, else 1), arrays (nx, ny), x first. Outside of it
the water is still.

A *face* is a row of FACE doubles, see the constants. *Spots* are rows of first cell (2) and side^2 weights.
Blocks of bodies and their states are those of `mjskip.hydro._block`.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import kernel
from mjskip.hydro import _block as hydro
from mjskip.hydro._clip_kernels import immersed_part
from mjskip.hydro._strip_kernels import pressure_centre
from mjskip.rigid import _rigid_kernels as rigid

POINT_X, POINT_Y = 0, 1  # where the load acts, world [m]
ARM = 2  # of that point about the body's centre of mass, world axes (3) [m]
NORMAL = 5  # outward, world axes (3)
AREA = 8  # wet [m^2]
SQUARED = (
    9  # f = SQUARED vn^2 + LINEAR vn, or of a law with a cavity CAVITY pi vn / (FOUR_U + pi vn)
)
LINEAR = 10
CAVITY = 11
FOUR_U = 12
BODY = 13
FACE = 14  # doubles for one face

INVERSE_MASS = 0  # of a body, for `add_mobility`
INVERSE_INERTIA = 1  # world axes (9)
MOBILITY = 10

SPACING, HIGHEST, FASTEST = 2, 3, 4  # of a frame
FRAME = 5

SPOT = 2  # doubles of a spot before its weights

MAX_SWEEPS = 1000


@kernel
def elevation(frame: Any, level: Any, x: float, y: float) -> float:
    """Level of the surface at a place, bilinear between cells; 0 outside the block."""
    return _level_at(level, (x - frame[0]) / frame[SPACING], (y - frame[1]) / frame[SPACING])


@kernel
def _level_at(level: Any, east: float, north: float) -> float:
    """The same at a place in cells from the first."""
    nx, ny = level.shape
    if not (0.0 <= east < nx - 1 and 0.0 <= north < ny - 1):
        return 0.0
    i, j = np.intp(east), np.intp(north)
    east -= i
    north -= j
    found: float = (1.0 - east) * ((1.0 - north) * level[i, j] + north * level[i, j + 1]) + (
        east * ((1.0 - north) * level[i + 1, j] + north * level[i + 1, j + 1])
    )
    return found


# Over 80 lines: one pass over the faces fills one row of ten columns; helpers would pass them all.
@kernel
def find_faces(
    block: Any, state: Any, frame: Any, level: Any, body: int, faces: Any, count: int
) -> int:
    """Wet parts of a body's triangles, appended to faces from row `count` on; the number of faces then.

    Left out is what recedes faster than the surface moves anywhere.

    Args:
        block: of a body whose triangles are no longer than the radius of the bumps.
        state: of the body (18,).
        frame, level: the surface.
        body: number that the faces get.
        faces: room for all triangles of all bodies, (n, FACE).
        count: faces that are there already.
    """
    z, ux, uy, uz = state[2], state[9], state[10], state[11]
    highest = frame[HIGHEST]
    if not z < block[hydro.RADIUS] + highest:
        return count
    vx, vy, vz = state[12], state[13], state[14]
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    forward = block[hydro.FORWARD] != 0.0
    # velocity in body axes, for the pressure centre
    bx = state[3] * vx + state[6] * vy + state[9] * vz
    by = state[4] * vx + state[7] * vy + state[10] * vz
    bz = state[5] * vx + state[8] * vy + state[11] * vz
    wx = state[3] * state[15] + state[6] * state[16] + state[9] * state[17]
    wy = state[4] * state[15] + state[7] * state[16] + state[10] * state[17]
    wz = state[5] * state[15] + state[8] * state[16] + state[11] * state[17]
    # from body axes to cells of the surface
    d = 1.0 / frame[SPACING]
    east, north = (state[0] - frame[0]) * d, (state[1] - frame[1]) * d
    ex, ey, ez = state[3] * d, state[4] * d, state[5] * d
    mx, my, mz = state[6] * d, state[7] * d, state[8] * d
    turn = math.sqrt(wx * wx + wy * wy + wz * wz)
    n = int(block[hydro.STRIDE])
    for k in range(int(block[hydro.N_FACES])):
        a = hydro.HEADER + k
        px, py, pz = block[a], block[a + n], block[a + 2 * n]
        qx, qy, qz = block[a + 3 * n], block[a + 4 * n], block[a + 5 * n]
        rx, ry, rz = block[a + 6 * n], block[a + 7 * n], block[a + 8 * n]
        # heights above the surface
        hp = z + ux * px + uy * py + uz * pz
        hq = z + ux * qx + uy * qy + uz * qz
        hr = z + ux * rx + uy * ry + uz * rz
        if not (hp < highest or hq < highest or hr < highest):
            continue
        c = a + hydro.FACES * n
        nx, ny, nz = block[c], block[c + n], block[c + 2 * n]
        rise = frame[FASTEST] * abs(ux * nx + uy * ny + uz * nz)
        if not forward:
            # of the middle of the face, and of any place on it at most
            c += hydro.ARM * n
            advance = nx * bx + ny * by + nz * bz
            advance += wx * block[c] + wy * block[c + n] + wz * block[c + 2 * n]
            reach = abs(px - qx) + abs(py - qy) + abs(pz - qz)
            reach += abs(px - rx) + abs(py - ry) + abs(pz - rz)
            if advance + rise + turn * reach <= 0.0:
                continue
        if highest > 0.0 and max(hp, hq, hr) >= -highest:
            hp -= _level_at(level, east + ex * px + ey * py + ez * pz, north + mx * px + my * py + mz * pz)  # fmt: skip
            hq -= _level_at(level, east + ex * qx + ey * qy + ez * qz, north + mx * qx + my * qy + mz * qz)  # fmt: skip
            hr -= _level_at(level, east + ex * rx + ey * ry + ez * rz, north + mx * rx + my * ry + mz * rz)  # fmt: skip
        fraction, x, y, h = immersed_part(px, py, pz, hp, qx, qy, qz, hq, rx, ry, rz, hr)
        if not fraction > 0.0:
            continue
        if forward:
            depth = -(z + ux * x + uy * y + uz * h)
            if highest > 0.0:
                depth += _level_at(level, east + ex * x + ey * y + ez * h, north + mx * x + my * y + mz * h)  # fmt: skip
            depth = max(depth, 0.0)  # where a curved surface dips between corners
            x, y, h = pressure_centre(block, k, x, y, h, nx, ny, nz, bx, by, bz, ux, uy, uz, depth)
        advance = (
            nx * (bx + wy * h - wz * y) + ny * (by + wz * x - wx * h) + nz * (bz + wx * y - wy * x)
        )
        if advance + rise <= 0.0:
            continue
        face = faces[count]
        for axis in range(3):
            face[ARM + axis] = (
                state[3 + 3 * axis] * x + state[4 + 3 * axis] * y + state[5 + 3 * axis] * h
            )
            face[NORMAL + axis] = (
                state[3 + 3 * axis] * nx + state[4 + 3 * axis] * ny + state[5 + 3 * axis] * nz
            )
        area = fraction * block[hydro.HEADER + hydro.AREA * n + k]
        face[POINT_X] = state[0] + face[ARM]
        face[POINT_Y] = state[1] + face[ARM + 1]
        face[AREA] = area
        face[SQUARED] = area * block[hydro.NORMAL_SQUARED]
        face[LINEAR] = area * block[hydro.SPEED_NORMAL] * speed
        face[CAVITY] = area * block[hydro.CAVITY] * speed * speed
        face[FOUR_U] = 4.0 * speed
        face[BODY] = body
        count += 1
    return count


@kernel
def spread_bumps(
    faces: Any, count: int, frame: Any, radius: float, open_cells: Any, side: int, spots: Any
) -> None:
    """S_i of every face: w ~ (1 - r^2 / e^2)^2 on the cells within e of its load point, sum w = 1.

    A face with no cell of the block within reach has weights 0: it feels still water and moves none.

    Args:
        faces, count: the faces.
        frame: of the surface.
        radius: e [m].
        open_cells: (nx, ny), 0 on land, which neither carries loads nor is sampled.
        side: cells across a bump at most, floor(2 e / d) + 1.
        spots: (n, SPOT + side^2).
    """
    nx, ny = open_cells.shape
    d = frame[SPACING]
    reach = radius / d
    for n in range(count):
        east, north = (faces[n, POINT_X] - frame[0]) / d, (faces[n, POINT_Y] - frame[1]) / d
        spot = spots[n]
        if not (-reach < east < nx - 1 + reach and -reach < north < ny - 1 + reach):
            for k in range(SPOT + side * side):
                spot[k] = 0.0
            continue
        i0, j0 = math.ceil(east - reach), math.ceil(north - reach)
        spot[0], spot[1] = i0, j0
        inside = i0 >= 0 and j0 >= 0 and i0 + side <= nx and j0 + side <= ny
        total = 0.0
        for a in range(side):
            gap_x = 1.0 - ((i0 + a - east) / reach) ** 2
            for b in range(side):
                gap = max(gap_x - ((j0 + b - north) / reach) ** 2, 0.0)
                weight = gap * gap
                there = inside or (0 <= i0 + a < nx and 0 <= j0 + b < ny)
                if not there or open_cells[i0 + a, j0 + b] == 0:
                    weight = 0.0
                spot[SPOT + a * side + b] = weight
                total += weight
        if total > 0.0:
            scale = 1.0 / total
            for k in range(SPOT, SPOT + side * side):
                spot[k] *= scale


@kernel
def sample(spot: Any, side: int, field: Any) -> float:
    """S_i of a field (nx, ny)."""
    nx, ny = field.shape
    i0, j0 = int(spot[0]), int(spot[1])
    total = 0.0
    for a in range(max(0, -i0), min(side, nx - i0)):
        for b in range(max(0, -j0), min(side, ny - j0)):
            total += spot[SPOT + a * side + b] * field[i0 + a, j0 + b]
    return total


@kernel
def add_spot(spot: Any, side: int, amount: float, field: Any) -> None:
    """field += S_i^T amount."""
    nx, ny = field.shape
    i0, j0 = int(spot[0]), int(spot[1])
    for a in range(max(0, -i0), min(side, nx - i0)):
        for b in range(max(0, -j0), min(side, ny - j0)):
            field[i0 + a, j0 + b] += spot[SPOT + a * side + b] * amount


@kernel
def free_speeds(
    faces: Any, count: int, states: Any, spots: Any, side: int, rate: Any, speeds: Any
) -> int:
    """n_i . (V + omega x r_i) - n_iz S_i rate: normal speeds if no face were loaded.

    Faces that recede then are removed; the number of those that are left.

    Args:
        faces, count: the faces.
        states: of the bodies (n, 18).
        spots, side: their weights.
        rate: of the surface without loads (nx, ny).
        speeds: out (n,).
    """
    left = 0
    for n in range(count):
        face, state = faces[n], states[int(faces[n, BODY])]
        rx, ry, rz = face[ARM], face[ARM + 1], face[ARM + 2]
        nx, ny, nz = face[NORMAL], face[NORMAL + 1], face[NORMAL + 2]
        vx = state[12] + state[16] * rz - state[17] * ry
        vy = state[13] + state[17] * rx - state[15] * rz
        vz = state[14] + state[15] * ry - state[16] * rx
        speed = nx * vx + ny * vy + nz * (vz - sample(spots[n], side, rate))
        if speed <= 0.0:
            continue
        speeds[left] = speed
        if left < n:
            for k in range(FACE):
                faces[left, k] = face[k]
            for k in range(SPOT + side * side):
                spots[left, k] = spots[n, k]
        left += 1
    return left


@kernel
def surface_response(
    faces: Any, count: int, spots: Any, side: int, impulse: Any, factor: float,
    field: Any, matrix: Any,
) -> None:  # fmt: skip
    """M_ij = factor n_iz n_jz S_i G S_j^T: how much a load on j slows the surface's advance on i.

    Args:
        faces, count: the faces.
        spots, side: their weights.
        impulse: G of a unit on one cell, at cells -R..R of it each way (2 R + 1, 2 R + 1) [1/m]; beyond it is 0.
        factor: dt / (2 rho d^2 (1 + mu dt / 2)).
        field: scratch, of the surface's shape.
        matrix: out (n, n).
    """
    nx, ny = field.shape
    reach = impulse.shape[0] // 2
    low_i, low_j, high_i, high_j = nx, ny, 0, 0
    for n in range(count):
        i0, j0 = int(spots[n, 0]), int(spots[n, 1])
        low_i, low_j = min(low_i, max(i0, 0)), min(low_j, max(j0, 0))
        high_i, high_j = max(high_i, min(i0 + side, nx)), max(high_j, min(j0 + side, ny))
    for i in range(low_i, high_i):
        for j in range(low_j, high_j):
            field[i, j] = 0.0
    for n in range(count):
        i0, j0 = int(spots[n, 0]), int(spots[n, 1])
        first_i, last_i = max(low_i, i0 - reach), min(high_i, i0 + side + reach)
        first_j, last_j = max(low_j, j0 - reach), min(high_j, j0 + side + reach)
        for a in range(side):
            for b in range(side):
                weight = spots[n, SPOT + a * side + b]
                if weight == 0.0:
                    continue
                for i in range(max(first_i, i0 + a - reach), min(last_i, i0 + a + reach + 1)):
                    line = impulse[i - i0 - a + reach]
                    shift = reach - j0 - b
                    for j in range(max(first_j, j0 + b - reach), min(last_j, j0 + b + reach + 1)):
                        field[i, j] += weight * line[j + shift]
        for m in range(n, count):
            found = factor * faces[n, NORMAL + 2] * faces[m, NORMAL + 2]
            found *= sample(spots[m], side, field)
            matrix[n, m] = found
            matrix[m, n] = found
        for i in range(first_i, last_i):
            for j in range(first_j, last_j):
                field[i, j] = 0.0


@kernel
def surface_response_by_distance(
    faces: Any, count: int, profile: Any, per_area: float, factor: float, matrix: Any
) -> None:
    """The same with S_i G S_j^T / d^2 from a table in the squared distance of the load points, 0 beyond it.

    Args:
        faces, count: the faces.
        profile: at squared distances 0, 1, ... / per_area, linear between them [1/m^3].
        per_area: entries per square metre.
        factor: dt / (2 rho (1 + mu dt / 2)).
        matrix: out (n, n).
    """
    last = profile.size - 1
    for n in range(count):
        x, y = faces[n, POINT_X], faces[n, POINT_Y]
        scale = factor * faces[n, NORMAL + 2]
        for m in range(n, count):
            dx, dy = faces[m, POINT_X] - x, faces[m, POINT_Y] - y
            place = (dx * dx + dy * dy) * per_area
            found = 0.0
            if place < last:
                k = int(place)
                place -= k
                found = profile[k] + place * (profile[k + 1] - profile[k])
                found *= scale * faces[m, NORMAL + 2]
            matrix[n, m] = found
            matrix[m, n] = found


@kernel
def add_mobility(faces: Any, count: int, bodies: Any, factor: float, matrix: Any) -> None:
    """M_ij += factor (n_i . n_j / m + (r_i x n_i) . I^-1 (r_j x n_j)), i and j of one body.

    Args:
        faces, count: the faces.
        bodies: inverse mass and inverse inertia in world axes of every body (n, MOBILITY).
        factor: dt / 2 for the mean velocity of before and after the kick.
        matrix: added to (n, n).
    """
    for n in range(count):
        face, body = faces[n], bodies[int(faces[n, BODY])]
        nx, ny, nz = face[NORMAL], face[NORMAL + 1], face[NORMAL + 2]
        tx = face[ARM + 1] * nz - face[ARM + 2] * ny
        ty = face[ARM + 2] * nx - face[ARM] * nz
        tz = face[ARM] * ny - face[ARM + 1] * nx
        k = INVERSE_INERTIA
        wx = factor * (body[k] * tx + body[k + 1] * ty + body[k + 2] * tz)
        wy = factor * (body[k + 3] * tx + body[k + 4] * ty + body[k + 5] * tz)
        wz = factor * (body[k + 6] * tx + body[k + 7] * ty + body[k + 8] * tz)
        vx, vy, vz = (
            factor * body[INVERSE_MASS] * nx,
            factor * body[INVERSE_MASS] * ny,
            factor * body[INVERSE_MASS] * nz,
        )
        for m in range(n, count):
            other = faces[m]
            if other[BODY] != face[BODY]:
                continue
            mx, my, mz = other[NORMAL], other[NORMAL + 1], other[NORMAL + 2]
            more = (
                vx * mx + vy * my + vz * mz
                + wx * (other[ARM + 1] * mz - other[ARM + 2] * my)
                + wy * (other[ARM + 2] * mx - other[ARM] * mz)
                + wz * (other[ARM] * my - other[ARM + 1] * mx)
            )  # fmt: skip
            matrix[n, m] += more
            if m != n:
                matrix[m, n] = matrix[n, m]


@kernel
def solve(
    faces: Any, count: int, matrix: Any, tolerance: float, most: int, speeds: Any, loads: Any
) -> int:
    """f_i = law(vn_i), vn = free - M f, by Gauss-Seidel; the sweeps made, `most` + 1 if that was too few.

    With all other loads known vn = c - M_ii f, and f = s vn^2 + l vn is a quadratic in vn:

        vn = 2 c / (q + sqrt(q^2 + 4 M_ii s c)),   q = 1 + M_ii l

    which is linear without s and has no difference of like numbers. A law with a cavity is a quadratic too,
    pi vn^2 + (4 U + M_ii p - pi c) vn = 4 U c with p = pi CAVITY.

    Args:
        faces, count: the faces.
        matrix: M, symmetric and >= 0.
        tolerance: greatest change of a load in the last sweep, as a fraction of the greatest load.
        most: sweeps.
        speeds: in: free; out: vn (n,).
        loads: out: f (n,).
    """
    for n in range(count):
        loads[n] = 0.0
    for sweep in range(most):
        change = largest = 0.0
        for n in range(count):
            old = loads[n]
            own = matrix[n, n]
            c = speeds[n] + own * old
            new = 0.0
            if c > 0.0:
                if faces[n, CAVITY] > 0.0:
                    p, r = math.pi * faces[n, CAVITY], faces[n, FOUR_U]
                    q = r + own * p - math.pi * c
                    root = math.sqrt(q * q + 4.0 * math.pi * r * c)
                    vn = 2.0 * r * c / (q + root) if q > 0.0 else (root - q) / (2.0 * math.pi)
                    new = p * vn / (r + math.pi * vn)
                else:
                    s, q = faces[n, SQUARED], 1.0 + own * faces[n, LINEAR]
                    vn = 2.0 * c / (q + math.sqrt(q * q + 4.0 * own * s * c))
                    new = vn * (s * vn + faces[n, LINEAR])
            if new != old:
                step = new - old
                loads[n] = new
                for m in range(count):
                    speeds[m] -= step * matrix[n, m]
                change = max(change, abs(step))
            largest = max(largest, new)
        if not change > tolerance * largest:
            return sweep + 1
    return most + 1


@kernel
def add_wrench(faces: Any, count: int, loads: Any, wrenches: Any) -> None:
    """Force and torque about the centre of mass, world axes, added to wrenches (bodies, 6)."""
    for n in range(count):
        face, out = faces[n], wrenches[int(faces[n, BODY])]
        fx, fy, fz = (
            -loads[n] * face[NORMAL],
            -loads[n] * face[NORMAL + 1],
            -loads[n] * face[NORMAL + 2],
        )
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += face[ARM + 1] * fz - face[ARM + 2] * fy
        out[4] += face[ARM + 2] * fx - face[ARM] * fz
        out[5] += face[ARM] * fy - face[ARM + 1] * fx


@kernel
def add_pressure(
    faces: Any, count: int, spots: Any, side: int, loads: Any, spacing: float, pressure: Any
) -> None:
    """p += sum_i S_i^T (-f_i n_iz) / d^2 on the cells (nx, ny) [Pa]."""
    area = spacing * spacing
    for n in range(count):
        if loads[n] != 0.0:
            add_spot(spots[n], side, -loads[n] * faces[n, NORMAL + 2] / area, pressure)


@kernel
def dissipation(count: int, speeds: Any, loads: Any) -> float:
    """sum f_i vn_i [W]: what bodies and surface lose to each other's relative motion."""
    total = 0.0
    for n in range(count):
        total += loads[n] * speeds[n]
    return total


@kernel
def solve_loads(
    blocks: Any, starts: Any, states: Any, mean_states: Any, surface: Any, radius: float,
    response: Any, factor: float, bodies: Any, kick: float, tolerance: float, work: Any,
) -> tuple[int, int]:  # fmt: skip
    """Loads on the wet faces of n bodies; the number of faces, and the sweeps made.

    Args:
        blocks, starts: blocks of all bodies in a row, and where each begins (n + 1,).
        states: of the bodies (n, 18).
        mean_states: with the velocities that loads act on; `states` inside another integrator.
        surface: frame, level, rate, open cells.
        radius: of the bumps [m].
        response: impulse, profile and its entries per square metre; the profile is used if the impulse is empty.
        factor: dt / (2 rho (1 + mu dt / 2)).
        bodies: (n, MOBILITY), for `kick` > 0.
        kick: dt / 2 if the bodies are kicked by the loads here; 0 inside another integrator.
        tolerance: of the loads, relative.
        work: faces (m, FRAME), spots (m, SPOT + side^2), matrix (m, m), speeds (m,), loads (m,) and a field of
            the surface's shape; m all triangles of all bodies.
    """
    frame, level, rate, open_cells = surface
    impulse, profile, per_area = response
    faces, spots, matrix, speeds, loads, field = work
    side = math.floor(2.0 * radius / frame[SPACING]) + 1
    count = 0
    for body in range(states.shape[0]):
        block = blocks[starts[body] : starts[body + 1]]
        count = find_faces(block, states[body], frame, level, body, faces, count)
    if count == 0:
        return 0, 0
    spread_bumps(faces, count, frame, radius, open_cells, side, spots)
    count = free_speeds(faces, count, mean_states, spots, side, rate, speeds)
    if impulse.size > 0:
        area = frame[SPACING] * frame[SPACING]
        surface_response(faces, count, spots, side, impulse, factor / area, field, matrix)
    else:
        surface_response_by_distance(faces, count, profile, per_area, factor, matrix)
    if kick > 0.0:
        add_mobility(faces, count, bodies, kick, matrix)
    return count, solve(faces, count, matrix, tolerance, MAX_SWEEPS, speeds, loads)


@kernel
def prepare_kick(
    y: Any, rows: Any, others: Any, timestep: float, states: Any, mean_states: Any, bodies: Any
) -> None:
    """States before a kick, those with half of the other forces' kick, and mobilities, of n bodies.

    Args:
        y: x, q, P, L of the bodies (n, 13).
        rows: of the bodies (n, rigid.BODY).
        others: force and torque that are not the solve's (n, 6).
        timestep: of the kick [s].
        states, mean_states: out (n, 18).
        bodies: out (n, MOBILITY).
    """
    for n in range(y.shape[0]):
        rigid.motion(rows[n], y[n], states[n])
        mass = rows[n, rigid.MASS]
        bodies[n, INVERSE_MASS] = 1.0 / mass
        for i in range(3):
            for j in range(3):  # R I^-1 R^T
                total = 0.0
                for a in range(3):
                    for b in range(3):
                        total += (
                            states[n, 3 + 3 * i + a]
                            * rows[n, rigid.INVERSE_INERTIA + 3 * a + b]
                            * states[n, 3 + 3 * j + b]
                        )
                bodies[n, INVERSE_INERTIA + 3 * i + j] = total
        for k in range(18):
            mean_states[n, k] = states[n, k]
        for i in range(3):
            mean_states[n, 12 + i] += 0.5 * timestep * others[n, i] / mass
            for j in range(3):
                mean_states[n, 15 + i] += (
                    0.5 * timestep * bodies[n, INVERSE_INERTIA + 3 * i + j] * others[n, 3 + j]
                )


@kernel
def free_flight(row: Any, y: Any, timestep: float, turn: float, state: Any) -> None:
    """x, q, P, L (13,) of a body after a while without loads: exact but for the turn.

        x += v dt + g dt^2 / 2,  P += m g dt,  L constant,  dq/dt = 1/2 (0, R I^-1 R^T L) q

    Args:
        row: of the body (rigid.BODY,).
        y: in and out.
        timestep: [s].
        turn: greatest angle of one step of RK4 of the orientation; the energy of the spin is kept to about
            turn^5 / 100 a step.
        state: scratch (18,).
    """
    for i in range(3):
        gravity = row[rigid.GRAVITY + i]
        y[i] += timestep * (y[7 + i] / row[rigid.MASS] + 0.5 * timestep * gravity)
        y[7 + i] += timestep * row[rigid.MASS] * gravity
    rigid.motion(row, y, state)
    spin = math.sqrt(state[15] ** 2 + state[16] ** 2 + state[17] ** 2)
    if not spin < math.inf:
        return
    steps = math.ceil(spin * timestep / turn)
    for _ in range(steps):
        h = timestep / steps
        w, x, y0, z = y[3], y[4], y[5], y[6]
        sw, sx, sy, sz = w, x, y0, z
        for stage in range(4):
            rigid.motion(row, y, state)
            a, b, c = 0.5 * state[15], 0.5 * state[16], 0.5 * state[17]
            dw = -a * y[4] - b * y[5] - c * y[6]
            dx = a * y[3] + b * y[6] - c * y[5]
            dy = b * y[3] + c * y[4] - a * y[6]
            dz = c * y[3] + a * y[5] - b * y[4]
            part = h / 6.0 if stage == 0 or stage == 3 else h / 3.0
            sw, sx, sy, sz = sw + part * dw, sx + part * dx, sy + part * dy, sz + part * dz
            ahead = h if stage == 2 else 0.5 * h
            y[3], y[4], y[5], y[6] = w + ahead * dw, x + ahead * dx, y0 + ahead * dy, z + ahead * dz
        norm = math.sqrt(sw * sw + sx * sx + sy * sy + sz * sz)
        y[3], y[4], y[5], y[6] = sw / norm, sx / norm, sy / norm, sz / norm
