"""Water and air on one rigid body: equations (1)-(4) of Lee & Baek (2010).

A body is a *block* of doubles: a header (the constants below) and then, for every triangle, corners
(9), outward unit normal (3) and area (1) in body axes about the centre of mass. A *state* is centre of
mass (3), rotation body to world row by row (9), velocity (3) and angular velocity (3) in the world.
Everything is worked out in body axes, where the mesh is constant and still water is a tilted plane, and
the sums are turned to the world once.

Right-handed frame: V = V_c + omega x r and torque = r x F (the paper's left-handed omega and torque
are both turned round).

The surface is still water at z = 0, or a *patch* of doubles: x and y of its first point, points per metre,
points along x and y, greatest |elevation|, then elevations and then vertical speeds (x first), bilinear.
Outside the patch the water is still. The address of a body's patch is in its block's header.
"""

import math
from typing import Any

import numba
import numpy as np

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, bits
from mjskip.hydro.columns import WRENCH

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
SURFACE = 15  # address of the patch around the body, as the bits of a double; 0: still water
WEIGHT_DENSITY = 16  # rho g if the water bears [N/m^3], or 0
SKIN_DENSITY = 17  # rho if the water rubs, or 0
VISCOSITY = 18  # kinematic [m^2/s]
LENGTH = 19  # of the body along the flow, for its Reynolds number [m]
FORWARD = 20  # 1: the load of a face acts ahead of the middle of its wet part, by Rayleigh
HEADER = 21

CORNERS = 0
NORMAL = 9
AREA = 12
ROW = 13  # doubles for one triangle

PATCH_X = 0
PATCH_Y = 1
PATCH_RATE = 2
PATCH_NX = 3
PATCH_NY = 4
PATCH_HIGHEST = 5
PATCH_POINTS = 6


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
        ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc = bx, by, bz, hb, cx, cy, cz, hc, ax, ay, az, ha  # fmt: skip
    elif (hc < 0.0) == (below == 1):
        ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc = cx, cy, cz, hc, ax, ay, az, ha, bx, by, bz, hb  # fmt: skip
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
def _patch_of(block: Any) -> Any:
    """The patch of surface around a body; empty if the water is still."""
    address = bits(block[SURFACE])
    if address == 0:
        return numba.carray(as_doubles(address), 0)
    head = numba.carray(as_doubles(address), PATCH_POINTS)
    size = PATCH_POINTS + 2 * int(head[PATCH_NX]) * int(head[PATCH_NY])
    return numba.carray(as_doubles(address), size)


@kernel
def _surface(patch: Any, state: Any, x: float, y: float, z: float, speed: int) -> float:
    """Elevation (speed 0) or vertical speed (1) of the surface at a point of the body, body axes."""
    nx, ny = int(patch[PATCH_NX]), int(patch[PATCH_NY])
    east = (state[0] + state[3] * x + state[4] * y + state[5] * z - patch[PATCH_X]) * patch[
        PATCH_RATE
    ]
    north = (state[1] + state[6] * x + state[7] * y + state[8] * z - patch[PATCH_Y]) * patch[
        PATCH_RATE
    ]
    if not (0.0 <= east < nx - 1 and 0.0 <= north < ny - 1):
        return 0.0
    i, j = int(east), int(north)
    east -= i
    north -= j
    k = PATCH_POINTS + speed * nx * ny + i * ny + j
    found: float = (1.0 - east) * ((1.0 - north) * patch[k] + north * patch[k + 1]) + east * (
        (1.0 - north) * patch[k + ny] + north * patch[k + ny + 1]
    )
    return found


@kernel
def _pressure_centre(
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
    (`_pressure_centre`). V is taken against the water, which
    moves up and down with its surface; U and the gate of the paper take the surface under the centre of mass.
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
    patch = _patch_of(block)
    waves = patch.size > 0
    highest = patch[PATCH_HIGHEST] if waves else 0.0
    # a position that is not finite must reach the sums: only a body surely dry is skipped
    if not z > block[RADIUS] + highest:
        rising = _surface(patch, state, 0.0, 0.0, 0.0, 1) if waves else 0.0
        vx, vy, vz = vx - rising * ux, vy - rising * uy, vz - rising * uz
        local = block[LOCAL_GATE] != 0.0
        squared, mixed = block[NORMAL_SQUARED], block[SPEED_NORMAL]
        plain, friction = block[SPEED_SQUARED], block[FRICTION]
        speed2 = vx * vx + vy * vy + vz * vz
        speed = math.sqrt(speed2)
        forward = block[FORWARD] != 0.0
        third = 1.0 / 3.0
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
            if waves:
                ha -= _surface(patch, state, ax, ay, az, 0)
                hb -= _surface(patch, state, bx, by, bz, 0)
                hc -= _surface(patch, state, cx, cy, cz, 0)
            if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
                continue
            if ha < 0.0 and hb < 0.0 and hc < 0.0:  # the most frequent case
                fraction = 1.0
                rx, ry, rz = (ax + bx + cx) * third, (ay + by + cy) * third, (az + bz + cz) * third
            else:
                fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
            if forward:
                depth = -(z + ux * rx + uy * ry + uz * rz)
                if waves:
                    depth += _surface(patch, state, rx, ry, rz, 0)
                rx, ry, rz = _pressure_centre(
                    rx, ry, rz, nx, ny, nz, vx, vy, vz, ux, uy, uz, depth, block[RADIUS]
                )
            vn = (
                vn_centre
                + (wy * rz - wz * ry) * nx
                + (wz * rx - wx * rz) * ny
                + (wx * ry - wy * rx) * nz
            )
            if waves:
                vn -= (_surface(patch, state, rx, ry, rz, 1) - rising) * (
                    ux * nx + uy * ny + uz * nz
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
        if block[WEIGHT_DENSITY] != 0.0 or block[SKIN_DENSITY] != 0.0:
            gx, gy, gz, mx, my, mz = _at_rest_too(
                block, state, patch, vx, vy, vz, wx, wy, wz, rising
            )
            fx, fy, fz, tx, ty, tz = fx + gx, fy + gy, fz + gz, tx + mx, ty + my, tz + mz
    _to_world(state, fx, fy, fz, out, 0)
    _to_world(state, tx, ty, tz, out, 3)


@kernel
def _at_rest_too(
    block: Any, state: Any, patch: Any,
    vx: float, vy: float, vz: float, wx: float, wy: float, wz: float, rising: float,
) -> tuple[float, float, float, float, float, float]:  # fmt: skip
    """Buoyancy and skin friction on every immersed face: force and torque in body axes.

        dF = rho g h n dS          h the height above the surface, negative below: p = -rho g h
        F  = -1/2 rho C_f |V_t| V_t S,  C_f = 0.075 / (log10 Re - 2)^2  (ITTC 1957), Re = |V_t| L / nu

    The pressure is integrated exactly over the immersed polygon, force and torque: the columns of water
    on a closed body add up to the water it displaces. Re is taken as at least 1000.
    """
    ux, uy, uz, z = state[9], state[10], state[11], state[2]
    weight, skin = block[WEIGHT_DENSITY], block[SKIN_DENSITY]
    reynolds_rate = block[LENGTH] / block[VISCOSITY] if skin != 0.0 else 0.0
    waves = patch.size > 0
    fx = fy = fz = tx = ty = tz = 0.0
    for i in range(int(block[N_TRIANGLES])):
        k = HEADER + i * ROW
        ax, ay, az = block[k], block[k + 1], block[k + 2]
        bx, by, bz = block[k + 3], block[k + 4], block[k + 5]
        cx, cy, cz = block[k + 6], block[k + 7], block[k + 8]
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        hc = z + ux * cx + uy * cy + uz * cz
        if waves:
            ha -= _surface(patch, state, ax, ay, az, 0)
            hb -= _surface(patch, state, bx, by, bz, 0)
            hc -= _surface(patch, state, cx, cy, cz, 0)
        if ha >= 0.0 and hb >= 0.0 and hc >= 0.0:
            continue
        nx, ny, nz = block[k + NORMAL], block[k + NORMAL + 1], block[k + NORMAL + 2]
        if weight != 0.0:
            column, mx, my, mz = _column(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
            load = weight * block[k + AREA]
            fx += load * column * nx
            fy += load * column * ny
            fz += load * column * nz
            tx += load * (my * nz - mz * ny)
            ty += load * (mz * nx - mx * nz)
            tz += load * (mx * ny - my * nx)
        if skin != 0.0:
            fraction, rx, ry, rz = immersed_part(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
            sx, sy, sz = vx + wy * rz - wz * ry, vy + wz * rx - wx * rz, vz + wx * ry - wy * rx
            if waves:
                more = _surface(patch, state, rx, ry, rz, 1) - rising
                sx, sy, sz = sx - more * ux, sy - more * uy, sz - more * uz
            across = sx * nx + sy * ny + sz * nz
            sx, sy, sz = sx - across * nx, sy - across * ny, sz - across * nz
            along = math.sqrt(sx * sx + sy * sy + sz * sz)
            coefficient = 0.075 / (math.log10(max(along * reynolds_rate, 1e3)) - 2.0) ** 2
            drag = -0.5 * skin * coefficient * along * fraction * block[k + AREA]
            fx += drag * sx
            fy += drag * sy
            fz += drag * sz
            tx += drag * (ry * sz - rz * sy)
            ty += drag * (rz * sx - rx * sz)
            tz += drag * (rx * sy - ry * sx)
    return fx, fy, fz, tx, ty, tz


@kernel
def _linear_column(
    ax: float, ay: float, az: float, ha: float,
    bx: float, by: float, bz: float, hb: float,
    cx: float, cy: float, cz: float, hc: float, area: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Integrals of h and of r h over a triangle of this area on which h is linear."""
    total = ha + hb + hc
    twelfth = area / 12.0
    return (
        area / 3.0 * total,
        twelfth * ((ax + bx + cx) * total + ax * ha + bx * hb + cx * hc),
        twelfth * ((ay + by + cy) * total + ay * ha + by * hb + cy * hc),
        twelfth * ((az + bz + cz) * total + az * ha + bz * hb + cz * hc),
    )


@kernel
def _column(
    ax: float, ay: float, az: float, ha: float,
    bx: float, by: float, bz: float, hb: float,
    cx: float, cy: float, cz: float, hc: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Integrals of h and of r h over the immersed part of a triangle of unit area; see `immersed_part`."""
    below = int(ha < 0.0) + int(hb < 0.0) + int(hc < 0.0)
    if below == 3:
        return _linear_column(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc, 1.0)
    if (hb < 0.0) == (below == 1):
        ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc = bx, by, bz, hb, cx, cy, cz, hc, ax, ay, az, ha  # fmt: skip
    elif (hc < 0.0) == (below == 1):
        ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc = cx, cy, cz, hc, ax, ay, az, ha, bx, by, bz, hb  # fmt: skip
    # p on ca and q on ab, where the surface cuts
    u = hc / (hc - ha)
    w = hb / (hb - ha)
    px, py, pz = cx + u * (ax - cx), cy + u * (ay - cy), cz + u * (az - cz)
    qx, qy, qz = bx + w * (ax - bx), by + w * (ay - by), bz + w * (az - bz)
    if below == 1:
        return _linear_column(
            ax, ay, az, ha, qx, qy, qz, 0.0, px, py, pz, 0.0, (1.0 - u) * (1.0 - w)
        )  # fmt: skip
    h1, x1, y1, z1 = _linear_column(bx, by, bz, hb, cx, cy, cz, hc, px, py, pz, 0.0, u)
    h2, x2, y2, z2 = _linear_column(bx, by, bz, hb, px, py, pz, 0.0, qx, qy, qz, 0.0, (1.0 - u) * w)
    return h1 + h2, x1 + x2, y1 + y2, z1 + z2


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
    patch = _patch_of(block)
    waves = patch.size > 0
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
        if waves:
            ha -= _surface(patch, state, ax, ay, az, 0)
            hb -= _surface(patch, state, bx, by, bz, 0)
            hc -= _surface(patch, state, cx, cy, cz, 0)
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
def wrench_and_immersion(block: Any, states: Any, out: Any) -> None:
    """Wrench (12) and immersion (5) of every row of states (n, 18) into out (n, 17)."""
    for i in range(states.shape[0]):
        body_wrench(block, states[i], out[i, :WRENCH])
        body_immersion(block, states[i], out[i, WRENCH:])


def _entry(block: Any, state: Any, out: Any) -> None:
    """`body_wrench` as C: void(double*, double*, double*).

    Pointers are indexed as they are; of arrays numba checks every index for being negative.
    """
    body_wrench(block, state, out)


def _immersion_entry(block: Any, state: Any, out: Any) -> None:
    """`body_immersion` as C: void(double*, double*, double*)."""
    body_immersion(block, state, out)
