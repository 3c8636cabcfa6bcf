"""The throw: how the stone leaves the hand."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from mjskip.hydro.stone import Stone
from mjskip.rigid.attitude import quaternions, released

Array = npt.NDArray[np.float64]


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
        ValueError: a value is not finite or outside what can be thrown.
    """

    speed: float = 12.0
    spin: float = 15.0 * 2.0 * math.pi
    attack: float = math.radians(20.0)
    descent: float = math.radians(6.0)
    bank: float = 0.0
    wobble: float = 0.0
    height: float = 0.3

    def __post_init__(self) -> None:
        quarter = 0.5 * math.pi
        allowed = {  # inclusive limits, unit, and how a unit is shown to people
            "speed": (0.0, 1000.0, "m/s", 1.0),
            "spin": (-1e4 * 2.0 * math.pi, 1e4 * 2.0 * math.pi, "rev/s", 0.5 / math.pi),
            "attack": (-quarter, quarter, "degrees", 180.0 / math.pi),
            "descent": (-quarter, quarter, "degrees", 180.0 / math.pi),
            "bank": (-quarter, quarter, "degrees", 180.0 / math.pi),
            "wobble": (-1e4 * 2.0 * math.pi, 1e4 * 2.0 * math.pi, "rev/s", 0.5 / math.pi),
            "height": (0.0, 1000.0, "m", 1.0),
        }
        for name, (low, high, unit, shown) in allowed.items():
            value = getattr(self, name)
            if not (math.isfinite(value) and low <= value <= high):
                raise ValueError(
                    f"{name} is {value * shown:g} {unit}: give a number between "
                    f"{low * shown:g} and {high * shown:g} {unit}"
                )
        if math.sin(self.attack) ** 2 + math.sin(self.bank) ** 2 > 1.0:
            released(np.array([0.0, 0.0, 1.0]), self.attack, self.bank)  # says so

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
        """The same throw with angles in degrees, spin and wobble in revolutions per second."""
        return cls(
            speed=speed,
            spin=spin * 2.0 * math.pi,
            attack=math.radians(attack),
            descent=math.radians(descent),
            bank=math.radians(bank),
            wobble=wobble * 2.0 * math.pi,
            height=height,
        )

    def state(self, stone: Stone, *, x: float = 0.0, y: float = 0.0) -> State:
        """The stone as it leaves the hand above (x, y) [m]."""
        rotation = released(stone.disc_normal, self.attack, self.bank)
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
