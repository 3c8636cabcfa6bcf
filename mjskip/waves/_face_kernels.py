"""Loads of wet faces on water whose response to a load is local: found once a step, solved cell by cell.

    vn_i = n_i . (V + omega x r_i) - n_iz S_i (rate + u) - mobility
    f_i  = s_i (vn_i)+^2 + l_i (vn_i)+, or of a law with a cavity e_i pi (vn_i)+ / (4 U + pi (vn_i)+)
    u = sum_j k n_jz f_j G S_j^T,    k = dt / (2 rho d^2 (1 + mu dt / 2))

the equations of `_coupling_kernels`, without its matrix: Gauss-Seidel keeps u on the cells, where a face reads and
writes only what is under it. With the nine-point G that is (2 e / d + 3)^2 cells however many faces there are.

A *face* is a row of FACE doubles and then (2 e / d + 1)^2 weights S_i and (2 e / d + 3)^2 answers G S_i^T, on the
cells from one before the first cell of the weights on. All of it lies within the block of cells. Faces that would
recede from the surface if none were loaded stay unloaded and are left out, as in `_coupling_kernels`.
"""

import math
from typing import Any

from mjskip._compile.jit import inlined, kernel
from mjskip._compile.pointers import address_of, as_doubles, place_of
from mjskip.hydro import _block as hydro
from mjskip.hydro._clip_kernels import immersed_part
from mjskip.hydro._strip_kernels import pressure_centre
from mjskip.rigid.state import OMEGA, POSITION, ROTATION, VELOCITY

BODY = 0
NORMAL = 1  # outward, world axes (3)
TURN = 4  # arm x normal, the arm from the body's centre of mass to the load (3)
SQUARED, LINEAR = 7, 8  # f = SQUARED vn^2 + LINEAR vn
CELL_I, CELL_J = 9, 10  # first cell of the weights
OWN = 11  # S_i G S_i^T, then M_ii
RATE = 12  # S_i rate, then S_i (rate + u)
LOAD = 13  # f
SPEED = 14  # vn
TOTAL = 15  # f over a step, its evaluations weighted as the engine weights them
PANEL = 16  # which of all faces of all bodies it is a part of
CAVITY, FOUR_U = 17, 18  # of a law with a cavity: f = CAVITY pi vn / (FOUR_U + pi vn)
FACE = 19

INVERSE_MASS, INVERSE_INERTIA, MOBILITY = (
    0,
    1,
    10,
)  # of a body in world axes, as in `_coupling_kernels`

SWEEPS_AMONG_LOADED = 10
"""Most sweeps over the loaded faces between two over all."""


@kernel
def place_ahead(state: Any, time: float, out: Any) -> None:
    """Where a body will be after a time [s] if it goes on as it moves; velocities stay."""
    wx, wy, wz = state[OMEGA], state[OMEGA + 1], state[OMEGA + 2]
    angle = time * math.sqrt(wx * wx + wy * wy + wz * wz)
    # Rodrigues: R' = R + sin(a) / |w| W R + (1 - cos(a)) / |w|^2 W W R, W = w x
    sine, half = time, 0.5 * time
    if angle > 0.0:
        sine, half = time * math.sin(angle) / angle, time * math.sin(0.5 * angle) / angle
    versine = 2.0 * half * half
    for j in range(3):
        x, y, z = state[ROTATION + j], state[ROTATION + 3 + j], state[ROTATION + 6 + j]
        ax, ay, az = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        out[ROTATION + j] = x + sine * ax + versine * (wy * az - wz * ay)
        out[ROTATION + 3 + j] = y + sine * ay + versine * (wz * ax - wx * az)
        out[ROTATION + 6 + j] = z + sine * az + versine * (wx * ay - wy * ax)
    for i in range(3):
        out[POSITION + i] = state[POSITION + i] + time * state[VELOCITY + i]
        out[VELOCITY + i] = state[VELOCITY + i]
        out[OMEGA + i] = state[OMEGA + i]


@kernel
def elevation(frame: Any, level: Any, x: float, y: float) -> float:
    """Level of the surface at a place, bilinear between cells; 0 outside the block."""
    nx, ny = level.shape
    east, north = (x - frame[0]) / frame[2], (y - frame[1]) / frame[2]
    if not (0.0 <= east < nx - 1 and 0.0 <= north < ny - 1):
        return 0.0
    i, j = int(east), int(north)
    east -= i
    north -= j
    found: float = (1.0 - east) * ((1.0 - north) * level[i, j] + north * level[i, j + 1]) + (
        east * ((1.0 - north) * level[i + 1, j] + north * level[i + 1, j + 1])
    )
    return found


# Over 80 lines: one pass over the faces fills one row of many columns; helpers would pass them all.
@kernel
def find_wet_faces(
    block: Any, vertices: Any, corners: Any, panels: Any, state: Any, frame: Any, level: Any,
    body: int, panel: int, guesses: Any, heights: Any, faces: Any, count: int,
) -> int:  # fmt: skip
    """Append the wet parts of a body's faces; the number of faces then.

    Args:
        block: of the body with its faces split, for its law and its planes.
        vertices: (v, 3), corners: (f, 3) of its faces, none longer than the bumps' radius.
        panels: outward normal (3), centroid (3) and area of each face, (f, 7), body axes.
        state: of the body (18,).
        frame, level: x and y of the block's first cell, spacing, greatest |rate|; level z (nx, ny).
        body: its number; panel: that of its first face among those of all bodies.
        guesses: loads of all faces a step ago [N].
        heights: scratch (v,).
        faces, count: room for all faces, and how many there are.
    """
    z, ux, uy, uz = state[2], state[9], state[10], state[11]
    for v in range(vertices.shape[0]):
        x, y, h = vertices[v, 0], vertices[v, 1], vertices[v, 2]
        heights[v] = z + ux * x + uy * y + uz * h - elevation(
            frame, level,
            state[0] + state[3] * x + state[4] * y + state[5] * h,
            state[1] + state[6] * x + state[7] * y + state[8] * h,
        )  # fmt: skip
    vx, vy, vz = state[12], state[13], state[14]
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    squared = block[hydro.NORMAL_SQUARED]
    linear = block[hydro.SPEED_NORMAL] * speed
    cavity, forward = block[hydro.CAVITY], block[hydro.FORWARD] != 0.0
    bx = state[3] * vx + state[6] * vy + state[9] * vz  # velocity in body axes
    by = state[4] * vx + state[7] * vy + state[10] * vz
    bz = state[5] * vx + state[8] * vy + state[11] * vz
    wx = state[3] * state[15] + state[6] * state[16] + state[9] * state[17]
    wy = state[4] * state[15] + state[7] * state[16] + state[10] * state[17]
    wz = state[5] * state[15] + state[8] * state[16] + state[11] * state[17]
    for k in range(corners.shape[0]):
        a, b, c = corners[k, 0], corners[k, 1], corners[k, 2]
        ha, hb, hc = heights[a], heights[b], heights[c]
        if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
            guesses[panel + k] = 0.0
            continue
        row = panels[k]
        area, x, y, h = row[6], row[3], row[4], row[5]
        if not (ha < 0.0 and hb < 0.0 and hc < 0.0):
            fraction, x, y, h = immersed_part(
                vertices[a, 0], vertices[a, 1], vertices[a, 2], ha,
                vertices[b, 0], vertices[b, 1], vertices[b, 2], hb,
                vertices[c, 0], vertices[c, 1], vertices[c, 2], hc,
            )  # fmt: skip
            area *= fraction
        nx, ny, nz = row[0], row[1], row[2]
        if forward:
            depth = -(z + ux * x + uy * y + uz * h) + elevation(
                frame, level,
                state[0] + state[3] * x + state[4] * y + state[5] * h,
                state[1] + state[6] * x + state[7] * y + state[8] * h,
            )  # fmt: skip
            x, y, h = pressure_centre(block, k, x, y, h, nx, ny, nz, bx, by, bz, ux, uy, uz, depth)
        advance = (
            nx * (bx + wy * h - wz * y) + ny * (by + wz * x - wx * h) + nz * (bz + wx * y - wy * x)
        )
        if advance + frame[3] * abs(ux * nx + uy * ny + uz * nz) <= 0.0:
            guesses[panel + k] = 0.0
            continue  # it recedes faster than the surface moves anywhere
        face = faces[count]
        face[BODY] = body
        rx = state[3] * x + state[4] * y + state[5] * h
        ry = state[6] * x + state[7] * y + state[8] * h
        rz = state[9] * x + state[10] * y + state[11] * h
        tx = state[3] * nx + state[4] * ny + state[5] * nz
        ty = state[6] * nx + state[7] * ny + state[8] * nz
        tz = state[9] * nx + state[10] * ny + state[11] * nz
        face[NORMAL], face[NORMAL + 1], face[NORMAL + 2] = tx, ty, tz
        face[TURN] = ry * tz - rz * ty
        face[TURN + 1] = rz * tx - rx * tz
        face[TURN + 2] = rx * ty - ry * tx
        face[SQUARED], face[LINEAR] = area * squared, area * linear
        face[CAVITY], face[FOUR_U] = area * cavity * speed * speed, 4.0 * speed
        face[CELL_I], face[CELL_J] = state[0] + rx, state[1] + ry  # the place, until it is spread
        face[PANEL], face[LOAD], face[TOTAL] = panel + k, guesses[panel + k], 0.0
        count += 1
    return count


@kernel
def normal_speed(face: Any, state: Any) -> float:
    """n . (V + omega x r)."""
    speed: float = (
        face[NORMAL] * state[VELOCITY]
        + face[NORMAL + 1] * state[VELOCITY + 1]
        + face[NORMAL + 2] * state[VELOCITY + 2]
        + face[TURN] * state[OMEGA]
        + face[TURN + 1] * state[OMEGA + 1]
        + face[TURN + 2] * state[OMEGA + 2]
    )
    return speed


@inlined
def _answer(weights: Any, side: int, scale: float, impulse: Any, answers: Any, wide: int) -> float:
    """Weights (side^2) by a factor, their G S^T (wide^2), and S G S^T."""
    edge, corner, middle = impulse[0, 1], impulse[0, 0], impulse[1, 1]
    for k in range(wide * wide):
        answers[k] = 0.0
    for a in range(side):
        for b in range(side):
            weights[a * side + b] *= scale
            weight = weights[a * side + b]
            if weight == 0.0:
                continue
            along, across = edge * weight, corner * weight
            k = a * wide + b
            answers[k] += across
            answers[k + 1] += along
            answers[k + 2] += across
            k += wide
            answers[k] += along
            answers[k + 1] += middle * weight
            answers[k + 2] += along
            k += wide
            answers[k] += across
            answers[k + 1] += along
            answers[k + 2] += across
    own = 0.0
    for a in range(side):
        for b in range(side):
            own += weights[a * side + b] * answers[(a + 1) * wide + b + 1]
    return own


@kernel
def spread_faces(
    faces: Any, first: int, last: int, side: int, radius: float, states: Any, frame: Any,
    rate: Any, open_cells: Any, impulse: Any, guesses: Any,
) -> int:  # fmt: skip
    """Weights, answers, own response and sampled rate of faces first..last; where they end afterwards.

    Those that recede from the surface at the velocities of `states` are left out, and the others move up.

    S_i: w ~ (1 - r^2 / e^2)^2 on the open cells within e of the load, sum w = 1. A face without such a cell has
    weights 0: it feels still water and moves none.

    Args:
        faces: with their places in CELL_I and CELL_J [m], which become cells.
        side: cells across a bump at most.
        radius: e [m].
        states: of the bodies (n, 18).
        frame, rate, open_cells: of the block of cells.
        impulse: G of a unit on one cell (3, 3) [1/m].
        guesses: loads of all faces a step ago; those of faces that are left out become 0.
    """
    left = first
    d = frame[2]
    reach = radius / d
    wide, per_reach, size = side + 2, 1.0 / (reach * reach), faces.shape[1]
    nx, ny = rate.shape
    rows, rates = as_doubles(address_of(faces)), as_doubles(address_of(rate))
    water = as_doubles(address_of(open_cells))
    for n in range(first, last):
        face = place_of(rows, n * size)
        weights, answers = place_of(face, FACE), place_of(face, FACE + side * side)
        east, north = (face[CELL_I] - frame[0]) / d, (face[CELL_J] - frame[1]) / d
        i0 = min(max(math.ceil(east - reach), 1), nx - side - 1)
        j0 = min(max(math.ceil(north - reach), 1), ny - side - 1)
        face[CELL_I], face[CELL_J] = i0, j0
        total = sampled = 0.0
        for a in range(side):
            row = 1.0 - (i0 + a - east) ** 2 * per_reach
            at, k = (i0 + a) * ny + j0, a * side
            for b in range(side):
                gap = max(row - (j0 + b - north) ** 2 * per_reach, 0.0)
                weight = gap * gap * water[at + b]
                weights[k + b] = weight
                total += weight
                sampled += weight * rates[at + b]
        scale = 1.0 / total if total > 0.0 else 0.0
        face[RATE] = sampled * scale
        if normal_speed(face, states[int(face[BODY])]) - face[NORMAL + 2] * face[RATE] <= 0.0:
            guesses[int(face[PANEL])] = 0.0
            continue
        face[OWN] = _answer(weights, side, scale, impulse, answers, wide)
        if left < n:
            row = place_of(rows, left * size)
            for k in range(size):
                row[k] = face[k]
        left += 1
    return left


@kernel
def solve_faces(
    faces: Any, first: int, last: int, side: int, factor: float, states: Any, bodies: Any,
    kick: float, tolerance: float, most: int, field: Any, turns: Any,
) -> int:  # fmt: skip
    """Loads of faces first..last by Gauss-Seidel, from the guesses in LOAD; the sweeps made, `most` + 1 if that was too few.

    With all other loads known vn = c - M_ii f, and f = s vn^2 + l vn is a quadratic in vn:

        vn = 2 c / (q + sqrt(q^2 + 4 M_ii s c)),   q = 1 + M_ii l

    A law with a cavity is a quadratic too, pi vn^2 + (4 U + M_ii p - pi c) vn = 4 U c with p = pi CAVITY.

    Args:
        faces: spread; LOAD, SPEED and RATE are set.
        side: cells across a bump at most.
        factor: k.
        states: velocities that the loads act on (n, 18).
        bodies: (n, MOBILITY), for `kick` > 0.
        kick: dt / 2 if the bodies are kicked by the loads; 0 if not.
        tolerance: greatest change of a load in the last sweep, as a fraction of the greatest load.
        most: sweeps.
        field: scratch for u, of the surface's shape.
        turns: scratch (n, 6): what the loads have done to the velocities.
    """
    for i in range(field.shape[0]):
        for j in range(field.shape[1]):
            field[i, j] = 0.0
    turns[:] = 0.0
    cells = as_doubles(address_of(field))
    for n in range(first, last):
        face, b = faces[n], int(faces[n, BODY])
        nz = face[NORMAL + 2]
        face[SPEED] = normal_speed(face, states[b]) - nz * face[RATE]  # free
        face[OWN] *= factor * nz * nz
        if face[LOAD] != 0.0:
            _press(face, side, factor * nz * face[LOAD], cells, field.shape[1])
        if kick > 0.0:
            face[OWN] += kick * _mobility(face, bodies[b])
            _kick(face, bodies[b], kick * face[LOAD], turns[b])
    made, converged = 0, False
    while made < most and not converged:
        made += 1
        converged = _sweep(
            faces, first, last, side, factor, bodies, kick, tolerance, True, field, turns
        )
        for _ in range(0 if converged else SWEEPS_AMONG_LOADED):
            made += 1
            if _sweep(faces, first, last, side, factor, bodies, kick, tolerance, False, field, turns):  # fmt: skip
                break
    for n in range(first, last):
        face = faces[n]
        answer = _under(face, side, cells, field.shape[1])
        face[SPEED] -= face[NORMAL + 2] * answer
        face[RATE] += answer
        if kick > 0.0:
            face[SPEED] -= _turned(face, turns[int(face[BODY])])
    return made if converged else most + 1


@kernel
def _sweep(
    faces: Any, first: int, last: int, side: int, factor: float, bodies: Any, kick: float,
    tolerance: float, everywhere: bool, field: Any, turns: Any,
) -> bool:  # fmt: skip
    """One sweep over all faces or over those that are loaded; whether no load changed by more than the tolerance."""
    change = greatest = 0.0
    stride, size = field.shape[1], faces.shape[1]
    cells, rows = as_doubles(address_of(field)), as_doubles(address_of(faces))
    for n in range(first, last):
        face = place_of(rows, n * size)  # indexed as C does: of arrays numba checks every index
        old = face[LOAD]
        if not everywhere and old == 0.0:
            continue
        own, nz = face[OWN], face[NORMAL + 2]
        c = face[SPEED] - nz * _under(face, side, cells, stride) + own * old
        if kick > 0.0:
            c -= _turned(face, turns[int(face[BODY])])
        new = 0.0
        if c > 0.0 and face[CAVITY] > 0.0:
            p, r = math.pi * face[CAVITY], face[FOUR_U]
            q = r + own * p - math.pi * c
            root = math.sqrt(q * q + 4.0 * math.pi * r * c)
            vn = 2.0 * r * c / (q + root) if q > 0.0 else (root - q) / (2.0 * math.pi)
            new = p * vn / (r + math.pi * vn)
        elif c > 0.0:
            s, q = face[SQUARED], 1.0 + own * face[LINEAR]
            vn = 2.0 * c / (q + math.sqrt(q * q + 4.0 * own * s * c))
            new = vn * (s * vn + face[LINEAR])
        if new != old:
            face[LOAD] = new
            _press(face, side, factor * nz * (new - old), cells, stride)
            if kick > 0.0:
                b = int(face[BODY])
                _kick(face, bodies[b], kick * (new - old), turns[b])
            change = max(change, abs(new - old))
        greatest = max(greatest, new)
    still = change > tolerance * greatest
    return not still


@kernel
def reload_faces(faces: Any, first: int, last: int, states: Any) -> None:
    """Loads of solved faces at other velocities of their bodies, the surface's speed as it was solved."""
    for n in range(first, last):
        face = faces[n]
        vn = normal_speed(face, states[int(face[BODY])]) - face[NORMAL + 2] * face[RATE]
        if vn <= 0.0:
            face[LOAD] = 0.0
        elif face[CAVITY] > 0.0:
            face[LOAD] = face[CAVITY] * math.pi * vn / (face[FOUR_U] + math.pi * vn)
        else:
            face[LOAD] = vn * (face[SQUARED] * vn + face[LINEAR])


@kernel
def add_wrenches(faces: Any, first: int, last: int, weight: float, wrenches: Any) -> None:
    """Force and torque about the centre of mass, world axes, added to wrenches (n, 6 or more), and the loads with
    a weight to the total ones."""
    for n in range(first, last):
        face = faces[n]
        load = face[LOAD]
        if load != 0.0:
            face[TOTAL] += weight * load
            out = wrenches[int(face[BODY])]
            for k in range(3):
                out[k] -= load * face[NORMAL + k]
                out[3 + k] -= load * face[TURN + k]


@kernel
def add_reaction(
    faces: Any, first: int, last: int, side: int, factor: float, pressure: Any, reactions: Any
) -> None:
    """factor sum_i S_i^T (-f_i n_iz) on the cells of a block, and -f n_z of each body (n,), by the total loads."""
    for n in range(first, last):
        face = faces[n]
        if face[TOTAL] != 0.0:
            force = -face[TOTAL] * face[NORMAL + 2]
            reactions[int(face[BODY])] += force
            i0, j0 = int(face[CELL_I]), int(face[CELL_J])
            for a in range(side):
                for b in range(side):
                    pressure[i0 + a, j0 + b] += factor * force * face[FACE + a * side + b]


@inlined
def _under(face: Any, side: int, field: Any, stride: int) -> float:
    """S_i of a field."""
    at = int(face[CELL_I]) * stride + int(face[CELL_J])
    total, k = 0.0, FACE
    for _ in range(side):
        row = 0.0  # rows do not wait for each other
        for b in range(side):
            row += face[k + b] * field[at + b]
        total += row
        k += side
        at += stride
    return total


@inlined
def _press(face: Any, side: int, amount: float, field: Any, stride: int) -> None:
    """u += amount G S^T."""
    wide = side + 2
    at = (int(face[CELL_I]) - 1) * stride + int(face[CELL_J]) - 1
    k = FACE + side * side
    for _ in range(wide):
        for b in range(wide):
            field[at + b] += amount * face[k + b]
        k += wide
        at += stride


@kernel
def _mobility(face: Any, body: Any) -> float:
    """1 / m + (r x n) . I^-1 (r x n)."""
    total: float = body[INVERSE_MASS]
    for i in range(3):
        for j in range(3):
            total += face[TURN + i] * body[INVERSE_INERTIA + 3 * i + j] * face[TURN + j]
    return total


@kernel
def _kick(face: Any, body: Any, impulse: float, turn: Any) -> None:
    """What a load along -n takes from the velocities of its body."""
    for i in range(3):
        turn[i] += impulse * body[INVERSE_MASS] * face[NORMAL + i]
        for j in range(3):
            turn[3 + i] += impulse * body[INVERSE_INERTIA + 3 * i + j] * face[TURN + j]


@kernel
def _turned(face: Any, turn: Any) -> float:
    """n . (v + omega x r) of that."""
    total = 0.0
    for i in range(3):
        total += face[NORMAL + i] * turn[i] + face[TURN + i] * turn[3 + i]
    return total
