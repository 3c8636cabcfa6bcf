"""A law's load integrated over a face: exact, so that it does not matter how the face is cut into triangles.

In the plane of a face (x, y) the normal speed is linear, v = v_0 + g_x x + g_y y, so that

    integral of (a v^2 + b U v + c U^2 + e U^2 pi v / (4 U + pi |v|)) {1, x, y} dA

has a closed form over a triangle. The last term, a plate with a cavity behind it (Rayleigh 1876), is taken odd in
v: where a part of a loaded face recedes, as in the linear law. By the gate `local` only what advances is loaded,
and the polygon is cut along v = 0.

Polygons are rows of POINT doubles: x, y and what is linear over them.
"""

import math
from typing import Any

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, place_of, stack_doubles
from mjskip.hydro._block import (
    ABOUT_GROUP,
    BOX,
    CAVITY,
    COLUMNS,
    FACES,
    FRICTION,
    GROUP,
    HEADER,
    HEIGHT,
    LOCAL_GATE,
    N_FACES,
    NORMAL_SQUARED,
    OMEGA,
    PATCH_HIGHEST,
    RISING,
    SPEED_NORMAL,
    SPEED_SQUARED,
    STRIDE,
    UP,
    VELOCITY,
)
from mjskip.hydro._box_kernels import lowest_of
from mjskip.hydro._patch_kernels import surface_at

POINT = 3
MAX_POINTS = 8  # of a triangle or trapezoid that is cut twice

# integrals over a face
LOAD, LOAD_X, LOAD_Y = 0, 1, 2
LOADED, LOADED_X, LOADED_Y = 3, 4, 5  # of the area that is loaded
INTEGRALS = 6


@kernel
def clip(points: Any, count: int, kept: Any) -> int:
    """The part of a convex polygon on which its third number is negative; how many points it has."""
    found = 0
    for i in range(count):
        a = POINT * i
        b = POINT * (i + 1 if i + 1 < count else 0)
        fa, fb = points[a + 2], points[b + 2]
        if fa < 0.0:
            for j in range(POINT):
                kept[POINT * found + j] = points[a + j]
            found += 1
        if (fa < 0.0) != (fb < 0.0):
            s = fa / (fa - fb)
            kept[POINT * found] = points[a] + s * (points[b] - points[a])
            kept[POINT * found + 1] = points[a + 1] + s * (points[b + 1] - points[a + 1])
            kept[POINT * found + 2] = 0.0
            found += 1
    return found


@kernel
def add_polygon(
    block: Any, speed: float, points: Any, count: int, weight: float, found: Any
) -> None:
    """Add the integrals over a convex polygon whose third number is the normal speed, times a weight.

    Args:
        block: of the body.
        speed: U.
        points: the polygon, counter-clockwise or clockwise.
        count: how many points it has.
        weight: factor on the integrals.
        found: INTEGRALS that are added to.
    """
    cut = as_doubles(stack_doubles(POINT * MAX_POINTS))
    advances = True
    for i in range(count):
        advances = advances and points[POINT * i + 2] > 0.0
    if advances or (block[LOCAL_GATE] == 0.0 and block[CAVITY] == 0.0):
        _add_fan(block, speed, points, count, weight, found)
        return
    if block[LOCAL_GATE] == 0.0:  # a cavity's load is odd in v, each side smooth
        _add_fan(block, speed, cut, _below(points, count, cut), -weight, found)
    for i in range(count):
        points[POINT * i + 2] = -points[POINT * i + 2]
    _add_fan(block, speed, cut, _below(points, count, cut), weight, found)


@kernel
def _below(points: Any, count: int, kept: Any) -> int:
    """The part of a polygon where v < 0, with |v| for v; how many points it has."""
    count = clip(points, count, kept)
    for i in range(count):
        kept[POINT * i + 2] = -kept[POINT * i + 2]
    return count


@kernel
def _add_fan(block: Any, speed: float, points: Any, count: int, weight: float, found: Any) -> None:
    """Add the integrals over a convex polygon, as triangles from its first point."""
    for i in range(2, count):
        _add_triangle(
            block, speed, weight,
            points[0], points[1], points[2],
            points[POINT * i - 3], points[POINT * i - 2], points[POINT * i - 1],
            points[POINT * i], points[POINT * i + 1], points[POINT * i + 2], found,
        )  # fmt: skip


@kernel
def _add_triangle(
    block: Any, speed: float, weight: float,
    x0: float, y0: float, v0: float, x1: float, y1: float, v1: float,
    x2: float, y2: float, v2: float, found: Any,
) -> None:  # fmt: skip
    """Integrals over one triangle; of products of barycentric coordinates by Dirichlet's formula."""
    area = 0.5 * weight * abs((x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0))
    if area == 0.0:
        return
    found[LOADED] += area
    found[LOADED_X] += area * (x0 + x1 + x2) / 3.0
    found[LOADED_Y] += area * (y0 + y1 + y2) / 3.0

    # the polynomial: p0, p1, p2 are the integrals of it times a barycentric coordinate, over the area
    a, b, c = block[NORMAL_SQUARED], block[SPEED_NORMAL] * speed, block[SPEED_SQUARED] * speed**2
    total, squares = v0 + v1 + v2, v0 * v0 + v1 * v1 + v2 * v2
    p0 = a * _share_of_square(v0, total, squares) + b * (total + v0) / 12.0 + c / 3.0
    p1 = a * _share_of_square(v1, total, squares) + b * (total + v1) / 12.0 + c / 3.0
    p2 = a * _share_of_square(v2, total, squares) + b * (total + v2) / 12.0 + c / 3.0
    if block[CAVITY] != 0.0 and speed > 0.0:
        q0, q1, q2 = _cavity_shares(v0 / speed, v1 / speed, v2 / speed)
        scale = block[CAVITY] * speed**2
        p0, p1, p2 = p0 + scale * q0, p1 + scale * q1, p2 + scale * q2
    found[LOAD] += area * (p0 + p1 + p2)
    found[LOAD_X] += area * (p0 * x0 + p1 * x1 + p2 * x2)
    found[LOAD_Y] += area * (p0 * y0 + p1 * y1 + p2 * y2)


@kernel
def _share_of_square(v: float, total: float, squares: float) -> float:
    """Integral of v^2 times the barycentric coordinate of the corner with this v, over the area."""
    others, rest = total - v, squares - v * v
    return v * v / 10.0 + v * others / 15.0 + rest / 30.0 + (others * others - rest) / 60.0


@kernel
def _cavity_shares(q0: float, q1: float, q2: float) -> tuple[float, float, float]:
    """Integrals of pi q / (4 + pi q) times each barycentric coordinate, over the area; q >= 0.

    It is 1 - c / (q + c) with c = 4 / pi. The triangle is cut along the level of its middle corner; over a
    piece with w = q + c from w_a at its apex to w_b = w_a (1 + x) at its base, with l from 0 to 1,

        2 area / w_a integral of l {1, l} / (1 + x l) dl
    """
    c = 4.0 / math.pi
    third = 1.0 / 3.0
    w0, w1, w2 = q0 + c, q1 + c, q2 + c
    low, high = min(w0, w1, w2), max(w0, w1, w2)
    if high - low < 1e-13 * high:
        share = third * (1.0 - c / w0)
        return share, share, share
    # the lowest, the middle and the highest corner
    i = 0 if w0 <= w1 and w0 <= w2 else 1 if w1 <= w2 else 2
    k = 2 if w2 >= w0 and w2 >= w1 else 1 if w1 >= w0 else 0
    j = 3 - i - k
    middle = w0 + w1 + w2 - low - high
    t = (middle - low) / (high - low)  # where the middle level meets the long side, from the lowest
    shares = as_doubles(stack_doubles(3))
    shares[0] = shares[1] = shares[2] = third
    # below the middle level: apex i, base from j to a point t along i-k
    one, two = _levels((middle - low) / low)
    factor = 2.0 * c * t / low
    shares[i] -= factor * (one - two + 0.5 * two * (1.0 - t))
    shares[j] -= factor * 0.5 * two
    shares[k] -= factor * 0.5 * two * t
    # above it: apex k, the same base
    one, two = _levels((middle - high) / high)
    factor = 2.0 * c * (1.0 - t) / high
    shares[k] -= factor * (one - two + 0.5 * two * t)
    shares[j] -= factor * 0.5 * two
    shares[i] -= factor * 0.5 * two * (1.0 - t)
    return shares[0], shares[1], shares[2]


@kernel
def _levels(x: float) -> tuple[float, float]:
    """Integrals of l / (1 + x l) and of l^2 / (1 + x l) from 0 to 1, x > -1."""
    if abs(x) < 0.1:  # the closed forms cancel: their series, to 1e-15
        one = two = 0.0
        power = 1.0
        for n in range(7 if abs(x) < 0.005 else 15):
            one += power / (n + 2)
            two += power / (n + 3)
            power *= -x
        return one, two
    log = math.log1p(x)
    return (x - log) / (x * x), (0.5 * x * x - x + log) / (x * x * x)


@kernel
def add_face_loads(
    block: Any, motion: Any, found: Any,
    nx: float, ny: float, nz: float, tx: float, ty: float, tz: float, distance: float, sums: Any,
) -> None:  # fmt: skip
    """Turn the integrals over a face into force and torque.

    Args:
        block, motion: of the body.
        found: the integrals, in axes t, s = n x t of the face.
        nx, ny, nz: its normal.
        tx, ty, tz: t.
        distance: of its plane from the centre of mass.
        sums: force (3) and torque (3) that are added to.
    """
    sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
    load, x, y = found[LOAD], found[LOAD_X], found[LOAD_Y]
    # F = -load n; r x F with r = x t + y s + distance n
    sums[0] -= load * nx
    sums[1] -= load * ny
    sums[2] -= load * nz
    sums[3] += x * sx - y * tx
    sums[4] += x * sy - y * ty
    sums[5] += x * sz - y * tz
    if block[FRICTION] != 0.0 and found[LOADED] > 0.0:
        vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
        vn = vx * nx + vy * ny + vz * nz
        along = math.sqrt((vx - vn * nx) ** 2 + (vy - vn * ny) ** 2 + (vz - vn * nz) ** 2)
        if along > 0.0:
            pull = -block[FRICTION] * (vx * vx + vy * vy + vz * vz) / along
            fx, fy, fz = pull * (vx - vn * nx), pull * (vy - vn * ny), pull * (vz - vn * nz)
            a, x, y = found[LOADED], found[LOADED_X], found[LOADED_Y]
            rx = x * tx + y * sx + a * distance * nx
            ry = x * ty + y * sy + a * distance * ny
            rz = x * tz + y * sz + a * distance * nz
            sums[0] += a * fx
            sums[1] += a * fy
            sums[2] += a * fz
            sums[3] += ry * fz - rz * fy
            sums[4] += rz * fx - rx * fz
            sums[5] += rx * fy - ry * fx


@kernel
def add_integrals(block: Any, state: Any, motion: Any, patch: Any, sums: Any) -> None:
    """Count the loads of the law, integrated over the wet part of every triangle."""
    n = int(block[STRIDE])
    z, ux, uy, uz = motion[HEIGHT], motion[UP], motion[UP + 1], motion[UP + 2]
    vx, vy, vz = motion[VELOCITY], motion[VELOCITY + 1], motion[VELOCITY + 2]
    wx, wy, wz = motion[OMEGA], motion[OMEGA + 1], motion[OMEGA + 2]
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    waves = patch.size > 0
    highest = patch[PATCH_HIGHEST] if waves else 0.0
    points = as_doubles(stack_doubles(POINT * MAX_POINTS))
    wet = as_doubles(stack_doubles(POINT * MAX_POINTS))
    found = as_doubles(stack_doubles(INTEGRALS))
    for i in range(int(block[N_FACES])):
        if i % GROUP == 0:
            box = place_of(block, HEADER + COLUMNS * n + ABOUT_GROUP * (i // GROUP) + BOX)
            dry = lowest_of(motion, box) > highest
        if dry:
            continue
        k = HEADER + i
        f = k + FACES * n
        nx, ny, nz = block[f], block[f + n], block[f + 2 * n]
        vn_centre = vx * nx + vy * ny + vz * nz
        if block[LOCAL_GATE] == 0.0 and vn_centre < 0.0:
            continue
        # axes of the face: t along its first edge, s = n x t
        tx, ty = block[k + 3 * n] - block[k], block[k + 4 * n] - block[k + n]
        tz = block[k + 5 * n] - block[k + 2 * n]
        length = math.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / length, ty / length, tz / length
        sx, sy, sz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        for j in range(3):
            x, y, h = block[k + 3 * j * n], block[k + (3 * j + 1) * n], block[k + (3 * j + 2) * n]
            points[POINT * j] = x * tx + y * ty + h * tz
            points[POINT * j + 1] = x * sx + y * sy + h * sz
            points[POINT * j + 2] = z + ux * x + uy * y + uz * h
            if waves:
                points[POINT * j + 2] -= surface_at(patch, state, x, y, h, 0)
        count = clip(points, 3, wet)
        if count < 3:
            continue
        gx = tx * (ny * wz - nz * wy) + ty * (nz * wx - nx * wz) + tz * (nx * wy - ny * wx)
        gy = sx * (ny * wz - nz * wy) + sy * (nz * wx - nx * wz) + sz * (nx * wy - ny * wx)
        distance = block[k] * nx + block[k + n] * ny + block[k + 2 * n] * nz
        if waves:
            cx, cy, cz = block[f + 3 * n], block[f + 4 * n], block[f + 5 * n]
            more = surface_at(patch, state, cx, cy, cz, 1) - motion[RISING]
            vn_centre -= more * (ux * nx + uy * ny + uz * nz)
        for j in range(count):
            wet[POINT * j + 2] = vn_centre + gx * wet[POINT * j] + gy * wet[POINT * j + 1]
        for j in range(INTEGRALS):
            found[j] = 0.0
        add_polygon(block, speed, place_of(wet, 0), count, 1.0, found)
        add_face_loads(block, motion, found, nx, ny, nz, tx, ty, tz, distance, sums)
