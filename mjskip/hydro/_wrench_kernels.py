"""Water and air on one rigid body: equations (1)-(4) of Lee & Baek (2010).

A body is a *block* of doubles (`_block`). A *state* is centre of mass (3), rotation body to world row by row
(9), velocity (3) and angular velocity (3) in the world. Everything is worked out in body axes, where the mesh
is constant and still water is a tilted plane, and the sums are turned to the world once.

Right-handed frame: V = V_c + omega x r and torque = r x F (the paper's left-handed omega and torque
are both turned round).

The surface is still water at z = 0, or a *patch* (`_patch_kernels`) whose address is in the block's header.
Over still water the faces that are quite under it are loaded straight from the block; those that the surface
cuts are few, and their wet pieces are put into columns of their own.
"""

import math
from typing import Any

import numpy as np

from mjskip._compile.jit import inlined, kernel, vector_kernel
from mjskip._compile.pointers import (
    address_of,
    as_doubles,
    as_words,
    call_address,
    place_of,
    stack_doubles,
)
from mjskip._compile.vector import select
from mjskip.hydro._block import (
    AIR_DENSITY,
    AREA,
    ARM,
    CENTROID,
    COLUMNS,
    DISC_AREA,
    DISC_CENTRE,
    DISC_NORMAL,
    FACES,
    FORWARD,
    GROUP,
    HEADER,
    HEIGHT,
    LOCAL_GATE,
    MOTION,
    N_FACES,
    NORMAL,
    OMEGA,
    PATCH_HIGHEST,
    PIECE,
    RADIUS,
    RISE,
    RISING,
    SKIN_DENSITY,
    SPHERE,
    STRIDE,
    UP,
    VELOCITY,
    VOLUME,
    VOLUME_CENTRE,
    WEIGHT_DENSITY,
    WIDTH,
)
from mjskip.hydro._clip_kernels import column, immersed_part
from mjskip.hydro._load_kernels import add_buoyancy, add_law, add_skin_friction, add_sums
from mjskip.hydro._patch_kernels import patch_of, surface_at
from mjskip.hydro.columns import WRENCH

RUN = 256
"""Faces that are looked at together: groups on the same side of the surface."""

PIECES = 520
"""Room for wet pieces; columns a multiple of 4096 bytes apart would share their places in the cache."""


@kernel
def pressure_centre(
    rx: float, ry: float, rz: float, nx: float, ny: float, nz: float,
    vx: float, vy: float, vz: float, ux: float, uy: float, uz: float,
    depth: float, radius: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Where the load of a piece of a face acts when the flow of water along the face is counted.

        x / l = 3/4 cos(theta) / (4 + pi sin(theta))

    ahead of the middle of a plate of length l at an angle theta to a stream that leaves a cavity behind it:
    Rayleigh, Phil. Mag. (5) 2:430 (1876); Lamb, Hydrodynamics, art. 77. The wet face is taken as such plates
    side by side, strips along the motion. A strip begins where the face leaves the water, or at the front of
    the body (the sphere that holds it). A piece whose centroid lies s behind that is moved by 2 s x / l: s
    is l / 2 on average over a strip, so the strip's load acts where it should however it is cut.
    """
    vn = vx * nx + vy * ny + vz * nz
    sx, sy, sz = vx - vn * nx, vy - vn * ny, vz - vn * nz
    along = math.sqrt(sx * sx + sy * sy + sz * sz)
    if along == 0.0:
        return rx, ry, rz
    sx, sy, sz = sx / along, sy / along, sz / along
    ahead = rx * sx + ry * sy + rz * sz
    room = radius * radius - (rx * rx + ry * ry + rz * rz) + ahead * ahead
    way = max(math.sqrt(max(room, 0.0)) - ahead, 0.0)
    rise = sx * ux + sy * uy + sz * uz
    if rise * way > depth:
        way = depth / rise
    way *= 1.5 * along / (4.0 * math.sqrt(along * along + vn * vn) + math.pi * abs(vn))
    return rx + way * sx, ry + way * sy, rz + way * sz


@kernel
def body_wrench(block: Any, state: Any, out: Any) -> None:
    """Force and torque of water and air about the centre of mass, world frame, into out (12,).

        F_i = -S_im [ (a (V.n)^2 + b U (V.n) + c U^2) n + d U^2 t ],  tau_i = r_i x F_i
        F_air = -rho_air (V.n) |V.n| S_disc n,  tau_air = r x F_air

    r_i runs to the centroid of the immersed part of triangle i, or to the pressure centre of its strips
    (`pressure_centre`). V is taken against the water, which moves up and down with its surface; U and the
    gate of the paper take the surface under the centre of mass.
    """
    # velocity, angular velocity and the upward vertical in body axes
    ux, uy, uz = state[9], state[10], state[11]
    vx = state[3] * state[12] + state[6] * state[13] + ux * state[14]
    vy = state[4] * state[12] + state[7] * state[13] + uy * state[14]
    vz = state[5] * state[12] + state[8] * state[13] + uz * state[14]
    wx = state[3] * state[15] + state[6] * state[16] + ux * state[17]
    wy = state[4] * state[15] + state[7] * state[16] + uy * state[17]
    wz = state[5] * state[15] + state[8] * state[16] + uz * state[17]

    # air, on the disc
    nx, ny, nz = block[DISC_NORMAL], block[DISC_NORMAL + 1], block[DISC_NORMAL + 2]
    rx, ry, rz = block[DISC_CENTRE], block[DISC_CENTRE + 1], block[DISC_CENTRE + 2]
    mx, my, mz = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
    vn = vx * nx + vy * ny + vz * nz + wx * mx + wy * my + wz * mz
    load = -block[AIR_DENSITY] * block[DISC_AREA] * vn * abs(vn)
    _to_world(state, load * nx, load * ny, load * nz, out, 6)
    _to_world(state, load * mx, load * my, load * mz, out, 9)

    # water, on the mesh
    sums = as_doubles(stack_doubles(6))
    for j in range(6):
        sums[j] = 0.0
    patch = patch_of(block)
    highest = patch[PATCH_HIGHEST] if patch.size > 0 else 0.0
    # a height that is not finite must reach the sums: only a body surely dry is skipped
    if not state[2] > block[RADIUS] + highest:
        rising = surface_at(patch, state, 0.0, 0.0, 0.0, 1) if patch.size > 0 else 0.0
        motion = as_doubles(stack_doubles(MOTION))
        motion[HEIGHT], motion[RISING] = state[2], rising
        motion[UP], motion[UP + 1], motion[UP + 2] = ux, uy, uz
        motion[VELOCITY], motion[VELOCITY + 1] = vx - rising * ux, vy - rising * uy
        motion[VELOCITY + 2] = vz - rising * uz
        motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2] = wx, wy, wz
        _add_water(block, state, motion, patch, sums)
        # no comparison holds for not-a-number, so that no face would be loaded
        sums[0] += 0.0 * (state[2] + ux + uy + uz + vx + vy + vz + wx + wy + wz)
    _to_world(state, sums[0], sums[1], sums[2], out, 0)
    _to_world(state, sums[3], sums[4], sums[5], out, 3)


@kernel
def _add_water(block: Any, state: Any, motion: Any, patch: Any, sums: Any) -> None:
    """Count the loads of the water on all faces, a run of groups at a time."""
    n = int(block[STRIDE])
    groups = (n + GROUP - 1) // GROUP
    highest = patch[PATCH_HIGHEST] if patch.size > 0 else 0.0
    sunk = patch.size == 0 and motion[HEIGHT] < -block[RADIUS]
    weight = 0.0 if sunk else block[WEIGHT_DENSITY]
    whole = place_of(block, HEADER + AREA * n)
    areas = as_doubles(stack_doubles(RUN))
    below = as_doubles(stack_doubles(RUN))
    pieces = as_doubles(stack_doubles((PIECE + 1) * PIECES))
    found = 0
    group = 0
    while group < groups:
        first = group * GROUP
        side = _side_of(block, motion, highest, group)
        group += 1
        while group < groups and (group + 1) * GROUP - first <= RUN:
            if _side_of(block, motion, highest, group) != side:
                break
            group += 1
        count = min(group * GROUP, n) - first
        if side == ABOVE:
            continue
        if patch.size > 0 or block[FORWARD] != 0.0:
            for i in range(count):
                below[i] = 1.0  # a piece of every wet face
        elif side == BELOW:
            _add_whole_faces(block, motion, first, count, place_of(whole, first), weight, sums)
            continue
        else:
            _find_whole_faces(block, motion, first, count, weight, below, areas)
            _add_whole_faces(block, motion, first, count, areas, weight, sums)
        found = _cut_faces(
            block, state, motion, patch, first, count, weight, below, pieces, found, sums
        )
        if found > PIECES - RUN - WIDTH:
            _add_pieces(block, state, motion, patch, pieces, found, sums)
            found = 0
    if found > 0:
        _add_pieces(block, state, motion, patch, pieces, found, sums)
    if sunk:
        # Archimedes: rho g V upwards through the centroid of the volume
        cx, cy, cz = block[VOLUME_CENTRE], block[VOLUME_CENTRE + 1], block[VOLUME_CENTRE + 2]
        ux, uy, uz = motion[UP], motion[UP + 1], motion[UP + 2]
        add_sums(
            sums, block[WEIGHT_DENSITY] * block[VOLUME],
            ux, uy, uz, cy * uz - cz * uy, cz * ux - cx * uz, cx * uy - cy * ux,
        )  # fmt: skip


ABOVE, ACROSS, BELOW = 1, 0, -1


@inlined
def _side_of(block: Any, motion: Any, highest: float, group: int) -> int:
    """Whether all faces of a group are surely above the surface, surely below it, or neither."""
    k = HEADER + COLUMNS * int(block[STRIDE]) + SPHERE * group
    h = motion[HEIGHT] + motion[UP] * block[k] + motion[UP + 1] * block[k + 1]
    h += motion[UP + 2] * block[k + 2]
    reach = block[k + 3] + highest
    return ABOVE if h > reach else BELOW if h < -reach else ACROSS


@kernel
def _add_whole_faces(
    block: Any, motion: Any, first: int, count: int, areas: Any, weight: float, sums: Any
) -> None:
    """Count the loads of faces that are quite under still water, straight from the block."""
    n = int(block[STRIDE])
    faces = place_of(block, HEADER + FACES * n + first)
    add_law(block, motion, faces, n, areas, count, False, sums)
    add_skin_friction(block, motion, faces, n, areas, count, False, sums)
    if weight != 0.0:
        add_buoyancy(block, motion, first, count, areas, sums)


@vector_kernel
def _find_whole_faces(
    block: Any, motion: Any, first: int, count: int, weight: float, below: Any, areas: Any
) -> None:
    """The area of a face that is quite under water, else 0; how many corners are if it must be cut.

    Heights are h = z + u.r. A face that the paper's gate leaves without load need not be cut for a law alone.
    """
    n = int(block[STRIDE])
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    every = block[LOCAL_GATE] != 0.0 or weight != 0.0 or block[SKIN_DENSITY] != 0.0
    least = -np.inf if every else 0.0
    for i in range(count):
        k = HEADER + first + i
        ha = z + ux * block[k] + uy * block[k + n] + uz * block[k + 2 * n]
        hb = z + ux * block[k + 3 * n] + uy * block[k + 4 * n] + uz * block[k + 5 * n]
        hc = z + ux * block[k + 6 * n] + uy * block[k + 7 * n] + uz * block[k + 8 * n]
        corners = select(ha < 0.0, 1.0, 0.0) + select(hb < 0.0, 1.0, 0.0)
        corners += select(hc < 0.0, 1.0, 0.0)
        areas[i] = select(corners == 3.0, block[k + AREA * n], 0.0)
        k += FACES * n
        vn = vx * block[k] + vy * block[k + n] + vz * block[k + 2 * n]
        corners = select(vn >= least, corners, 0.0)
        below[i] = select(corners == 3.0, 0.0, corners)


@kernel
def _cut_faces(
    block: Any, state: Any, motion: Any, patch: Any, first: int, count: int, weight: float,
    below: Any, pieces: Any, found: int, sums: Any,
) -> int:  # fmt: skip
    """Append the wet pieces of faces whose `below` is not zero to the columns; how many there are now.

    Their buoyancy, pressure -rho g h integrated exactly over the immersed polygon, is added to the sums.
    """
    n = int(block[STRIDE])
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    waves = patch.size > 0
    chosen = as_words(stack_doubles(RUN))
    many = 0
    for i in range(count):  # without a branch
        chosen[many] = HEADER + first + i
        many += int(below[i] != 0.0)
    fx = fy = fz = tx = ty = tz = 0.0
    for i in range(many):
        k = chosen[i]
        ax, ay, az = block[k], block[k + n], block[k + 2 * n]
        bx, by, bz = block[k + 3 * n], block[k + 4 * n], block[k + 5 * n]
        cx, cy, cz = block[k + 6 * n], block[k + 7 * n], block[k + 8 * n]
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        hc = z + ux * cx + uy * cy + uz * cz
        if waves:
            ha -= surface_at(patch, state, ax, ay, az, 0)
            hb -= surface_at(patch, state, bx, by, bz, 0)
            hc -= surface_at(patch, state, cx, cy, cz, 0)
        fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
        if fraction == 0.0:
            continue
        whole = block[k + AREA * n]
        k += FACES * n
        nx, ny, nz = block[k], block[k + n], block[k + 2 * n]
        pieces[found + PIECE * PIECES] = fraction * whole
        _put(pieces, found + NORMAL * PIECES, nx, ny, nz)
        _put(pieces, found + CENTROID * PIECES, rx, ry, rz)
        _put(pieces, found + ARM * PIECES, ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx)
        if waves:
            pieces[found + RISE * PIECES] = surface_at(patch, state, rx, ry, rz, 1)
        found += 1
        if weight != 0.0:
            height, mx, my, mz = column(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
            height *= whole
            fx += height * nx
            fy += height * ny
            fz += height * nz
            tx += whole * (my * nz - mz * ny)
            ty += whole * (mz * nx - mx * nz)
            tz += whole * (mx * ny - my * nx)
    add_sums(sums, weight, fx, fy, fz, tx, ty, tz)
    return found


@inlined
def _put(pieces: Any, k: int, x: float, y: float, z: float) -> None:
    """Write a vector of a piece."""
    pieces[k], pieces[k + PIECES], pieces[k + 2 * PIECES] = x, y, z


@kernel
def _add_pieces(
    block: Any, state: Any, motion: Any, patch: Any, pieces: Any, count: int, sums: Any
) -> None:
    """Count the loads of the wet pieces; the columns are filled up to whole vectors."""
    waves = patch.size > 0
    areas = place_of(pieces, PIECE * PIECES)
    filled = count
    while filled % WIDTH != 0:
        for k in range(PIECE + 1):
            pieces[k * PIECES + filled] = 0.0
        filled += 1
    add_skin_friction(block, motion, pieces, PIECES, areas, filled, waves, sums)
    if block[FORWARD] != 0.0:
        _move_ahead(block, state, motion, patch, pieces, count)
    add_law(block, motion, pieces, PIECES, areas, filled, waves, sums)


@kernel
def _move_ahead(block: Any, state: Any, motion: Any, patch: Any, pieces: Any, count: int) -> None:
    """Move the points where the loads of pieces act from their centroids to the pressure centres."""
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    for k in range(count):
        nx, ny, nz = pieces[k], pieces[k + PIECES], pieces[k + 2 * PIECES]
        rx, ry, rz = pieces[k + 3 * PIECES], pieces[k + 4 * PIECES], pieces[k + 5 * PIECES]
        depth = -(z + ux * rx + uy * ry + uz * rz)
        if patch.size > 0:
            depth += surface_at(patch, state, rx, ry, rz, 0)
        rx, ry, rz = pressure_centre(
            rx, ry, rz, nx, ny, nz, vx, vy, vz, ux, uy, uz, depth, block[RADIUS]
        )
        _put(pieces, k + ARM * PIECES, ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx)
        _put(pieces, k + CENTROID * PIECES, rx, ry, rz)
        if patch.size > 0:
            pieces[k + RISE * PIECES] = surface_at(patch, state, rx, ry, rz, 1)


@kernel
def _to_world(state: Any, x: float, y: float, z: float, out: Any, at: int) -> None:
    out[at] = state[3] * x + state[4] * y + state[5] * z
    out[at + 1] = state[6] * x + state[7] * y + state[8] * z
    out[at + 2] = state[9] * x + state[10] * y + state[11] * z


@kernel
def body_immersion(block: Any, state: Any, out: Any) -> None:
    """Immersed area, world position of its centroid, and height of the lowest point, into out (5,).

    Of the whole surface, loaded or not. The centroid of a dry body is its centre of mass.
    """
    ux, uy, uz, z = state[9], state[10], state[11], state[2]
    n = int(block[STRIDE])
    patch = patch_of(block)
    waves = patch.size > 0
    total = mx = my = mz = 0.0
    lowest = np.inf
    for i in range(int(block[N_FACES])):
        k = HEADER + i
        ax, ay, az = block[k], block[k + n], block[k + 2 * n]
        bx, by, bz = block[k + 3 * n], block[k + 4 * n], block[k + 5 * n]
        cx, cy, cz = block[k + 6 * n], block[k + 7 * n], block[k + 8 * n]
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        hc = z + ux * cx + uy * cy + uz * cz
        if waves:
            ha -= surface_at(patch, state, ax, ay, az, 0)
            hb -= surface_at(patch, state, bx, by, bz, 0)
            hc -= surface_at(patch, state, cx, cy, cz, 0)
        lowest = min(lowest, ha, hb, hc)
        if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
            continue
        fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
        area = fraction * block[k + AREA * n]
        total += area
        mx += area * rx
        my += area * ry
        mz += area * rz
    if total > 0.0:
        mx, my, mz = mx / total, my / total, mz / total
    out[0] = total
    _to_world(state, mx, my, mz, out, 1)
    out[1] += state[0]
    out[2] += state[1]
    out[3] += state[2]
    out[4] = lowest


@kernel
def wrench_and_immersion(wrench: int, immersion: int, block: Any, states: Any, out: Any) -> None:
    """Wrench (12) and immersion (5) of every row of states (n, 18) into out (n, 17), by address."""
    for i in range(states.shape[0]):
        state, row = address_of(states[i]), address_of(out[i])
        call_address(wrench, address_of(block), state, row)
        call_address(immersion, address_of(block), state, row + 8 * WRENCH)


def _entry(block: Any, state: Any, out: Any) -> None:
    """`body_wrench` as C: void(double*, double*, double*).

    Pointers are indexed as they are; of arrays numba checks every index for being negative.
    """
    body_wrench(block, state, out)


def _immersion_entry(block: Any, state: Any, out: Any) -> None:
    """`body_immersion` as C: void(double*, double*, double*)."""
    body_immersion(block, state, out)
