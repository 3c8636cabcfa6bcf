"""Water and air on one rigid body: equations (1)-(4) of Lee & Baek (2010).

A body is a *block* of doubles: a header (the constants below) and then, for every triangle, corners
(9), outward unit normal (3) and area (1) in body axes about the centre of mass. A *state* is centre of
mass (3), rotation body to world row by row (9), velocity (3) and angular velocity (3) in the world.
Everything is worked out in body axes, where the mesh is constant and still water is a tilted plane, and
the sums are turned to the world once.

Right-handed frame: V = V_c + omega x r and torque = r x F (the paper's left-handed omega and torque
are both turned round).
"""

import math
from typing import Any

import numba
import numpy as np

from mjskip._jit import kernel

# header of a block
N_TRIANGLES = 0
RADIUS = 1  # of the sphere about the centre of mass that holds the body [m]
LOCAL_GATE = 2  # 1: faces that advance themselves, 0: faces turned to the motion of the centre
NORMAL_SQUARED = 3  # rho times the law's coefficients [kg/m^3]
SPEED_NORMAL = 4
SPEED_SQUARED = 5
FRICTION = 6
AIR_DENSITY = 7
DISC_AREA = 8
DISC_NORMAL = 9
DISC_CENTRE = 12
HEADER = 15

CORNERS = 0
NORMAL = 9
AREA = 12
ROW = 13  # doubles for one triangle

STATE = 18
WRENCH = 12  # water force, water torque, air force, air torque
IMMERSION = 5  # area, its centroid, height of the lowest point


@kernel
def immersed_part(
    ax: float, ay: float, az: float, ha: float,
    bx: float, by: float, bz: float, hb: float,
    cx: float, cy: float, cz: float, hc: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Fraction of a triangle's area that lies below the surface, and the centroid of that part.

    Args:
        ax: first corner, and so on.
        ha: its height above the surface, negative below; heights vary linearly over the triangle.

    The immersed polygon is a triangle or a quadrangle. A quadrangle is taken as two triangles with
    positive weights, so that nothing cancels however thin it is.
    """
    below = int(ha < 0.0) + int(hb < 0.0) + int(hc < 0.0)
    third = 1.0 / 3.0
    if below == 3:
        return 1.0, (ax + bx + cx) * third, (ay + by + cy) * third, (az + bz + cz) * third
    if below == 0:
        return 0.0, 0.0, 0.0, 0.0
    # turn the triangle so that the odd corner (the only wet or the only dry one) is a
    if (hb < 0.0) == (below == 1):
        ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc = (
            bx,
            by,
            bz,
            hb,
            cx,
            cy,
            cz,
            hc,
            ax,
            ay,
            az,
            ha,
        )
    elif (hc < 0.0) == (below == 1):
        ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc = (
            cx,
            cy,
            cz,
            hc,
            ax,
            ay,
            az,
            ha,
            bx,
            by,
            bz,
            hb,
        )
    if below == 1:  # a wet: the triangle a, a + s (b - a), a + t (c - a)
        s = ha / (ha - hb)
        t = ha / (ha - hc)
        return (
            s * t,
            ax + (s * (bx - ax) + t * (cx - ax)) * third,
            ay + (s * (by - ay) + t * (cy - ay)) * third,
            az + (s * (bz - az) + t * (cz - az)) * third,
        )
    # a dry: the quadrangle b, c, p on ca, q on ab; split along b-p
    u = hc / (hc - ha)
    w = hb / (hb - ha)
    px, py, pz = cx + u * (ax - cx), cy + u * (ay - cy), cz + u * (az - cz)
    qx, qy, qz = bx + w * (ax - bx), by + w * (ay - by), bz + w * (az - bz)
    first = u  # area of b, c, p
    second = (1.0 - u) * w  # area of b, p, q
    total = first + second
    first *= third / total
    second *= third / total
    return (
        total,
        first * (bx + cx + px) + second * (bx + px + qx),
        first * (by + cy + py) + second * (by + py + qy),
        first * (bz + cz + pz) + second * (bz + pz + qz),
    )


@kernel
def body_wrench(block: Any, state: Any, out: Any) -> None:
    """Force and torque of water and air about the centre of mass, world frame, into out (12,).

        F_i = -S_im [ (a (V.n)^2 + b U (V.n) + c U^2) n + d U^2 t ],  tau_i = r_i x F_i
        F_air = -rho_air (V.n) |V.n| S_disc n,  tau_air = r x F_air

    r_i runs to the centroid of the immersed part of triangle i. Still water at z = 0.
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
    vn = (
        (vx + wy * rz - wz * ry) * nx
        + (vy + wz * rx - wx * rz) * ny
        + (vz + wx * ry - wy * rx) * nz
    )
    load = -block[AIR_DENSITY] * block[DISC_AREA] * vn * abs(vn)
    _to_world(state, load * nx, load * ny, load * nz, out, 6)
    _to_world(
        state,
        load * (ry * nz - rz * ny),
        load * (rz * nx - rx * nz),
        load * (rx * ny - ry * nx),
        out,
        9,
    )

    # water, on the mesh
    fx = fy = fz = tx = ty = tz = 0.0
    z = state[2]
    # a position that is not finite must reach the sums: only a body surely dry is skipped
    if not z > block[RADIUS]:
        local = block[LOCAL_GATE] != 0.0
        squared, mixed = block[NORMAL_SQUARED], block[SPEED_NORMAL]
        plain, friction = block[SPEED_SQUARED], block[FRICTION]
        speed2 = vx * vx + vy * vy + vz * vz
        speed = math.sqrt(speed2)
        for i in range(int(block[N_TRIANGLES])):
            k = HEADER + i * ROW
            nx, ny, nz = block[k + NORMAL], block[k + NORMAL + 1], block[k + NORMAL + 2]
            vn_centre = vx * nx + vy * ny + vz * nz
            if not local and vn_centre < 0.0:
                continue
            ax, ay, az = block[k], block[k + 1], block[k + 2]
            bx, by, bz = block[k + 3], block[k + 4], block[k + 5]
            cx, cy, cz = block[k + 6], block[k + 7], block[k + 8]
            ha = z + ux * ax + uy * ay + uz * az
            hb = z + ux * bx + uy * by + uz * bz
            hc = z + ux * cx + uy * cy + uz * cz
            if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
                continue
            fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
            vn = (
                vn_centre
                + (wy * rz - wz * ry) * nx
                + (wz * rx - wx * rz) * ny
                + (wx * ry - wy * rx) * nz
            )
            if local and vn <= 0.0:
                continue
            area = fraction * block[k + AREA]
            load = -area * (squared * vn * vn + mixed * speed * vn + plain * speed2)
            gx, gy, gz = load * nx, load * ny, load * nz
            if friction != 0.0:
                # speed2 t, t the direction of the centre's motion along the face
                sx, sy, sz = vx - vn_centre * nx, vy - vn_centre * ny, vz - vn_centre * nz
                along = math.sqrt(sx * sx + sy * sy + sz * sz)
                if along > 0.0:
                    drag = -area * friction * speed2 / along
                    gx += drag * sx
                    gy += drag * sy
                    gz += drag * sz
            fx += gx
            fy += gy
            fz += gz
            tx += ry * gz - rz * gy
            ty += rz * gx - rx * gz
            tz += rx * gy - ry * gx
    _to_world(state, fx, fy, fz, out, 0)
    _to_world(state, tx, ty, tz, out, 3)


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
    total = mx = my = mz = 0.0
    lowest = np.inf
    for i in range(int(block[N_TRIANGLES])):
        k = HEADER + i * ROW
        ax, ay, az = block[k], block[k + 1], block[k + 2]
        bx, by, bz = block[k + 3], block[k + 4], block[k + 5]
        cx, cy, cz = block[k + 6], block[k + 7], block[k + 8]
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        hc = z + ux * cx + uy * cy + uz * cz
        lowest = min(lowest, ha, hb, hc)
        if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
            continue
        fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
        area = fraction * block[k + AREA]
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
def observe(block: Any, states: Any, out: Any) -> None:
    """Wrench (12) and immersion (5) of every row of states (n, 18) into out (n, 17)."""
    for i in range(states.shape[0]):
        body_wrench(block, states[i], out[i, :WRENCH])
        body_immersion(block, states[i], out[i, WRENCH:])


def _entry(block: Any, state: Any, out: Any) -> None:
    """`body_wrench` as C: void(double*, double*, double*)."""
    size = HEADER + int(block[N_TRIANGLES]) * ROW
    body_wrench(numba.carray(block, size), numba.carray(state, STATE), numba.carray(out, WRENCH))


def _immersion_entry(block: Any, state: Any, out: Any) -> None:
    """`body_immersion` as C: void(double*, double*, double*)."""
    size = HEADER + int(block[N_TRIANGLES]) * ROW
    body_immersion(numba.carray(block, size), numba.carray(state, STATE), numba.carray(out, IMMERSION))
