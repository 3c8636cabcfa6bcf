"""Spray that a stone throws up: drawn only, no stone and no wave feels it.

Packets of water leave the wet edge as long as a touch is recorded, ahead and to both sides, flatly as a sheet
that tears into drops. Each takes a share of what the stone gives to the water in that time: its momentum

    sum of m |u|  <=  SPRAY_FRACTION |integral of F dt|,      sum of m u^2 / 2  <=  SPRAY_FRACTION integral of -F . v dt

from the beginning of the touch to any moment of it, so that the spray never holds more momentum or energy than the
water was given. From there on packets fall freely, without drag, until they are back in the water.
Where a stone goes under, bubbles rise along its way.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, SingleArray
from mjskip.throws.trajectory import Trajectory

SPRAY_FRACTION = 0.25
"""Of momentum and energy of a touch, at most, that is in its spray."""

_SECTORS = 24  # packets around the wet edge at a time
_PULSE = 2e-3  # [s] between two times
_DROPS = 3  # drawn for a packet
_SHEET = 0.06  # [s] after which the sheet has torn
_RISE = 0.22  # [m/s] of bubbles of some millimetres
_BUBBLES = 120


class Spray:
    """The spray of one flight.

    Attributes:
        birth: when each packet left the edge (n,) [s].
        origin: where (n, 3) [m].
        velocity: with which (n, 3) [m/s].
        mass: of each (n,) [kg].
    """

    def __init__(self, flight: Trajectory, *, density: float = 1000.0, seed: int = 0) -> None:
        """Work out the packets of a flight over water of this density [kg/m^3]."""
        self._random = np.random.default_rng(seed)
        self._gravity = float(np.linalg.norm(flight.attributes.get("gravity", 9.81)))
        self._density = density
        pulses = [
            pulse for first, last in touches(flight) for pulse in self._pulses(flight, first, last)
        ]
        columns = [np.concatenate(column) for column in zip(*pulses, strict=True)] or [
            np.zeros(shape) for shape in (0, (0, 3), (0, 3), 0)
        ]
        self.birth: Array = columns[0]
        self.origin: Array = columns[1]
        self.velocity: Array = columns[2]
        self.mass: Array = columns[3]
        # drops of a packet, in its neighbourhood: their mean is the packet's own velocity
        jitter = self._random.normal(0.0, 0.16, (len(self.mass), _DROPS, 3))
        jitter -= jitter.mean(axis=1, keepdims=True)
        speed = np.linalg.norm(self.velocity, axis=1)
        self._drops = self.velocity[:, None] * 0.97 + 0.24 * speed[:, None, None] * jitter
        self._bubbles = _bubbles(flight, self._random)

    def _pulses(self, flight: Trajectory, first: int, last: int) -> list[tuple[Array, ...]]:
        """Packets of one touch, the rows first to last: (time, origin, velocity, mass) of each pulse."""
        step = np.diff(flight.time[first : last + 1])
        force, speed = flight.force[first:last], flight.velocity[first:last]
        momentum = np.linalg.norm(np.cumsum(force * step[:, None], axis=0), axis=1)
        energy = np.cumsum(-np.sum(force * speed, axis=1) * step)
        pulses: list[tuple[Array, ...]] = []
        used_momentum = used_energy = 0.0
        stride = max(1, round(_PULSE / max(float(step.mean()), 1e-9))) if len(step) else 1
        for row in range(stride - 1, last - first, stride):
            v, area = speed[row], flight.wetted_area[first + row]
            radius = math.sqrt(0.5 * area / math.pi)  # two faces are wet
            level = math.hypot(v[0], v[1])
            if level < 0.5 or radius <= 0.0:
                continue
            turn = np.linspace(-1.9, 1.9, _SECTORS) + self._random.normal(0.0, 0.05, _SECTORS)
            heading = math.atan2(v[1], v[0]) + turn
            fast = level * (0.30 + 0.16 * np.cos(turn)) * self._random.uniform(0.75, 1.1, _SECTORS)
            rise = np.radians(38.0) * self._random.uniform(0.5, 1.2, _SECTORS)
            out = np.column_stack([np.cos(heading), np.sin(heading), np.zeros(_SECTORS)])
            velocity = fast[:, None] * (
                np.cos(rise)[:, None] * out + np.outer(np.sin(rise), [0, 0, 1])
            )
            # as much water as both budgets still allow
            left_momentum = max(SPRAY_FRACTION * momentum[row] - used_momentum, 0.0)
            left_energy = max(SPRAY_FRACTION * energy[row] - used_energy, 0.0)
            mass = min(left_momentum / fast.sum(), left_energy / (0.5 * np.sum(fast**2)))
            if mass <= 0.0:
                continue
            used_momentum += mass * float(fast.sum())
            used_energy += mass * 0.5 * float(np.sum(fast**2))
            x, y, _ = flight.wetted_centre[first + row]
            origin = radius * out + [x, y, 0.002]
            born = np.full(_SECTORS, flight.time[first + row])
            pulses.append((born, origin, velocity, np.full(_SECTORS, mass)))
        return pulses

    def drops(self, time: float) -> SingleArray:
        """Drops and bubbles in sight at a time [s]: (n, 5) place and radius [m], opacity 0 to 1."""
        age = time - self.birth
        air = np.flatnonzero((age > 0.0) & (age < 2.0))
        radius = np.cbrt(3.0 * self.mass[air] / _DROPS / (4.0 * math.pi * self._density))
        place = self._fallen(air, age, self._drops[air])
        fade = np.clip(age[air] / (0.5 * _SHEET), 0.0, 1.0) * np.exp(-age[air] / 0.8)
        rows = np.concatenate(
            [place, np.broadcast_to(radius[:, None, None], (*place.shape[:2], 1)),
             np.broadcast_to(fade[:, None, None], (*place.shape[:2], 1))], axis=2,
        ).reshape(-1, 5)  # fmt: skip
        rows = rows[rows[:, 2] > 0.0]
        born, start = self._bubbles[:, 0], self._bubbles[:, 1:]
        rising = time - born
        up = start + np.outer(rising, [0.0, 0.0, _RISE])
        there = (rising > 0.0) & (up[:, 2] < -0.004)
        bubbles = np.column_stack([up, np.full(len(up), 2.5e-3), np.full(len(up), 0.5)])[there]
        return np.concatenate([rows, bubbles]).astype(np.float32)

    def sheet(self, time: float) -> SingleArray:
        """The sheet before it tears, at a time [s]: triangles as (n, 4), place [m] and opacity."""
        age = time - self.birth
        flying = (age > 0.0) & (age < _SHEET)
        rows = np.flatnonzero(flying.reshape(-1, _SECTORS).all(axis=1))
        rows = rows[:-1][np.diff(rows) == 1]  # each to the pulse after it
        rows = rows[np.abs(self.birth[rows * _SECTORS] - self.birth[(rows + 1) * _SECTORS]) < 0.01]
        if not len(rows):
            return np.zeros((0, 4), np.float32)
        corner = (rows[:, None] * _SECTORS + np.arange(_SECTORS - 1)).ravel()
        quads = corner[:, None] + [0, 1, _SECTORS, _SECTORS, 1, _SECTORS + 1]
        index = quads.ravel()
        place = self._fallen(index, age, self.velocity[index][:, None])[:, 0]
        opacity = 0.35 * (1.0 - age[index] / _SHEET) ** 1.5
        return np.column_stack([place, opacity]).astype(np.float32)

    def _fallen(self, rows: npt.NDArray[np.intp], age: Array, velocity: Array) -> Array:
        """Where packets are that left with velocities (n, k, 3): (n, k, 3) [m]."""
        since = age[rows][:, None, None]
        fall = np.array([0.0, 0.0, 0.5 * self._gravity]) * since**2
        return np.asarray(self.origin[rows][:, None] + velocity * since - fall)


def touches(flight: Trajectory) -> list[tuple[int, int]]:
    """First row and one past the last of every stretch in which a stone is loaded by the water."""
    wet = np.any(flight.force != 0.0, axis=1).astype(np.int8)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], wet, [0]])))
    last = len(flight.time) - 1
    return [(int(a), min(int(b), last)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _bubbles(flight: Trajectory, random: np.random.Generator) -> Array:
    """Where a stone is wholly under water: (n, 4) time [s] and place [m] at which bubbles leave it."""
    under = np.flatnonzero(flight.position[:, 2] < -0.02)
    rows = under[np.linspace(0, len(under) - 1, _BUBBLES).astype(np.intp)] if len(under) else under
    place = flight.position[rows] + random.normal(0.0, 0.015, (len(rows), 3))
    return np.column_stack([flight.time[rows] + random.uniform(0.0, 0.3, len(rows)), place])
