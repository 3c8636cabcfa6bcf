"""Loads on many pieces of faces at once: a force law, friction, skin friction; sums in vector registers.

The pieces lie in columns (`_block`): normal, centroid and arm at `faces`, a column every `stride` numbers; their
wet areas are apart. Forces (3) and torques (3) are added to `sums`, body axes.
"""

import math
from typing import Any

from mjskip._compile.jit import inlined, vector_kernel
from mjskip._compile.vector import log10, select
from mjskip.hydro._block import (
    FACES,
    FRICTION,
    HEADER,
    HEIGHT,
    LENGTH,
    LOCAL_GATE,
    NORMAL_SQUARED,
    OMEGA,
    RISE,
    RISING,
    SKIN_DENSITY,
    SPEED_NORMAL,
    SPEED_SQUARED,
    STRIDE,
    UP,
    VELOCITY,
    VISCOSITY,
    WEIGHT_DENSITY,
)


@inlined
def add_law(
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int, waves: bool, sums: Any
) -> None:
    """The load of the law: against the normal, and along the face where it has friction."""
    if count > 0:
        _add_normal(block, motion, faces, stride, areas, count, waves, sums)
        if block[FRICTION] != 0.0:
            _add_friction(block, motion, faces, stride, areas, count, waves, sums)


@inlined
def add_skin_friction(
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int, waves: bool, sums: Any
) -> None:
    """Skin friction on every immersed face, if the water rubs."""
    if count > 0 and block[SKIN_DENSITY] != 0.0:
        _add_skin_friction(block, motion, faces, stride, areas, count, waves, sums)


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
    """F = -S (a (V.n)^2 + b U (V.n) + c U^2) n with V.n = V_c.n + omega.(r x n), r x n kept as ARM."""
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
        mx, my, mz = faces[k + 6 * stride], faces[k + 7 * stride], faces[k + 8 * stride]
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
        mx, my, mz = faces[k + 6 * stride], faces[k + 7 * stride], faces[k + 8 * stride]
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
    block: Any, motion: Any, faces: Any, stride: int, areas: Any, count: int, waves: bool, sums: Any
) -> None:
    """Skin friction on every immersed face, V_t the velocity there along it (ITTC 1957).

    F = -1/2 rho C_f |V_t| V_t S,  C_f = 0.075 / (log10 Re - 2)^2,  Re = |V_t| L / nu, at least 1000
    """
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    ux, uy, uz, rising = motion[UP], motion[UP + 1], motion[UP + 2], motion[RISING]
    rate = block[LENGTH] / block[VISCOSITY]
    fx = fy = fz = tx = ty = tz = 0.0
    for k in range(count):
        nx, ny, nz = faces[k], faces[k + stride], faces[k + 2 * stride]
        rx, ry, rz = faces[k + 3 * stride], faces[k + 4 * stride], faces[k + 5 * stride]
        sx, sy, sz = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx
        if waves:
            more = faces[k + RISE * stride] - rising
            sx, sy, sz = sx - more * ux, sy - more * uy, sz - more * uz
        across = sx * nx + sy * ny + sz * nz
        sx, sy, sz = sx - across * nx, sy - across * ny, sz - across * nz
        along = math.sqrt(sx * sx + sy * sy + sz * sz)
        reynolds = along * rate
        decades = log10(select(reynolds > 1e3, reynolds, 1e3)) - 2.0
        drag = areas[k] * along / (decades * decades)
        fx += drag * sx
        fy += drag * sy
        fz += drag * sz
        tx += drag * (ry * sz - rz * sy)
        ty += drag * (rz * sx - rx * sz)
        tz += drag * (rx * sy - ry * sx)
    add_sums(sums, -0.5 * 0.075 * block[SKIN_DENSITY], fx, fy, fz, tx, ty, tz)


@vector_kernel
def add_buoyancy(block: Any, motion: Any, first: int, count: int, areas: Any, sums: Any) -> None:
    """dF = rho g h n dS on faces quite under water, h their height above it; exact for force and torque.

    The columns of water on a closed body add up to the water it displaces.
    """
    n = int(block[STRIDE])
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    fx = fy = fz = tx = ty = tz = 0.0
    for i in range(count):
        k = HEADER + first + i
        ax, ay, az = block[k], block[k + n], block[k + 2 * n]
        bx, by, bz = block[k + 3 * n], block[k + 4 * n], block[k + 5 * n]
        cx, cy, cz = block[k + 6 * n], block[k + 7 * n], block[k + 8 * n]
        k += FACES * n
        nx, ny, nz = block[k], block[k + n], block[k + 2 * n]
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        hc = z + ux * cx + uy * cy + uz * cz
        total = ha + hb + hc
        mx = areas[i] * ((ax + bx + cx) * total + ax * ha + bx * hb + cx * hc)
        my = areas[i] * ((ay + by + cy) * total + ay * ha + by * hb + cy * hc)
        mz = areas[i] * ((az + bz + cz) * total + az * ha + bz * hb + cz * hc)
        load = 4.0 * areas[i] * total
        fx += load * nx
        fy += load * ny
        fz += load * nz
        tx += my * nz - mz * ny
        ty += mz * nx - mx * nz
        tz += mx * ny - my * nx
    add_sums(sums, block[WEIGHT_DENSITY] / 12.0, fx, fy, fz, tx, ty, tz)
