"""Loads that act ahead of the middle of the wet strips of a plane face: Rayleigh's pressure centre.

    x / l = 3/4 cos(theta) / (4 + pi sin(theta))

ahead of the middle of a plate of length l at an angle theta to a stream that leaves a cavity behind it: Rayleigh,
Phil. Mag. (5) 2:430 (1876); Lamb, Hydrodynamics, art. 77. The wet part of a plane face (all its triangles, whatever
they are) is taken as such plates side by side, strips along the motion, each from where the face or the water ends
to where it begins again. The load of a strip is spread evenly over its front part of length (1 - 2 x / l) l, whose
middle lies there, and so it always acts on the face; V is taken where it acts. Strips are gathered between the
places across the motion at which an edge begins or ends: trapezoids, over which the load is integrated exactly.

The plane faces of a body lie behind its spheres, one after the other: normal (3), distance from the centre of
mass, number of edges, and for every edge of the outline its two ends (6).
"""

import math
from typing import Any

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, as_words, place_of, stack_doubles
from mjskip.hydro._block import (
    ADDED_MASS,
    DISC_NORMAL,
    EDGE,
    EDGES,
    GRAVITY,
    HEADER,
    HEIGHT,
    INERTIA,
    INVERSE_INERTIA,
    INVERSE_MASS,
    LOCAL_GATE,
    MAX_EDGES,
    MOTION,
    N_PLANES,
    OMEGA,
    OUTLINE,
    PLANE,
    PLANES,
    RISING,
    STRIDE,
    UP,
    VELOCITY,
)
from mjskip.hydro._integral_kernels import (
    INTEGRALS,
    LOAD,
    LOAD_X,
    LOAD_Y,
    LOADED,
    LOADED_X,
    LOADED_Y,
    MAX_POINTS,
    POINT,
    add_face_loads,
    add_polygon,
)
from mjskip.hydro._patch_kernels import surface_at

SEGMENT = 4  # of the outline of a wet face: y and x of its lower end, y and x of its upper end


@kernel
def pressure_shift(vn: float, speed: float) -> float:
    """x / l for a face whose plane is met by the motion at sin(theta) = |vn| / speed."""
    if speed == 0.0:
        return 0.0
    sine = min(abs(vn) / speed, 1.0)
    return 0.75 * math.sqrt(1.0 - sine * sine) / (4.0 + math.pi * sine)


@kernel
def add_strips(block: Any, state: Any, motion: Any, patch: Any, sums: Any) -> None:
    """Count the loads of the law on all plane faces."""
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    ux, uy, uz = motion[UP], motion[UP + 1], motion[UP + 2]
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    most = int(block[MAX_EDGES])
    segments = as_doubles(stack_doubles(SEGMENT * 2 * most))
    crossings = as_doubles(stack_doubles(3 * most))
    active = as_words(stack_doubles(2 * most))
    found = as_doubles(stack_doubles(INTEGRALS))
    then, later = as_doubles(stack_doubles(INTEGRALS)), as_doubles(stack_doubles(MOTION))
    at = int(block[PLANES])
    for _ in range(int(block[N_PLANES])):
        plane = place_of(block, at)
        edges = int(plane[EDGES])
        at += OUTLINE + EDGE * edges
        nx, ny, nz, distance = plane[0], plane[1], plane[2], plane[3]
        vn = vx * nx + vy * ny + vz * nz
        if block[LOCAL_GATE] == 0.0 and vn < 0.0:
            continue
        # axes of the face: t along the motion, or any where there is none along it; s = n x t
        tx, ty, tz = vx - vn * nx, vy - vn * ny, vz - vn * nz
        along = math.sqrt(tx * tx + ty * ty + tz * tz)
        if along <= 1e-12 * speed or along == 0.0:
            tx, ty, tz = ny - nz, nz - nx, nx - ny
            if tx * tx + ty * ty + tz * tz < 0.1:
                tx, ty, tz = ny, -nx, 0.0
            along = math.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / along, ty / along, tz / along
        sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        wet = _wet_outline(
            block, state, motion, patch, plane, tx, ty, tz, sx, sy, sz, segments, crossings
        )
        if wet < 2:
            continue
        # normal speed: vn + gx x + gy y
        mx, my, mz = ny * wz - nz * wy, nz * wx - nx * wz, nx * wy - ny * wx
        gx, gy = tx * mx + ty * my + tz * mz, sx * mx + sy * my + sz * mz
        front = 1.0 - 2.0 * pressure_shift(vn, speed)
        if patch.size > 0:
            x, y = 0.5 * (segments[1] + segments[3]), 0.5 * (segments[0] + segments[2])
            more = surface_at(
                patch, state, x * tx + y * sx + distance * nx, x * ty + y * sy + distance * ny,
                x * tz + y * sz + distance * nz, 1,
            ) - motion[RISING]  # fmt: skip
            vn -= more * (ux * nx + uy * ny + uz * nz)
        for j in range(INTEGRALS):
            found[j] = 0.0
        _add_slabs(block, speed, segments, wet, active, front, vn, gx, gy, found)
        if block[ADDED_MASS] != 0.0:
            mass = plate_mass(block[ADDED_MASS], segments, wet, found[LOADED])
            _advance(block, motion, later)
            wet = _wet_outline(
                block, state, later, patch, plane, tx, ty, tz, sx, sy, sz, segments, crossings
            )
            for j in range(INTEGRALS):
                then[j] = 0.0
            if wet >= 2:
                _add_slabs(block, speed, segments, wet, active, front, vn, gx, gy, then)
            rate = (plate_mass(block[ADDED_MASS], segments, wet, then[LOADED]) - mass) / MOMENT
            _count_added_mass(
                block, motion, mass, max(rate, 0.0), vn, gx, gy,
                nx, ny, nz, tx, ty, tz, distance, found,
            )  # fmt: skip
        add_face_loads(block, motion, found, nx, ny, nz, tx, ty, tz, distance, sums)


MOMENT = 1e-6
"""Over which the growth of a wet plate is taken [s]."""


@kernel
def plate_mass(density: float, segments: Any, count: int, area: float) -> float:
    """Added mass of the wet part of a plane face: half of what Pabst measured on plates under water.

        m_a = rho pi / 8 l^2 b (1 + lam^2)^(-1/2) (1 - 0.425 lam / (1 + lam^2)),   lam = l / b

    l is its extent along the motion, b its area over l.
    """
    if count == 0 or area <= 0.0:
        return 0.0
    low, high = math.inf, -math.inf
    for i in range(count):
        low = min(low, segments[SEGMENT * i + 1], segments[SEGMENT * i + 3])
        high = max(high, segments[SEGMENT * i + 1], segments[SEGMENT * i + 3])
    length = high - low
    if length <= 0.0:
        return 0.0
    lam = length * length / area
    square = 1.0 + lam * lam
    shape = (1.0 - 0.425 * lam / square) / math.sqrt(square)
    return float(density * math.pi / 8.0 * length * area * shape)


@kernel
def _advance(block: Any, motion: Any, later: Any) -> None:
    """The heights of a body's points a MOMENT later: h = z + u.r grows by u.v + (u x omega).r.

    Without the spin about the axis of the disc: where a round body's rim meets the water it does not grow wetter
    by spinning, though its facets do.
    """
    for j in range(MOTION):
        later[j] = motion[j]
    ux, uy, uz = motion[UP], motion[UP + 1], motion[UP + 2]
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    nx, ny, nz = block[DISC_NORMAL], block[DISC_NORMAL + 1], block[DISC_NORMAL + 2]
    spin = wx * nx + wy * ny + wz * nz
    wx, wy, wz = wx - spin * nx, wy - spin * ny, wz - spin * nz
    later[HEIGHT] += MOMENT * (ux * vx + uy * vy + uz * vz)
    later[UP] += MOMENT * (uy * wz - uz * wy)
    later[UP + 1] += MOMENT * (uz * wx - ux * wz)
    later[UP + 2] += MOMENT * (ux * wy - uy * wx)


@kernel
def _times(block: Any, matrix: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """A matrix (9) of the header times a vector."""
    return (
        block[matrix] * x + block[matrix + 1] * y + block[matrix + 2] * z,
        block[matrix + 3] * x + block[matrix + 4] * y + block[matrix + 5] * z,
        block[matrix + 6] * x + block[matrix + 7] * y + block[matrix + 8] * z,
    )


@kernel
def _count_added_mass(
    block: Any, motion: Any, mass: float, rate: float, vn: float, gx: float, gy: float,
    nx: float, ny: float, nz: float, tx: float, ty: float, tz: float, distance: float, found: Any,
) -> None:  # fmt: skip
    """Turn the load Q of a face into that of a face which takes water with it.

        N = [Q + V.n (dm_a/dt)+ + m_a a_0] / (1 + m_a Y) >= 0,   Y = 1/m + (r x n) I^-1 (r x n)

    a_0 is the acceleration along n of the body's point r where the load acts, if there were no load: gravity
    and its own rotation. Y is the mobility of a body that is free.
    """
    load = found[LOAD]
    if found[LOADED] <= 0.0:
        return
    x, y = found[LOADED_X] / found[LOADED], found[LOADED_Y] / found[LOADED]
    if load > 0.0:
        x, y = found[LOAD_X] / load, found[LOAD_Y] / load
    sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    rx = x * tx + y * sx + distance * nx
    ry = x * ty + y * sy + distance * ny
    rz = x * tz + y * sz + distance * nz
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    # without load: I alpha = (I omega) x omega
    lx, ly, lz = _times(block, INERTIA, wx, wy, wz)
    ax, ay, az = _times(
        block, INVERSE_INERTIA, ly * wz - lz * wy, lz * wx - lx * wz, lx * wy - ly * wx
    )
    mx, my, mz = ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx
    along = wx * rx + wy * ry + wz * rz
    turning = along * (wx * nx + wy * ny + wz * nz) - (wx * wx + wy * wy + wz * wz) * (
        rx * nx + ry * ny + rz * nz
    )
    free = ax * mx + ay * my + az * mz + turning
    free -= block[GRAVITY] * (motion[UP] * nx + motion[UP + 1] * ny + motion[UP + 2] * nz)
    ix, iy, iz = _times(block, INVERSE_INERTIA, mx, my, mz)
    mobility = block[INVERSE_MASS] + mx * ix + my * iy + mz * iz
    advance = vn + gx * x + gy * y
    new = max((load + advance * rate + mass * free) / (1.0 + mass * mobility), 0.0)
    found[LOAD], found[LOAD_X], found[LOAD_Y] = new, new * x, new * y


@kernel
def _wet_outline(
    block: Any, state: Any, motion: Any, patch: Any, plane: Any,
    tx: float, ty: float, tz: float, sx: float, sy: float, sz: float,
    segments: Any, crossings: Any,
) -> int:  # fmt: skip
    """Outline of the part of a plane face that is under water, as segments; how many there are."""
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    waves = patch.size > 0
    found = crossed = 0
    # along the waterline: across the slope of the face
    lx, ly = -(ux * sx + uy * sy + uz * sz), ux * tx + uy * ty + uz * tz
    for i in range(int(plane[EDGES])):
        k = OUTLINE + EDGE * i
        ax, ay, az, bx, by, bz = (
            plane[k], plane[k + 1], plane[k + 2], plane[k + 3], plane[k + 4], plane[k + 5]
        )  # fmt: skip
        ha = z + ux * ax + uy * ay + uz * az
        hb = z + ux * bx + uy * by + uz * bz
        if waves:
            ha -= surface_at(patch, state, ax, ay, az, 0)
            hb -= surface_at(patch, state, bx, by, bz, 0)
        if ha >= 0.0 and hb >= 0.0:
            continue
        x0, y0 = ax * tx + ay * ty + az * tz, ax * sx + ay * sy + az * sz
        x1, y1 = bx * tx + by * ty + bz * tz, bx * sx + by * sy + bz * sz
        if ha >= 0.0 or hb >= 0.0:
            w = ha / (ha - hb)
            x, y = x0 + w * (x1 - x0), y0 + w * (y1 - y0)
            if ha >= 0.0:
                x0, y0 = x, y
            else:
                x1, y1 = x, y
            # into the row of crossings, in order along the waterline
            place, j = lx * x + ly * y, crossed
            while j > 0 and crossings[3 * j - 3] > place:
                for axis in range(3):
                    crossings[3 * j + axis] = crossings[3 * j - 3 + axis]
                j -= 1
            crossings[3 * j], crossings[3 * j + 1], crossings[3 * j + 2] = place, x, y
            crossed += 1
        found = _append(segments, found, x0, y0, x1, y1)
    for i in range(crossed // 2):
        k = 6 * i
        found = _append(
            segments, found, crossings[k + 1], crossings[k + 2], crossings[k + 4], crossings[k + 5]
        )
    return found


@kernel
def _append(segments: Any, found: int, x0: float, y0: float, x1: float, y1: float) -> int:
    """Append a segment unless it lies along the motion, in no strip; how many there are."""
    if y0 == y1:
        return found
    k = SEGMENT * found
    up = y0 < y1
    segments[k], segments[k + 1] = (y0, x0) if up else (y1, x1)
    segments[k + 2], segments[k + 3] = (y1, x1) if up else (y0, x0)
    return found + 1


@kernel
def _sort(segments: Any, count: int) -> None:
    """Sort segments by their lower ends (Shell's way: outlines are nearly sorted in pieces)."""
    gap = 1
    while 3 * gap + 1 < count:
        gap = 3 * gap + 1
    while gap > 0:
        for i in range(gap, count):
            k = SEGMENT * i
            a, b, c, d = segments[k], segments[k + 1], segments[k + 2], segments[k + 3]
            j = i
            while j >= gap and segments[SEGMENT * (j - gap)] > a:
                for axis in range(SEGMENT):
                    segments[SEGMENT * j + axis] = segments[SEGMENT * (j - gap) + axis]
                j -= gap
            k = SEGMENT * j
            segments[k], segments[k + 1], segments[k + 2], segments[k + 3] = a, b, c, d
        gap //= 3


@kernel
def _place(segments: Any, i: int, y: float) -> float:
    """x of a segment at y; its own ends at its ends."""
    k = SEGMENT * i
    y0, x0, y1, x1 = segments[k], segments[k + 1], segments[k + 2], segments[k + 3]
    x: float = x1 if y >= y1 else x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return x


@kernel
def _add_slabs(
    block: Any, speed: float, segments: Any, count: int, active: Any, front: float,
    vn: float, gx: float, gy: float, found: Any,
) -> None:  # fmt: skip
    """Integrals over the strips between the segments, squeezed to their front parts.

    A line rises across the motion and stops wherever a segment begins or ends; those that it meets, in the
    order of x, bound the strips of this slab in pairs.
    """
    points = as_doubles(stack_doubles(POINT * MAX_POINTS))
    _sort(segments, count)
    met = following = 0
    y = segments[0]
    while True:
        # segments that end here go, those that begin here come
        kept = 0
        for i in range(met):
            if segments[SEGMENT * active[i] + 2] > y:
                active[kept] = active[i]
                kept += 1
        met = kept
        if met == 0 and following < count:
            y = max(y, segments[SEGMENT * following])
        while following < count and segments[SEGMENT * following] <= y:
            if segments[SEGMENT * following + 2] > y:
                active[met] = following
                met += 1
            following += 1
        if met == 0:
            if following < count:
                continue
            break
        top = segments[SEGMENT * active[0] + 2]
        for i in range(1, met):
            top = min(top, segments[SEGMENT * active[i] + 2])
        if following < count:
            top = min(top, segments[SEGMENT * following])
        # in the order of x
        middle = 0.5 * (y + top)
        for i in range(1, met):
            one = active[i]
            x, j = _place(segments, one, middle), i
            while j > 0 and _place(segments, active[j - 1], middle) > x:
                active[j] = active[j - 1]
                j -= 1
            active[j] = one
        for i in range(met // 2):
            back, ahead = active[2 * i], active[2 * i + 1]
            for end in range(2):
                at = top if end else y
                x1 = _place(segments, ahead, at)
                x0 = x1 - front * (x1 - _place(segments, back, at))
                for side in range(2):
                    x = x1 if side != end else x0
                    k = POINT * (2 * end + side)
                    points[k], points[k + 1] = x, at
                    points[k + 2] = vn + gx * x + gy * at
            add_polygon(block, speed, points, 4, 1.0 / front, found)
        y = top


@kernel
def pressure_centre(
    block: Any, i: int, rx: float, ry: float, rz: float, nx: float, ny: float, nz: float,
    vx: float, vy: float, vz: float, ux: float, uy: float, uz: float, depth: float,
) -> tuple[float, float, float]:  # fmt: skip
    """Where the load of a small piece of a face acts, for those who take a face as many points.

    A piece whose centroid lies s behind the front of its strip is moved by 2 s x / l: s is l / 2 on average over
    a strip, so the strip's load acts where it should, however it is cut.

    Args:
        block, i: the body, of a law that needs its planes, and its triangle.
        rx, ry, rz: centroid of the piece; nx, ny, nz: normal.
        vx, vy, vz: velocity of the body; ux, uy, uz: upwards; all in body axes.
        depth: of the centroid under the water.
    """
    vn = vx * nx + vy * ny + vz * nz
    tx, ty, tz = vx - vn * nx, vy - vn * ny, vz - vn * nz
    along = math.sqrt(tx * tx + ty * ty + tz * tz)
    if along == 0.0:
        return rx, ry, rz
    tx, ty, tz = tx / along, ty / along, tz / along
    sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    # to the next edge ahead
    way = math.inf
    at = int(block[HEADER + PLANE * int(block[STRIDE]) + i])
    for edge in range(int(block[at + EDGES])):
        k = at + OUTLINE + EDGE * edge
        ax, ay, az = block[k] - rx, block[k + 1] - ry, block[k + 2] - rz
        bx, by, bz = block[k + 3] - rx, block[k + 4] - ry, block[k + 5] - rz
        ya, yb = ax * sx + ay * sy + az * sz, bx * sx + by * sy + bz * sz
        if (ya < 0.0) != (yb < 0.0):
            xa, xb = ax * tx + ay * ty + az * tz, bx * tx + by * ty + bz * tz
            x = xa + ya / (ya - yb) * (xb - xa)
            if 0.0 <= x < way:
                way = x
    if way == math.inf:
        return rx, ry, rz
    # or to the waterline
    rise = tx * ux + ty * uy + tz * uz
    if rise * way > depth:
        way = depth / rise
    way *= 2.0 * pressure_shift(vn, math.sqrt(along * along + vn * vn))
    return rx + way * tx, ry + way * ty, rz + way * tz
