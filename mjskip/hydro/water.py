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
        law: name of the force on an immersed face, a key of `mjskip.hydro.laws.LAWS`.

    Raises:
        ValueError: a density or the viscosity is no number of at least 0, a switch neither True nor False, or
            the gate or the law unknown.
    """

    density: float = 1000.0
    air_density: float = 1.2
    gate: Gate = "centre"
    law: str = "lee2010"
    buoyancy: bool = False
    skin_friction: bool = False
    viscosity: float = 1.0e-6
    quadrature: bool = False

    @classmethod
    def floating(
        cls,
        *,
        density: float = 1000.0,
        air_density: float = 1.2,
        gate: Gate = "local",
        law: str = "lee2010",
        buoyancy: bool = True,
        skin_friction: bool = True,
        viscosity: float = 1.0e-6,
        quadrature: bool = False,
    ) -> Water:
        """Water for what floats: it bears, it rubs, and it never gives energy (gate "local")."""
        return cls(
            density=density, air_density=air_density, gate=gate, law=law, buoyancy=buoyancy,
            skin_friction=skin_friction, viscosity=viscosity,
            quadrature=quadrature,
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
        if self.skin_friction and self.viscosity == 0.0:
            raise ValueError(
                "viscosity is 0 and skin_friction is on: give a viscosity above 0 [m^2/s]"
            )


SWITCHES = tuple(each.name for each in fields(Water) if isinstance(each.default, bool))
"""Fields of `Water` that are on or off."""
