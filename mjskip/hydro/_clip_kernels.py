"""The part of a triangle that is under water: its area, its centroid, and the pressure of still water on it."""

from mjskip._compile.jit import inlined


@inlined
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


@inlined
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


@inlined
def column(
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
