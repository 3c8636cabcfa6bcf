"""Loads on many pieces of faces at once: a force law, friction, skin friction; sums in vector registers.

The pieces lie in columns (`_block`): normal and centroid at `faces`, a column every `stride` numbers; their
wet areas are apart. Forces (3) and torques (3) are added to `sums`, body axes.
"""

import math
from typing import Any

from mjskip._compile.jit import inlined, vector_kernel
from mjskip._compile.vector import log10, select
from mjskip.hydro._block import (
    FRICTION,
    LENGTH,
    LOCAL_GATE,
    NORMAL_SQUARED,
    OMEGA,
    RISE,
    RISING,
    SKIN_DENSITY,
    SPEED_NORMAL,
    SPEED_SQUARED,
    UP,
    VELOCITY,
    VISCOSITY,
)


@inlined
def add_loads(
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int,
    law: bool, waves: bool, sums: Any,
) -> None:  # fmt: skip
    """The loads of all pieces: of the law if it is wanted, and skin friction if the water rubs."""
    if count == 0:
        return
    if block[SKIN_DENSITY] != 0.0:
        _add_skin_friction(block, motion, faces, stride, areas, count, law, waves, sums)
    elif law:
        _add_normal(block, motion, faces, stride, areas, count, waves, sums)
    if law and block[FRICTION] != 0.0:
        _add_friction(block, motion, faces, stride, areas, count, waves, sums)


@inlined
def add_sums(
    sums: Any, factor: float, fx: float, fy: float, fz: float, tx: float, ty: float, tz: float
) -> None:
    """Add force and torque, times a factor."""
    sums[0] += factor * fx
    sums[1] += factor * fy
    sums[2] += factor * fz
    sums[3] += factor * tx
    sums[4] += factor * ty
    sums[5] += factor * tz


@vector_kernel
def _add_normal(
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int, waves: bool, sums: Any
) -> None:
    """F = -S (a (V.n)^2 + b U (V.n) + c U^2) n, V = V_c + omega x r."""
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    ux, uy, uz, rising = motion[UP], motion[UP + 1], motion[UP + 2], motion[RISING]
    local = block[LOCAL_GATE] != 0.0
    speed2 = vx * vx + vy * vy + vz * vz
    squared, linear = block[NORMAL_SQUARED], block[SPEED_NORMAL] * math.sqrt(speed2)
    constant = block[SPEED_SQUARED] * speed2
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(count):
        nx, ny, nz = faces[k], faces[k + stride], faces[k + 2 * stride]
        rx, ry, rz = faces[k + 3 * stride], faces[k + 4 * stride], faces[k + 5 * stride]
        mx, my, mz = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
        vn_centre = vx * nx + vy * ny + vz * nz
        vn = vn_centre + wx * mx + wy * my + wz * mz
        if waves:
            vn -= (faces[k + RISE * stride] - rising) * (ux * nx + uy * ny + uz * nz)
        load = areas[k] * (squared * vn * vn + linear * vn + constant)
        load = select(areas[k] > 0.0, load, 0.0)  # what is dry stays so where the bracket overflows
        # the gate: a face that advances itself, or one turned to the motion of the centre
        load = select(vn > 0.0, load, 0.0) if local else select(vn_centre >= 0.0, load, 0.0)
        fx += load * nx
        fy += load * ny
        fz += load * nz
        tx += load * mx
        ty += load * my
        tz += load * mz
    add_sums(sums, -1.0, fx, fy, fz, tx, ty, tz)


@vector_kernel
def _add_friction(
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int, waves: bool, sums: Any
) -> None:
    """F = -S d U^2 t on loaded faces, t the direction of the centre's motion along the face."""
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    ux, uy, uz, rising = motion[UP], motion[UP + 1], motion[UP + 2], motion[RISING]
    local = block[LOCAL_GATE] != 0.0
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(count):
        nx, ny, nz = faces[k], faces[k + stride], faces[k + 2 * stride]
        rx, ry, rz = faces[k + 3 * stride], faces[k + 4 * stride], faces[k + 5 * stride]
        mx, my, mz = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
        vn_centre = vx * nx + vy * ny + vz * nz
        vn = vn_centre + wx * mx + wy * my + wz * mz
        if waves:
            vn -= (faces[k + RISE * stride] - rising) * (ux * nx + uy * ny + uz * nz)
        sx, sy, sz = vx - vn_centre * nx, vy - vn_centre * ny, vz - vn_centre * nz
        along = math.sqrt(sx * sx + sy * sy + sz * sz)
        drag = select(along > 0.0, areas[k] / along, 0.0)
        drag = select(vn > 0.0, drag, 0.0) if local else select(vn_centre >= 0.0, drag, 0.0)
        fx += drag * sx
        fy += drag * sy
        fz += drag * sz
        tx += drag * (ry * sz - rz * sy)
        ty += drag * (rz * sx - rx * sz)
        tz += drag * (rx * sy - ry * sx)
    pull = -block[FRICTION] * (vx * vx + vy * vy + vz * vz)
    add_sums(sums, pull, fx, fy, fz, tx, ty, tz)


@vector_kernel
def _add_skin_friction(
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int,
    law: bool, waves: bool, sums: Any,
) -> None:  # fmt: skip
    """Skin friction on every immersed face, V_t the velocity there along it (ITTC 1957), and the law's load.

    F = -1/2 rho C_f |V_t| V_t S,  C_f = 0.075 / (log10 Re - 2)^2,  Re = |V_t| L / nu, at least 1000

    Both in one pass: what they share, the velocity of the face, is half of what the law costs. See `_add_normal`.
    """
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    ux, uy, uz, rising = motion[UP], motion[UP + 1], motion[UP + 2], motion[RISING]
    local = block[LOCAL_GATE] != 0.0
    speed2 = vx * vx + vy * vy + vz * vz
    share = 1.0 if law else 0.0
    squared = share * block[NORMAL_SQUARED]
    linear = share * block[SPEED_NORMAL] * math.sqrt(speed2)
    constant = share * block[SPEED_SQUARED] * speed2
    rubbing = 0.5 * 0.075 * block[SKIN_DENSITY]
    rate = block[LENGTH] / block[VISCOSITY]
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(count):
        nx, ny, nz = faces[k], faces[k + stride], faces[k + 2 * stride]
        rx, ry, rz = faces[k + 3 * stride], faces[k + 4 * stride], faces[k + 5 * stride]
        sx, sy, sz = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx
        if waves:
            more = faces[k + RISE * stride] - rising
            sx, sy, sz = sx - more * ux, sy - more * uy, sz - more * uz
        vn = sx * nx + sy * ny + sz * nz
        sx, sy, sz = sx - vn * nx, sy - vn * ny, sz - vn * nz
        along = math.sqrt(sx * sx + sy * sy + sz * sz)
        reynolds = along * rate
        decades = log10(select(reynolds > 1e3, reynolds, 1e3)) - 2.0
        drag = rubbing * areas[k] * along / (decades * decades)
        load = areas[k] * (squared * vn * vn + linear * vn + constant)
        load = select(areas[k] > 0.0, load, 0.0)
        turned = vn if local else vx * nx + vy * ny + vz * nz
        load = select(turned > 0.0, load, 0.0) if local else select(turned >= 0.0, load, 0.0)
        px, py, pz = load * nx + drag * sx, load * ny + drag * sy, load * nz + drag * sz
        fx += px
        fy += py
        fz += pz
        tx += ry * pz - rz * py
        ty += rz * px - rx * pz
        tz += rx * py - ry * px
    add_sums(sums, -1.0, fx, fy, fz, tx, ty, tz)
