"""The part of a triangle that is under water: its area, its centroid, and the pressure of still water on it."""

from mjskip._compile.jit import inlined
from mjskip._compile.vector import select


@inlined
def cut(
    ax: float, ay: float, az: float, ha: float,
    bx: float, by: float, bz: float, hb: float,
    cx: float, cy: float, cz: float, hc: float,
) -> tuple[float, float, float, float, float, float, float, float]:  # fmt: skip
    """Immersed part of a triangle that the surface cuts, and the water on it; nothing branches.

    Args:
        ax: first corner, and so on.
        ha: its height above the surface, negative below; heights h vary linearly over the triangle. One or
            two of them are negative.

    Returns:
        Fraction of the area that is immersed, its centroid (3); integrals of h and of r h (3) over it, for a
        triangle of unit area.

    The immersed polygon is a triangle or a quadrangle. A quadrangle is taken as two triangles with
    positive weights, so that nothing cancels however thin it is. Places are a + beta (b - a) + gamma (c - a).
    """
    third, twelfth = 1.0 / 3.0, 1.0 / 12.0
    wet_a, wet_b, wet_c = ha < 0.0, hb < 0.0, hc < 0.0
    one = select(wet_a, 1.0, 0.0) + select(wet_b, 1.0, 0.0) + select(wet_c, 1.0, 0.0) == 1.0
    # turn the triangle so that the odd corner (the only wet or the only dry one) is a
    odd_b, odd_c = wet_b == one, wet_c == one
    ax, bx, cx = _turned(odd_b, odd_c, ax, bx, cx)
    ay, by, cy = _turned(odd_b, odd_c, ay, by, cy)
    az, bz, cz = _turned(odd_b, odd_c, az, bz, cz)
    ha, hb, hc = _turned(odd_b, odd_c, ha, hb, hc)
    # where the surface cuts ab and ca, from the wet end of each
    s = select(one, ha, hb) / select(one, ha - hb, hb - ha)
    t = select(one, ha, hc) / select(one, ha - hc, hc - ha)

    # a dry: the triangles b, c, p and b, p, q with p on ca and q on ab, of areas t and u
    u, both = (1.0 - t) * s, t * (hb + hc)
    total = t + u
    share = third / total
    beta = share * (t + u * (2.0 - s))
    gamma = share * (t * (2.0 - t) + u * (1.0 - t))
    height = third * (both + u * hb)
    along_b = twelfth * (both + t * hb + u * hb * (3.0 - s))
    along_c = twelfth * (both * (2.0 - t) + t * hc + u * hb * (1.0 - t))
    # a wet: the triangle a, q, p
    small = s * t
    total = select(one, small, total)
    beta, gamma = select(one, third * s, beta), select(one, third * t, gamma)
    small *= ha
    height = select(one, third * small, height)
    along_b = select(one, twelfth * small * s, along_b)
    along_c = select(one, twelfth * small * t, along_c)

    bx, by, bz, cx, cy, cz = bx - ax, by - ay, bz - az, cx - ax, cy - ay, cz - az
    return (
        total,
        ax + beta * bx + gamma * cx,
        ay + beta * by + gamma * cy,
        az + beta * bz + gamma * cz,
        height,
        height * ax + along_b * bx + along_c * cx,
        height * ay + along_b * by + along_c * cy,
        height * az + along_b * bz + along_c * cz,
    )


@inlined
def _turned(odd_b: bool, odd_c: bool, a: float, b: float, c: float) -> tuple[float, float, float]:
    """Three corners' numbers, turned so that the odd one is first."""
    return (
        select(odd_b, b, select(odd_c, c, a)),
        select(odd_b, c, select(odd_c, a, b)),
        select(odd_b, a, select(odd_c, b, c)),
    )


@inlined
def immersed_part(
    ax: float, ay: float, az: float, ha: float,
    bx: float, by: float, bz: float, hb: float,
    cx: float, cy: float, cz: float, hc: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Fraction of a triangle's area that lies below the surface, and the centroid of that part; see `cut`.

    Any of the heights may be negative.
    """
    below = int(ha < 0.0) + int(hb < 0.0) + int(hc < 0.0)
    third = 1.0 / 3.0
    if below == 3:
        return 1.0, (ax + bx + cx) * third, (ay + by + cy) * third, (az + bz + cz) * third
    if below == 0:
        return 0.0, 0.0, 0.0, 0.0
    fraction, x, y, z, _, _, _, _ = cut(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
    return fraction, x, y, z


@inlined
def column(
    ax: float, ay: float, az: float, ha: float,
    bx: float, by: float, bz: float, hb: float,
    cx: float, cy: float, cz: float, hc: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Integrals of h and of r h over the immersed part of a triangle of unit area; see `cut`.

    At least one of the heights is negative.
    """
    if ha < 0.0 and hb < 0.0 and hc < 0.0:
        third, twelfth = 1.0 / 3.0, 1.0 / 12.0
        total = ha + hb + hc
        return (
            third * total,
            twelfth * ((ax + bx + cx) * total + ax * ha + bx * hb + cx * hc),
            twelfth * ((ay + by + cy) * total + ay * ha + by * hb + cy * hc),
            twelfth * ((az + bz + cz) * total + az * ha + bz * hb + cz * hc),
        )
    _, _, _, _, height, x, y, z = cut(ax, ay, az, ha, bx, by, bz, hb, cx, cy, cz, hc)
    return height, x, y, z
