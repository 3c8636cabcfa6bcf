"""The throw: how the stone leaves the hand. Its parameters are described in one table, `PARAMETERS`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.checks import as_number, check_number, check_type, fault
from mjskip.hydro.hull import Hull
from mjskip.hydro.stone import Stone
from mjskip.rigid.attitude import quaternions, release_attitude

TURN = 2.0 * math.pi
DEGREE = math.pi / 180.0


@dataclass(frozen=True, kw_only=True)
class State:
    """A rigid body at one moment, world frame.

    Attributes:
        position: of the centre of mass (3,) [m].
        q: orientation (4,), w-x-y-z, body to world.
        velocity: of the centre of mass (3,) [m/s].
        omega: angular velocity (3,) [rad/s].
    """

    position: Array
    q: Array
    velocity: Array
    omega: Array


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """One parameter of a throw, in SI units and as it is shown to people.

    Attributes:
        name: of the field of `Throw`.
        unit: SI, as in data sets.
        shown_unit: as at the command line.
        factor: from the shown unit to SI.
        low, high: allowed, both included, in the shown unit.
        text: what it is.
    """

    name: str = ""
    unit: str
    shown_unit: str
    factor: float = 1.0
    low: float
    high: float
    text: str

    def to_si(self, shown: object) -> float:
        """A value in the shown unit as SI; errors as for `check`."""
        number = as_number(shown)
        return self.check(shown if number is None else number * self.factor)

    def to_shown(self, value: float) -> float:
        """An SI value in the shown unit."""
        return value / self.factor

    def text_of(self, value: float) -> str:
        """An SI value for people, such as "20°" or "15 rev/s"."""
        unit = "°" if self.shown_unit == "degrees" else f" {self.shown_unit}"
        return f"{self.to_shown(value):.4g}{unit}"

    def check(self, value: object) -> float:
        """An SI value as a float.

        Raises:
            ValueError: it is no number or out of range; limits are given in the shown unit.
        """
        number = as_number(value)
        remedy = f"give a number between {self.low:g} and {self.high:g} {self.shown_unit}"
        if number is None:
            raise fault(self.name, value, remedy)
        if not self.low * self.factor <= number <= self.high * self.factor:
            raise ValueError(
                f"{self.name} is {self.to_shown(number):g} {self.shown_unit}: {remedy}"
            )
        return number


def _parameter(default: float, **about: Any) -> Any:
    """A field of `Throw`; `default` is in the shown unit."""
    parameter = Parameter(**about)
    return field(default=default * parameter.factor, metadata={"parameter": parameter})


_TILT: dict[str, Any] = {
    "unit": "rad", "shown_unit": "degrees", "factor": DEGREE, "low": -90.0, "high": 90.0,
}  # fmt: skip
_RATE: dict[str, Any] = {
    "unit": "rad s-1", "shown_unit": "rev/s", "factor": TURN, "low": -1e4, "high": 1e4,
}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Throw:
    """A throw along +x, in SI units and radians; `from_degrees` takes degrees and rev/s.

    Attributes:
        speed: of the centre of mass [m/s].
        spin: about the upper disc normal, counter-clockwise from above positive [rad/s].
        attack: tilt of the stone's face to the water, nose up [rad].
        descent: angle of the path below the horizontal [rad].
        bank: tilt to the side, positive when the upper normal leans left of the heading [rad].
        wobble: angular velocity across the axis, nose rising for negative values, as after an unclean
            release [rad/s].
        height: of the stone's lowest point above still water [m]; at 0 it touches as it is let go.

    Raises:
        ValueError: a value is not a number or outside what can be thrown.
    """

    speed: float = _parameter(
        12.0, unit="m s-1", shown_unit="m/s", low=0.0, high=1000.0, text="Speed of the throw."
    )
    spin: float = _parameter(15.0, **_RATE, text="Spin, counter-clockwise seen from above.")
    attack: float = _parameter(
        20.0, **_TILT, text="Tilt of the stone's face to the water, nose up."
    )
    descent: float = _parameter(6.0, **_TILT, text="Angle of the path below the horizontal.")
    bank: float = _parameter(0.0, **_TILT, text="Tilt to the side; positive leans left.")
    wobble: float = _parameter(
        0.0, **_RATE, text="Turning across the axis, as after an unclean release."
    )
    height: float = _parameter(
        0.3, unit="m", shown_unit="m", low=0.0, high=1000.0,
        text="Height of the lowest point above still water at release.",
    )  # fmt: skip

    def __post_init__(self) -> None:
        for name, parameter in PARAMETERS.items():
            object.__setattr__(self, name, parameter.check(getattr(self, name)))
        if math.sin(self.attack) ** 2 + math.sin(self.bank) ** 2 > 1.0:
            release_attitude(np.array([0.0, 0.0, 1.0]), self.attack, self.bank)  # says so

    @classmethod
    def from_degrees(
        cls,
        *,
        speed: float = 12.0,
        spin: float = 15.0,
        attack: float = 20.0,
        descent: float = 6.0,
        bank: float = 0.0,
        wobble: float = 0.0,
        height: float = 0.3,
    ) -> Throw:
        """The same throw in the units of the command line.

        Args:
            speed: of the centre of mass [m/s].
            spin: about the disc normal [rev/s].
            attack: tilt of the disc to the water against the heading, nose up [degrees].
            descent: of the path below the horizontal [degrees].
            bank: of the disc to the left of the heading [degrees].
            wobble: rate about an axis across the disc normal [rev/s].
            height: of the lowest point above the water [m].

        Raises:
            ValueError: a value is no number, or out of range.
        """
        shown = (speed, spin, attack, descent, bank, wobble, height)
        pairs = zip(PARAMETERS.values(), shown, strict=True)
        return cls(**{parameter.name: parameter.to_si(value) for parameter, value in pairs})

    def state(self, stone: Stone, *, x: float = 0.0, y: float = 0.0) -> State:
        """The stone as it leaves the hand.

        Args:
            stone: the body.
            x, y: place of its centre of mass [m].
        """
        check_type("stone", stone, Hull)
        x, y = check_number("x", x, unit="m"), check_number("y", y, unit="m")
        rotation = release_attitude(stone.disc_normal, self.attack, self.bank)
        lowest = float((stone.vertices @ rotation[2]).min())
        normal = rotation @ stone.disc_normal
        across = np.cross(
            normal, [1.0, 0.0, 0.0]
        )  # to the left of the heading, in the disc's plane
        if np.linalg.norm(across) < 1e-9:
            across = np.array([0.0, 1.0, 0.0])
        heading = np.array([math.cos(self.descent), 0.0, -math.sin(self.descent)])
        return State(
            position=np.array([x, y, self.height - lowest]),
            q=quaternions(rotation[None])[0],
            velocity=self.speed * heading,
            omega=self.spin * normal + self.wobble * across / np.linalg.norm(across),
        )


PARAMETERS: Mapping[str, Parameter] = {
    each.name: replace(each.metadata["parameter"], name=each.name) for each in fields(Throw)
}
"""The parameters of a throw by name, in the order of `Throw`."""
