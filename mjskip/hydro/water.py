"""The fluid: constants that travel together in one frozen object."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, Literal, get_args

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
        law: name of the force on an immersed face, a key of `mjskip.hydro.laws.LAWS`.

    Raises:
        ValueError: a density or the viscosity is negative or not finite, or the gate or the law is
            unknown.
    """

    density: float = 1000.0
    air_density: float = 1.2
    gate: Gate = "centre"
    law: str = "lee2010"
    buoyancy: bool = False
    skin_friction: bool = False
    viscosity: float = 1.0e-6

    @classmethod
    def floating(cls, **changes: Any) -> Water:
        """Water for what floats: it bears, it rubs, and it never gives energy (gate "local").

        Args:
            **changes: other fields, instead of the defaults.
        """
        preset: dict[str, Any] = {"buoyancy": True, "skin_friction": True, "gate": "local"}
        return cls(**{**preset, **changes})

    def __post_init__(self) -> None:
        for field in fields(self):
            value = getattr(self, field.name)
            if field.type in (float, "float") and not (math.isfinite(value) and value >= 0.0):
                unit = "m^2/s" if field.name == "viscosity" else "kg/m^3"
                raise ValueError(
                    f"{field.name} is {value!r}: give a finite number of at least 0 [{unit}]"
                )
        if self.skin_friction and self.viscosity == 0.0:
            raise ValueError(
                "viscosity is 0 and skin_friction is on: give a viscosity above 0 [m^2/s]"
            )
        if self.gate not in GATES:
            raise ValueError(f"gate is {self.gate!r}: use one of {', '.join(GATES)}")
        if self.law not in LAWS:
            raise ValueError(f"law is {self.law!r}: use one of {', '.join(LAWS)}")
