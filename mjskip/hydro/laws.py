"""Force laws: what water does to one immersed face. Add a law by adding a row to `LAWS`.

Every law of the literature on skipping stones is one formula with other coefficients,

    F = -rho S [ (a (V.n)^2 + b U (V.n) + c U^2 + e U^2 pi (V.n) / (4 U + pi |V.n|)) n + d U^2 t ]

S immersed area of the face, n its outward normal, V its velocity through the water at the centroid of
the immersed part, U the speed of the stone's centre of mass, t the unit vector of the motion of the
centre of mass along the face. U and t belong to the stone, not to the face: the rim of a spinning disc
is fast in its own plane, and neither lift nor friction of these laws was measured on that motion.

The term e is the flow past a plate with a cavity behind it (Kirchhoff, Rayleigh); it stands alone in a law, and
where a part of a loaded face recedes it is odd in V.n, as the linear term is.
The literature lets F act at the centroid of the immersed part. Water under a plate presses most near its front;
`forward` moves F to the pressure centre of Rayleigh (1876), see docs/validation.md: then plane faces are taken as
strips along the motion (`mjskip.hydro._strip_kernels`) and F is integrated over them.
"""

from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, kw_only=True)
class ForceLaw:
    """Dimensionless coefficients of the formula above.

    Attributes:
        normal_squared: a, of (V.n)^2.
        speed_normal: b, of U (V.n).
        speed_squared: c, of U^2 against the normal.
        friction: d, of U^2 along the face.
        cavity: e, of a plate with a cavity behind it; only with `forward`.
        forward: whether F acts ahead of the middle of the wet strips of the face, by Rayleigh.
        source: where the law comes from.
    """

    normal_squared: float = 0.0
    speed_normal: float = 0.0
    speed_squared: float = 0.0
    friction: float = 0.0
    cavity: float = 0.0
    forward: bool = False
    source: str

    def __post_init__(self) -> None:
        if (self.cavity and not self.forward) or (self.friction and self.forward):
            raise ValueError("a law with a cavity is `forward`, and one with friction is not")


LAWS: dict[str, ForceLaw] = {
    "lee2010": ForceLaw(
        normal_squared=1.0,
        source="Lee & Baek, J. Korea Multimedia Society 13(9), 2010, equation (1)",
    ),
    "nagahiro2005": ForceLaw(
        normal_squared=0.5 * 1.4,
        source="Nagahiro & Hayakawa, Phys. Rev. Lett. 94:174501, 2005, C_D = 1.4",
    ),
    "rosellini2005": ForceLaw(
        speed_normal=0.5,
        source="Rosellini et al., J. Fluid Mech. 543:137, 2005, C_L = 0.5 sin(attack) a side",
    ),
    "bocquet2003": ForceLaw(
        speed_squared=0.5,
        friction=0.5,
        source="Bocquet, Am. J. Phys. 71:150, 2003, C_l = C_f = 1",
    ),
    "lee2010_forward": ForceLaw(
        normal_squared=1.0,
        forward=True,
        source="lee2010 at the pressure centre of Rayleigh, Phil. Mag. (5) 2:430, 1876",
    ),
    "rosellini2005_forward": ForceLaw(
        speed_normal=0.5,
        forward=True,
        source="rosellini2005 at the pressure centre of Rayleigh, Phil. Mag. (5) 2:430, 1876",
    ),
    "rayleigh1876_forward": ForceLaw(
        cavity=1.0,
        forward=True,
        source="Rayleigh, Phil. Mag. (5) 2:430, 1876: load and pressure centre of a plate with a cavity behind it",
    ),
    "birkhoff1944": ForceLaw(
        normal_squared=0.5,
        source="Birkhoff et al., 1944, and Johnson & Reid, J. Mech. Eng. Sci. 17:71, 1975, as quoted by others: "
        "1/2 rho (V.n)^2 on a sphere",
    ),
    "none": ForceLaw(
        source="no load beside hydrostatics, waves and friction: for what floats and radiates",
    ),
}


class Advice(NamedTuple):
    """Which law to take for a kind of body.

    Attributes:
        body: the kind.
        water: arguments of `Water`.
        error: what to expect, from docs/validation.md.
    """

    body: str
    water: str
    error: str


ADVICE = (
    Advice(
        "thin disc, flat stone",
        'law="rayleigh1876_forward"',
        "contact +6%, slowest speed -15%; trout and dive right, surf wrong",
    ),
    Advice(
        "pebble, the paper's figures",
        "(the default, lee2010)",
        "the paper's law; a real disc's slowest speed +40%",
    ),
    Advice(
        "sphere",
        'law="birkhoff1944"',
        "ricochet angle +5%, drag under water +15%; the first slam far too soft",
    ),
    Advice(
        "boat, duck, raft",
        "Water.floating()",
        "draft and righting exact; planing lift -40 to -80%, or +15 to +75% by rosellini2005_forward",
    ),
    Advice(
        "robot, paddle, fast spin",
        "Water.floating(quadrature=True)",
        "drag of a plate broadside +80% (birkhoff1944: -11%); slamming too soft by 3 and more",
    ),
)
"""What the first lines of docs/validation.md and `mjskip laws` say; tests hold it to the page's own figures."""


def advice_table() -> str:
    """`ADVICE` as a table in Markdown."""
    rows = [("for", "water", "expected error"), ("---", "---", "---")]
    rows += [(a.body, f"`{a.water}`" if a.water[0] != "(" else a.water, a.error) for a in ADVICE]
    return "\n".join(f"| {' | '.join(row)} |" for row in rows)
