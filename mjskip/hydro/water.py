"""The fluid: constants that travel together in one frozen object."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Literal, get_args

from mjskip.checks import check_choice, check_number, check_switch
from mjskip.hydro.laws import LAWS

Gate = Literal["centre", "local"]
GATES: tuple[Gate, ...] = get_args(Gate)


@dataclass(frozen=True, kw_only=True)
class Water:
    """Water below z = 0 and air above it.

    Attributes:
        density: of the water [kg/m^3].
        air_density: of the air [kg/m^3]; 0 switches air drag off.
        gate: which immersed faces are loaded. "centre" is the paper's: those whose outward normal
            makes at most 90 degrees with the velocity of the centre of mass. "local": those that
            advance into the water themselves, so that water only ever takes energy.
        buoyancy: whether the water bears: hydrostatic pressure on every immersed face. The force laws of
            the literature leave it out.
        skin_friction: whether the water rubs along every immersed face (ITTC 1957), so that what floats
            comes to rest.
        viscosity: kinematic, of the water [m^2/s]; only for skin friction.
        quadrature: whether the load of a law is integrated over the immersed part of each triangle (and, by the
            gate "local", over that part of it which advances), instead of taken at its centroid as the paper
            does: a spinning body's load then does not depend on how its faces are cut into triangles. Laws that
            act `forward` are always integrated.
        added_mass: share of the water that a wet plate takes with it (half of Pabst's, docs/validation.md) that
            counts in a law that acts `forward`, from 0 to 1; a subject of research, for stones thrown by the
            reference engine and in sweeps.
        law: name of the force on an immersed face, a key of `mjskip.hydro.laws.LAWS`.
        radiation: whether what floats makes and scatters waves: added mass, radiation damping and diffraction of
            linear potential flow. It bears too. Inside MuJoCo only.

    Raises:
        ValueError: a density or the viscosity is no number of at least 0, a switch neither True nor False, or
            the gate or the law unknown, or what radiates does not bear.
    """

    density: float = 1000.0
    air_density: float = 1.2
    gate: Gate = "centre"
    law: str = "lee2010"
    buoyancy: bool = False
    skin_friction: bool = False
    viscosity: float = 1.0e-6
    quadrature: bool = False
    added_mass: float = 0.0
    radiation: bool = False

    @classmethod
    def floating(
        cls,
        *,
        density: float = 1000.0,
        air_density: float = 1.2,
        gate: Gate = "local",
        law: str | None = None,
        buoyancy: bool = True,
        skin_friction: bool = True,
        viscosity: float = 1.0e-6,
        quadrature: bool = False,
        radiation: bool = False,
    ) -> Water:
        """Water for what floats: it bears, it rubs, and it never gives energy (gate "local").

        The law is the paper's unless another is given, and "none" with `radiation`: the pressure of moving water is
        that of potential flow then, and a law of impact counts it twice.

        Args:
            density, air_density, gate, buoyancy, skin_friction, viscosity, quadrature, radiation: as the fields.
            law: as the field; None chooses.

        Raises:
            ValueError: as `Water`.
        """
        if law is None:
            law = "none" if radiation else "lee2010"
        return cls(
            density=density, air_density=air_density, gate=gate, law=law, buoyancy=buoyancy,
            skin_friction=skin_friction, viscosity=viscosity, quadrature=quadrature, radiation=radiation,
        )  # fmt: skip

    def __post_init__(self) -> None:
        for name in ("density", "air_density", "viscosity"):
            unit = "m^2/s" if name == "viscosity" else "kg/m^3"
            number = check_number(name, getattr(self, name), low=0.0, unit=unit)
            object.__setattr__(self, name, number)
        for name in SWITCHES:
            object.__setattr__(self, name, check_switch(name, getattr(self, name)))
        check_choice("gate", self.gate, GATES)
        check_choice("law", self.law, tuple(LAWS))
        share = check_number("added_mass", self.added_mass, low=0.0, high=1.0)
        object.__setattr__(self, "added_mass", share)
        if self.added_mass and not LAWS[self.law].forward:
            able = ", ".join(name for name, law in LAWS.items() if law.forward)
            raise ValueError(
                f"added_mass is {self.added_mass:g}, and law {self.law!r} has no plates: use one of {able}"
            )
        if self.skin_friction and self.viscosity == 0.0:
            raise ValueError(
                "viscosity is 0 and skin_friction is on: give a viscosity above 0 [m^2/s]"
            )
        if self.radiation and not self.buoyancy:
            raise ValueError(
                "radiation is on and buoyancy is off: what makes waves floats; use Water.floating(radiation=True)"
            )


SWITCHES = tuple(each.name for each in fields(Water) if isinstance(each.default, bool))
"""Fields of `Water` that are on or off."""
