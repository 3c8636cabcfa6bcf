"""What a throw did: the motion at every step, and every touch of the water."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import xarray as xr

from mjskip.errors import MjskipError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Moment:
    """The stone as it meets or leaves the water.

    Attributes:
        time: [s].
        position: centre of mass (x, y, z) [m].
        velocity: of the centre of mass, world frame (x, y, z) [m/s].
        attack: tilt of the disc to the water against the heading, nose up [rad].
        bank: positive when the upper disc normal leans to the left of the heading [rad].
        spin: about the upper disc normal, counter-clockwise from above positive [rad/s].
    """

    time: float
    position: tuple[float, float, float]
    velocity: tuple[float, float, float]
    attack: float
    bank: float
    spin: float

    @property
    def speed(self) -> float:
        """Magnitude of the velocity [m/s]."""
        return float(np.linalg.norm(self.velocity))


@dataclass(frozen=True, kw_only=True)
class Contact:
    """One touch: from the lowest point meeting the water until nothing is wet.

    Attributes:
        entry: the stone as it touched.
        exit: as it left; None if it never did.
        depth: deepest immersion of the lowest point [m].
        impulse: of the water's force over the touch, world frame [N s].
        airtime: time in the air after it [s]; 0 if it never left. The last airtime of a run may
            be cut short by the end of the run.
    """

    entry: Moment
    exit: Moment | None
    depth: float
    impulse: tuple[float, float, float]
    airtime: float


@dataclass(frozen=True, kw_only=True)
class Trajectory:
    """One stone's motion, a row per step, in the world frame and SI units.

    Attributes:
        time: (n,) [s].
        x: centre of mass (n, 3) [m].
        q: body orientation (n, 4), w-x-y-z, body to world.
        P: momentum (n, 3) [kg m/s].
        L: angular momentum about the centre of mass (n, 3) [kg m^2/s].
        velocity: of the centre of mass (n, 3) [m/s].
        omega: angular velocity, world frame (n, 3) [rad/s].
        force: of the water on the stone (n, 3) [N].
        torque: of the water about the centre of mass (n, 3) [N m].
        air_force: of the air on the stone (n, 3) [N].
        wetted_area: immersed area of the stone's surface (n,) [m^2].
        wetted_centre: centroid of that immersed surface (n, 3) [m]; the centre of mass when dry.
        clearance: height of the lowest point above the surface (n,) [m]; negative when wet.
        contacts: touches in order of time.
        skips: touches that were followed by at least `min_airtime` in the air.
        end: why it ended: "sunk", "planing", "at rest", "on land" or "out of time".
        mass: [kg].
        attributes: provenance: scene, body, engine, integrator, timestep, throw, water, version.
    """

    time: Array
    x: Array
    q: Array
    P: Array
    L: Array
    velocity: Array
    omega: Array
    force: Array
    torque: Array
    air_force: Array
    wetted_area: Array
    wetted_centre: Array
    clearance: Array
    contacts: tuple[Contact, ...]
    skips: int
    end: str
    mass: float
    attributes: dict[str, Any] = field(default_factory=dict)
