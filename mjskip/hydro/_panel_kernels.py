"""Influence of flat triangles that carry sources of constant strength, with images in surface and bottom.

    P_ij = integral over panel j of G dS at the centre of panel i,  M_ij = n_i . grad_i of the same
    G    = sum_n (-1)^n [ 1 / |x - (x', y', z' + 2 n H)| - 1 / |x - (x', y', -z' + 2 n H)| ]

G vanishes at z = 0 and has no flow through z = -H; with infinite depth only n = 0 is there. Integrals over
near triangles are exact (Hess & Smith, J. Ship Res. 8:22, 1964; Wilton et al., IEEE TAP 32:276, 1984), over
far ones by three points.
"""

import math
from typing import Any

from mjskip._compile.jit import kernel

FAR = 4.0
"""A triangle is far from this many times its longest edge on."""


@kernel
def _edge(
    ax: float, ay: float, az: float, bx: float, by: float, bz: float,
    nx: float, ny: float, nz: float, height: float,
) -> tuple[float, float, float, float, float]:  # fmt: skip
    """Part of one edge, corners relative to the field point: potential, gradient (3) in the plane, angle."""
    lx, ly, lz = bx - ax, by - ay, bz - az
    length = math.sqrt(lx * lx + ly * ly + lz * lz)
    lx, ly, lz = lx / length, ly / length, lz / length
    # outward from the triangle, in its plane
    ux, uy, uz = ly * nz - lz * ny, lz * nx - lx * nz, lx * ny - ly * nx
    across = ax * ux + ay * uy + az * uz
    first = ax * lx + ay * ly + az * lz
    second = first + length
    square = across * across + height * height
    near, far = math.sqrt(square + first * first), math.sqrt(square + second * second)
    total = near + far
    logarithm = math.log((total + length) / max(total - length, 1e-14 * total))
    h = abs(height)
    angle = math.atan2(across * second, square + h * far) - math.atan2(
        across * first, square + h * near
    )
    potential = across * logarithm - h * angle
    return potential, -ux * logarithm, -uy * logarithm, -uz * logarithm, angle


@kernel
def source_triangle(
    px: float, py: float, pz: float, corners: Any, normal: Any, flip: float, lift: float, size: float
) -> tuple[float, float, float, float]:  # fmt: skip
    """Integral of 1/R over a triangle and its gradient (3) at a point.

    Args:
        px: the point, and so on.
        corners: (3, 3) [m].
        normal: its unit normal (3,).
        flip: -1 for the mirror image in z = 0, else 1.
        lift: added to the heights of its (mirrored) corners [m].
        size: its longest edge [m].
    """
    nx, ny, nz = normal[0], normal[1], flip * normal[2]
    ax, ay, az = corners[0, 0] - px, corners[0, 1] - py, flip * corners[0, 2] + lift - pz
    bx, by, bz = corners[1, 0] - px, corners[1, 1] - py, flip * corners[1, 2] + lift - pz
    cx, cy, cz = corners[2, 0] - px, corners[2, 1] - py, flip * corners[2, 2] + lift - pz
    mx, my, mz = (ax + bx + cx) / 3.0, (ay + by + cy) / 3.0, (az + bz + cz) / 3.0
    potential = gx = gy = gz = 0.0
    if mx * mx + my * my + mz * mz > (FAR * size) ** 2:
        area = 0.5 * math.sqrt(
            ((by - ay) * (cz - az) - (bz - az) * (cy - ay)) ** 2
            + ((bz - az) * (cx - ax) - (bx - ax) * (cz - az)) ** 2
            + ((bx - ax) * (cy - ay) - (by - ay) * (cx - ax)) ** 2
        )
        for i in range(3):  # the points half-way between the middle and the corners
            wx = 0.5 * (mx + (ax if i == 0 else bx if i == 1 else cx))
            wy = 0.5 * (my + (ay if i == 0 else by if i == 1 else cy))
            wz = 0.5 * (mz + (az if i == 0 else bz if i == 1 else cz))
            square = wx * wx + wy * wy + wz * wz
            part = area / (3.0 * math.sqrt(square))
            potential += part
            gx, gy, gz = (
                gx + part * wx / square,
                gy + part * wy / square,
                gz + part * wz / square,
            )
        return potential, gx, gy, gz
    if flip < 0.0:  # a mirrored triangle turns the other way round
        bx, by, bz, cx, cy, cz = cx, cy, cz, bx, by, bz
    height = -(ax * nx + ay * ny + az * nz)
    p1, x1, y1, z1, w1 = _edge(ax, ay, az, bx, by, bz, nx, ny, nz, height)
    p2, x2, y2, z2, w2 = _edge(bx, by, bz, cx, cy, cz, nx, ny, nz, height)
    p3, x3, y3, z3, w3 = _edge(cx, cy, cz, ax, ay, az, nx, ny, nz, height)
    angle = w1 + w2 + w3
    if height < 0.0:
        angle = -angle
    return (
        p1 + p2 + p3,
        x1 + x2 + x3 - nx * angle,
        y1 + y2 + y3 - ny * angle,
        z1 + z2 + z3 - nz * angle,
    )


@kernel
def influence(
    triangles: Any, normals: Any, centres: Any, areas: Any, sizes: Any, body: Any,
    depth: float, images: int, potential: Any, velocity: Any,
) -> None:  # fmt: skip
    """Fill P and M (n, n) of panels (n, 3, 3); `body` (n,) says to which hull a panel belongs.

    The diagonal of the direct part closes the balance of volume over the hull and its mirror image: all that
    a panel's sources give goes out through them, so

        M_jj = -4 pi - sum over the other panels i of the hull, and all of its image, of A_i M_ij / A_j

    which is -2 pi on a flat wall and lets a curved hull converge with the second power of the panel's size.
    Depth 0 means infinite.
    """
    count = triangles.shape[0]
    for j in range(count):
        given = 0.0
        for i in range(count):
            x, y, z = centres[i, 0], centres[i, 1], centres[i, 2]
            nx, ny, nz = normals[i, 0], normals[i, 1], normals[i, 2]
            p, gx, gy, gz = source_triangle(x, y, z, triangles[j], normals[j], 1.0, 0.0, sizes[j])
            direct = gx * nx + gy * ny + gz * nz
            if i == j:
                direct = 0.0
            q, hx, hy, hz = source_triangle(x, y, z, triangles[j], normals[j], -1.0, 0.0, sizes[j])
            # the image's flow at i is, mirrored, the panel's flow at the image of i
            mirrored = hx * nx + hy * ny + hz * nz
            if body[i] == body[j]:
                given += areas[i] * (direct + mirrored)
            potential[i, j] = p - q
            velocity[i, j] = direct - mirrored
            if depth > 0.0:
                for n in range(-images, images + 1):
                    if n == 0:
                        continue
                    sign = 1.0 if n % 2 == 0 else -1.0
                    lift = 2.0 * n * depth
                    p, gx, gy, gz = source_triangle(
                        x, y, z, triangles[j], normals[j], 1.0, lift, sizes[j]
                    )
                    q, hx, hy, hz = source_triangle(
                        x, y, z, triangles[j], normals[j], -1.0, lift, sizes[j]
                    )
                    potential[i, j] += sign * (p - q)
                    velocity[i, j] += sign * ((gx - hx) * nx + (gy - hy) * ny + (gz - hz) * nz)
        velocity[j, j] += -4.0 * math.pi - given / areas[j]
