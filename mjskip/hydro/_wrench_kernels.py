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

from typing import Any

import numpy as np

from mjskip._compile.jit import inlined, kernel
from mjskip._compile.pointers import (
    address_of,
    as_doubles,
    call_address,
    place_of,
    stack_doubles,
)
from mjskip.hydro._block import (
    ABOUT_GROUP,
    AIR_DENSITY,
    AREA,
    BOX,
    COLUMNS,
    DISC_AREA,
    DISC_CENTRE,
    DISC_NORMAL,
    FACES,
    FORWARD,
    GROUP,
    HEADER,
    HEIGHT,
    LIFT,
    MIDDLE,
    MOTION,
    N_FACES,
    OMEGA,
    PATCH_HIGHEST,
    PIECE,
    QUADRATURE,
    RISING,
    SKIN_DENSITY,
    STRIDE,
    UP,
    VELOCITY,
    VOLUME,
    VOLUME_CENTRE,
    WEIGHT_DENSITY,
    WIDTH,
)
from mjskip.hydro._box_kernels import highest_of, lowest_of
from mjskip.hydro._clip_kernels import immersed_part
from mjskip.hydro._integral_kernels import add_integrals
from mjskip.hydro._load_kernels import add_loads, add_sums
from mjskip.hydro._patch_kernels import patch_of, surface_at
from mjskip.hydro._piece_kernels import (
    CUT,
    CUTS,
    PIECES,
    RUN,
    add_whole,
    collect,
    collect_in_waves,
    cut_faces,
)
from mjskip.hydro._strip_kernels import add_strips
from mjskip.hydro.columns import WRENCH


@kernel
def body_wrench(block: Any, state: Any, out: Any) -> None:
    """Force and torque of water and air about the centre of mass, world frame, into out (12,).

        F_i = -S_im [ (a (V.n)^2 + b U (V.n) + c U^2) n + d U^2 t ],  tau_i = r_i x F_i
        F_air = -rho_air (V.n) |V.n| S_disc n,  tau_air = r x F_air

    r_i runs to the centroid of the immersed part of triangle i; with `quadrature` the load is integrated over it
    (`_integral_kernels`), and a `forward` law takes plane faces as strips (`_strip_kernels`). V is taken against
    the water, which moves up and down with its surface; U and the gate of the paper take the surface under the
    centre of mass.
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
    motion = as_doubles(stack_doubles(MOTION))
    motion[HEIGHT] = state[2]
    motion[UP], motion[UP + 1], motion[UP + 2] = ux, uy, uz
    # a height that is not finite must reach the sums: only a body surely dry is skipped
    if not lowest_of(motion, place_of(block, MIDDLE)) > highest:
        rising = surface_at(patch, state, 0.0, 0.0, 0.0, 1) if patch.size > 0 else 0.0
        motion[RISING] = rising
        motion[VELOCITY], motion[VELOCITY + 1] = vx - rising * ux, vy - rising * uy
        motion[VELOCITY + 2] = vz - rising * uz
        motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2] = wx, wy, wz
        if block[FORWARD] != 0.0:
            add_strips(block, state, motion, patch, sums)
        elif block[QUADRATURE] != 0.0:
            add_integrals(block, state, motion, patch, sums)
        if not _integrated(block) or block[WEIGHT_DENSITY] + block[SKIN_DENSITY] != 0.0:
            _add_faces(block, state, motion, patch, sums)
        # no comparison holds for not-a-number, so that no face would be loaded
        sums[0] += 0.0 * (state[2] + ux + uy + uz + vx + vy + vz + wx + wy + wz)
    _to_world(state, sums[0], sums[1], sums[2], out, 0)
    _to_world(state, sums[3], sums[4], sums[5], out, 3)


@inlined
def _integrated(block: Any) -> bool:
    """Whether the law's load is integrated over faces, not taken at the centroids of triangles."""
    found: bool = block[FORWARD] + block[QUADRATURE] != 0.0
    return found


@kernel
def _add_faces(block: Any, state: Any, motion: Any, patch: Any, sums: Any) -> None:
    """Count the loads that are summed over faces: what is wet is gathered, a run of groups at a time."""
    n = int(block[STRIDE])
    law = not _integrated(block)
    if patch.size == 0 and highest_of(motion, place_of(block, MIDDLE)) < 0.0:
        faces, areas = place_of(block, HEADER + FACES * n), place_of(block, HEADER + AREA * n)
        add_loads(block, motion, faces, n, areas, n, law, False, sums)
        # Archimedes: rho g V upwards through the centroid of the volume
        cx, cy, cz = block[VOLUME_CENTRE], block[VOLUME_CENTRE + 1], block[VOLUME_CENTRE + 2]
        ux, uy, uz = motion[UP], motion[UP + 1], motion[UP + 2]
        add_sums(
            sums, block[WEIGHT_DENSITY] * block[VOLUME],
            ux, uy, uz, cy * uz - cz * uy, cz * ux - cx * uz, cx * uy - cy * ux,
        )  # fmt: skip
        return
    weight = block[WEIGHT_DENSITY]
    highest = patch[PATCH_HIGHEST] if patch.size > 0 else 0.0
    groups = (n + GROUP - 1) // GROUP
    pieces = as_doubles(stack_doubles((PIECE + 1) * PIECES))
    cuts = as_doubles(stack_doubles(CUT * CUTS))
    found = many = group = 0
    while group < groups:
        side = _side_of(block, motion, highest, group)
        begin = group
        group += 1
        if side == ABOVE:
            continue
        if side == ACROSS or patch.size > 0:
            group = _run_end(block, motion, highest, group, min(groups, begin + RUN // GROUP))
        first = begin * GROUP
        count = min(group * GROUP, n) - first
        if patch.size > 0:
            found = collect_in_waves(
                block, state, motion, patch, first, count, weight, pieces, found, sums
            )
        elif side == BELOW:
            for face in range(first, first + count, WIDTH):
                found = add_whole(block, face, pieces, found)
            if weight != 0.0:
                _add_lift(block, motion, begin, weight, sums)
        else:
            found, many = collect(
                block, motion, first, count, weight, pieces, found, cuts, many, sums
            )
        # eight faces may fill eight places of whole ones and be cut but for one of them as well
        if found + many + 2 * RUN > PIECES - WIDTH or many + RUN > CUTS - WIDTH:
            cut_faces(motion, weight, cuts, many, place_of(pieces, found), sums)
            _add_pieces(block, motion, patch, pieces, found + many, sums)
            found = many = 0
    if found + many > 0:
        cut_faces(motion, weight, cuts, many, place_of(pieces, found), sums)
        _add_pieces(block, motion, patch, pieces, found + many, sums)


ABOVE, ACROSS, BELOW = 1, 0, -1


@inlined
def _about(block: Any, group: int) -> Any:
    """What is known of a group of faces."""
    return place_of(block, HEADER + COLUMNS * int(block[STRIDE]) + ABOUT_GROUP * group)


@inlined
def _side_of(block: Any, motion: Any, highest: float, group: int) -> int:
    """Whether all faces of a group are surely above the surface, surely below it, or neither."""
    box = place_of(_about(block, group), BOX)
    if lowest_of(motion, box) > highest:
        return ABOVE
    return BELOW if highest_of(motion, box) < -highest else ACROSS


GAP = 3
"""Groups that the surface does not cross, which are looked at with those before and behind them."""


@kernel
def _run_end(block: Any, motion: Any, highest: float, group: int, last: int) -> int:
    """Where groups that the surface crosses end that begin before a group, gaps among them."""
    end = group
    while group < last and group < end + GAP:
        if _side_of(block, motion, highest, group) == ACROSS:
            end = group + 1
        group += 1
    return end


@inlined
def _add_lift(block: Any, motion: Any, group: int, weight: float, sums: Any) -> None:
    """Buoyancy of a group that is quite under still water: linear in its height and in the upward vertical."""
    known = place_of(_about(block, group), LIFT)
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    for i in range(6):
        k = 4 * i
        lift = known[k] * z + known[k + 1] * ux + known[k + 2] * uy + known[k + 3] * uz
        sums[i] += weight * lift


@kernel
def _add_pieces(block: Any, motion: Any, patch: Any, pieces: Any, count: int, sums: Any) -> None:
    """Count the loads of the wet pieces; the columns are filled up to whole vectors."""
    filled = count
    while filled % WIDTH != 0:
        for k in range(PIECE + 1):
            pieces[k * PIECES + filled] = 0.0
        filled += 1
    add_loads(
        block, motion, pieces, PIECES, place_of(pieces, PIECE * PIECES), filled,
        not _integrated(block), patch.size > 0, sums,
    )  # fmt: skip


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
