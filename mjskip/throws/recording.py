"""From the motion of a stone to what it did: touches, skips, and why the run ended.

Both engines hand over nothing but motion; forces and immersion are worked out here from the same kernels.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from mjskip.checks import check_positive
from mjskip.errors import DivergedError
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.rigid.attitude import angles, quaternions
from mjskip.throws.trajectory import Contact, Moment, Trajectory

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """What counts as a skip, and when a run is over.

    Attributes:
        duration: longest simulated time [s].
        min_airtime: shortest time in the air after a touch that makes it a skip [s].
        max_contact: longest touch; a longer one is planing and ends the run [s].
        sink_depth: depth of the centre of mass at which a stone has sunk, in bounding radii.
        rest_speed: a stone slower than this, and turning no faster than this over its radius, for
            `rest_time` is at rest [m/s].
        rest_time: [s].
    """

    duration: float = 5.0
    min_airtime: float = 0.010
    max_contact: float = 0.5
    sink_depth: float = 4.0
    rest_speed: float = 0.005
    rest_time: float = 0.2

    def __post_init__(self) -> None:
        check_positive(
            duration=self.duration,
            min_airtime=self.min_airtime,
            max_contact=self.max_contact,
            sink_depth=self.sink_depth,
            rest_time=self.rest_time,
        )


class Log:
    """Collects the motion of one stone, chunk by chunk, and says when it is over."""

    def __init__(
        self,
        name: str,
        stone: Stone,
        water: Water,
        limits: Limits,
        *,
        gravity: float = 9.81,
        inside: Callable[[float, float], bool] | None = None,
    ) -> None:
        """Begin a log; `inside` says whether a place (x, y) [m] is over the lake, always if None."""
        self.name = name
        self.stone = stone
        self.limits = limits
        self.end: str | None = None
        self._inside = inside
        self._block = pack(stone, water, gravity=gravity)
        self._times: list[Array] = []
        self._states: list[Array] = []
        self._observed: list[Array] = []
        self._shares: list[Array] = []
        self._since_dry = 0.0  # time of the last moment after which it was never dry for long
        self._since_fast = 0.0
        self._left: float | None = None  # time at which it last became dry

    def extend(
        self,
        times: Array,
        states: Array,
        observed: Array | None = None,
        shares: Array | None = None,
    ) -> str | None:
        """Append motion (n,), (n, 18); the reason if the run is over within it.

        Args:
            times: (n,) [s].
            states: (n, 18), for the force kernel.
            observed: (n, 17) as `mjskip.hydro.wrench.wrench_and_immersion`; over still water if None.
            shares: (n,) of the vertical force that the water was given back; 1 if None.

        Raises:
            DivergedError: a state or a force is not finite.
        """
        if self.end is not None or len(times) == 0:
            return self.end
        with np.errstate(all="ignore"):
            observed = wrench_and_immersion(self._block, states) if observed is None else observed
        good = np.isfinite(states).all(axis=1) & np.isfinite(observed).all(axis=1)
        if not good.all():
            k = int(np.argmin(good))
            last = states[k - 1] if k else (self._states[-1][-1] if self._states else states[0])
            raise DivergedError(
                f"body {self.name!r} diverged at t = {times[k]:.6g} s: the water's force or the motion "
                f"is not finite (last finite speed {np.linalg.norm(last[12:15]):.4g} m/s); use a "
                "smaller time step",
                body=self.name,
                time=float(times[k]),
            )
        self.end, keep = self._verdict(times, states, observed[:, 16])
        self._times.append(times[:keep])
        self._states.append(states[:keep])
        self._observed.append(observed[:keep])
        self._shares.append(np.ones(keep) if shares is None else shares[:keep])
        return self.end

    def _verdict(self, times: Array, states: Array, clearance: Array) -> tuple[str | None, int]:
        """Why the run is over, if it is, and how many of these rows belong to it."""
        limits, radius = self.limits, self.stone.radius
        speed = np.sqrt((states[:, 12:15] ** 2).sum(axis=1))
        turning = radius * np.sqrt((states[:, 15:18] ** 2).sum(axis=1))
        moving = np.maximum(speed, turning) > limits.rest_speed
        sunk = states[:, 2] < -limits.sink_depth * radius
        columns = (times, clearance, moving, sunk, states[:, 0], states[:, 1])
        rows = zip(*(column.tolist() for column in columns), strict=True)
        for k, (time, clear, moves, sinks, x, y) in enumerate(rows):
            if clear >= 0.0:
                self._left = time if self._left is None else self._left
                if time - self._left >= limits.min_airtime:
                    self._since_dry = time
            else:
                self._left = None
            if moves:
                self._since_fast = time
            if sinks:
                return "sunk", k + 1
            if self._inside is not None and not self._inside(x, y):
                return "left the lake", k + 1
            if time - self._since_fast >= limits.rest_time:
                return "at rest", k + 1
            if time - self._since_dry > limits.max_contact and clear < 0.0:
                return "planing", k + 1
            if time >= limits.duration * (1.0 - 1e-12):
                return "out of time", k + 1
        return None, len(times)

    def trajectory(self, attributes: dict[str, Any]) -> Trajectory:
        """All that was collected, with touches found and counted."""
        time = np.concatenate(self._times)
        states = np.vstack(self._states)
        seen = np.vstack(self._observed)
        rotation = states[:, 3:12].reshape(-1, 3, 3)
        omega = states[:, 15:18]
        body_omega = np.einsum("nji,nj->ni", rotation, omega)
        contacts = find_contacts(
            time, states, seen, self.stone.disc_normal, min_airtime=self.limits.min_airtime
        )
        return Trajectory(
            time=time,
            x=states[:, 0:3],
            q=quaternions(rotation),
            P=self.stone.mass * states[:, 12:15],
            L=np.einsum("nij,nj->ni", rotation, body_omega @ self.stone.inertia.T),
            velocity=states[:, 12:15],
            omega=omega,
            force=seen[:, 0:3],
            torque=seen[:, 3:6],
            air_force=seen[:, 6:9],
            water_load=seen[:, 2] * np.concatenate(self._shares),
            wetted_area=seen[:, 12],
            wetted_centre=seen[:, 13:16],
            clearance=seen[:, 16],
            contacts=contacts,
            skips=sum(contact.airtime >= self.limits.min_airtime for contact in contacts),
            end=self.end or "out of time",
            mass=self.stone.mass,
            attributes=attributes,
        )


def find_contacts(
    time: Array, states: Array, seen: Array, normal_body: Array, *, min_airtime: float
) -> tuple[Contact, ...]:
    """Touches of the water in a motion, in order.

    A touch begins when the lowest point meets the water and ends when nothing is wet. Dry spells
    shorter than `min_airtime` belong to the touch around them. The moments of entry and exit are
    found between rows, where the clearance crosses zero.

    Args:
        time: (n,) [s].
        states: (n, 18), for the force kernel.
        seen: (n, 17), from `mjskip.hydro.wrench.wrench_and_immersion`.
        normal_body: upper disc normal in body axes (3,).
        min_airtime: [s].
    """
    clearance = seen[:, 16]
    wet = np.concatenate([[False], clearance < 0.0, [False]])
    change = np.flatnonzero(wet[1:] != wet[:-1])
    crossings = [
        (_crossing(time, clearance, first), _crossing(time, clearance, last), first, last)
        for first, last in change.reshape(-1, 2)
    ]
    merged: list[tuple[float, float, int, int]] = []
    for crossing in crossings:
        if merged and crossing[0] - merged[-1][1] < min_airtime:
            merged[-1] = (merged[-1][0], crossing[1], merged[-1][2], crossing[3])
        else:
            merged.append(crossing)
    contacts = []
    for number, (enters, leaves, first, last) in enumerate(merged):
        rows = slice(max(first - 1, 0), min(last + 1, len(time)))
        dry_after = last < len(time)
        until = merged[number + 1][0] if number + 1 < len(merged) else float(time[-1])
        contacts.append(
            Contact(
                entry=_moment(time, states, normal_body, enters),
                exit=_moment(time, states, normal_body, leaves) if dry_after else None,
                depth=float(-clearance[first:last].min()),
                impulse=_triple(np.asarray(np.trapezoid(seen[rows, 0:3], time[rows], axis=0))),
                airtime=until - leaves if dry_after else 0.0,
            )
        )
    return tuple(contacts)


def _crossing(time: Array, clearance: Array, row: int) -> float:
    """Time between row - 1 and row at which the clearance is zero; the end rows if outside."""
    if row == 0 or row == len(time):
        return float(time[min(row, len(time) - 1)])
    before, after = clearance[row - 1], clearance[row]
    return float(time[row - 1] + before / (before - after) * (time[row] - time[row - 1]))


def _moment(time: Array, states: Array, normal_body: Array, at: float) -> Moment:
    """The stone at time `at`, linear between rows."""
    row = int(np.clip(np.searchsorted(time, at), 1, max(len(time) - 1, 1)))
    if len(time) == 1:
        state = states[0]
    else:
        part = (at - time[row - 1]) / (time[row] - time[row - 1])
        state = (1.0 - part) * states[row - 1] + part * states[row]
    normal = state[3:12].reshape(3, 3) @ normal_body
    attack, bank, spin = angles(normal / np.linalg.norm(normal), state[12:15], state[15:18])
    return Moment(
        time=at,
        position=_triple(state[0:3]),
        velocity=_triple(state[12:15]),
        attack=float(attack),
        bank=float(bank),
        spin=float(spin),
    )


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
