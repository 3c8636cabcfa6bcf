"""From the motion of a stone to what it did: touches, skips, and why the run ended.

Both engines hand over nothing but motion; forces and immersion are worked out here from the same kernels.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from typing import Any

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_memory, check_number, check_positive, check_vector
from mjskip.errors import DivergedError
from mjskip.hydro.columns import CLEARANCE, LOAD, load_columns
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_and_immersion
from mjskip.rigid.attitude import angles, quaternions
from mjskip.rigid.state import STATE, state_columns
from mjskip.throws import _touch_kernels as kernels
from mjskip.throws.trajectory import ENDS, Contact, Moment, Trajectory

MAX_STEPS = 1e7
"""Of a run: minutes, and every step is kept."""

KEPT_BYTES = 2 * 8 * (2 + STATE + LOAD)
"""Of a step of a body: time, state, load and reaction, and as much while they are put together."""


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
        for each in fields(self):
            value = getattr(self, each.name)
            if each.name != "rest_speed":
                check_positive(**{each.name: value})
            object.__setattr__(self, each.name, check_number(each.name, value))

    def check_steps(self, timestep: float, *, bodies: int = 0) -> None:
        """Refuse a run that is too long, or whose record would not fit into memory.

        Args:
            timestep: [s].
            bodies: whose every step is kept; none if only outcomes are.

        Raises:
            ValueError: says how many steps, or bytes, it would be.
        """
        steps = self.duration / timestep
        if steps > MAX_STEPS:
            raise ValueError(
                f"duration {self.duration:g} s at {timestep:g} s a step makes {steps:.3g} steps: at most "
                f"{MAX_STEPS:g} are allowed; shorten the duration or lengthen the step"
            )
        check_memory(
            f"a record of {steps:.3g} steps of {bodies} bodies", KEPT_BYTES * steps * bodies,
            "shorten the duration or lengthen the step",
        )  # fmt: skip

    def rules(self, walls: tuple[float, float, float, float] | None = None) -> Array:
        """The limits as the kernels take them (RULES,).

        Args:
            walls: of a bounded field: west, east, south, north [m].
        """
        rules = np.empty(kernels.RULES)
        rules[: kernels.WEST] = astuple(self)
        unbounded = (-np.inf, np.inf, -np.inf, np.inf)
        rules[kernels.WEST :] = unbounded if walls is None else check_vector("walls", walls, 4)
        return rules


class Recorder:
    """Collects the motion of one stone, chunk by chunk, and says when it is over.

    Attributes:
        name: of the stone.
        stone: the body.
        end: why the run is over, one of `mjskip.throws.trajectory.ENDS`; None as long as it goes on.
    """

    def __init__(
        self,
        name: str,
        stone: Stone,
        water: Water,
        limits: Limits,
        *,
        gravity: Sequence[float] | Array,
        walls: tuple[float, float, float, float] | None = None,
    ) -> None:
        """Begin a record; `walls` are those of a bounded lake: west, east, south, north [m]."""
        self.name = name
        self.stone = stone
        self.end: str | None = None
        self._min_airtime = limits.min_airtime
        self._rules = limits.rules(walls)
        self._block = pack(stone, water, gravity=-float(gravity[2]))
        self._times: list[Array] = []
        self._states: list[Array] = []
        self._loads: list[Array] = []
        self._reactions: list[Array] = []
        self._memory = np.empty(kernels.MEMORY)
        self._touches = np.empty((0, kernels.TOUCH))
        kernels.begin(self._memory)

    def extend(
        self,
        times: Array,
        states: Array,
        loads: Array | None = None,
        reactions: Array | None = None,
    ) -> str | None:
        """Append motion (n,), (n, 18); the reason if the run is over within it.

        Args:
            times: (n,) [s].
            states: (n, 18), see `mjskip.rigid.state`.
            loads: (n, 17), see `mjskip.hydro.columns`; over still water if None.
            reactions: (n,) vertical force that the water was given back [N]; all of the load's if None.

        Raises:
            DivergedError: a state or a force is not finite.
        """
        if self.end is not None or len(times) == 0:
            return self.end
        with np.errstate(all="ignore"):
            loads = wrench_and_immersion(self._block, states) if loads is None else loads
        good = np.isfinite(states).all(axis=1) & np.isfinite(loads).all(axis=1)
        if not good.all():  # also after the end: what explodes has sunk for a moment
            raise self._diverged(times, states, int(np.argmin(good)))
        self._touches = np.vstack([self._touches, np.empty((len(times) // 2 + 1, kernels.TOUCH))])
        keep, end = kernels.follow_rows(
            self._rules, self.stone.radius, self._memory, times, states, loads[:, CLEARANCE],
            self._touches,
        )  # fmt: skip
        self._touches = self._touches[: int(self._memory[kernels.TOUCHES])]
        self._times.append(times[:keep])
        self._states.append(states[:keep])
        self._loads.append(loads[:keep])
        reactions = load_columns(loads).force[:, 2] if reactions is None else reactions
        self._reactions.append(reactions[:keep])
        if end != kernels.GOING_ON:
            self.end = tuple(ENDS)[end]
        return self.end

    def _diverged(self, times: Array, states: Array, row: int) -> DivergedError:
        before = states[:row] if row else self._states[-1] if self._states else states[:1]
        speed = np.linalg.norm(state_columns(before[-1]).velocity)
        return DivergedError(
            f"body {self.name!r} diverged at t = {times[row]:.6g} s: the water's force or the motion is "
            f"not finite (last finite speed {speed:.4g} m/s); use a smaller time step",
            body=self.name,
            time=float(times[row]),
        )

    def trajectory(self, attributes: dict[str, Any]) -> Trajectory:
        """All that was collected, with touches found and counted."""
        time, states = np.concatenate(self._times), np.vstack(self._states)
        state, load = state_columns(states), load_columns(np.vstack(self._loads))
        body_omega = np.einsum("nji,nj->ni", state.rotation, state.omega)
        contacts = self._contacts(time, states, load.force)
        return Trajectory(
            time=time,
            position=state.position,
            q=quaternions(state.rotation),
            P=self.stone.mass * state.velocity,
            L=np.einsum("nij,nj->ni", state.rotation, body_omega @ self.stone.inertia.T),
            velocity=state.velocity,
            omega=state.omega,
            force=load.force,
            torque=load.torque,
            air_force=load.air_force,
            water_load=np.concatenate(self._reactions),
            wetted_area=load.wetted_area,
            wetted_centre=load.wetted_centre,
            clearance=load.clearance,
            contacts=contacts,
            skips=kernels.skips(self._rules, self._memory),
            end=self.end or "out of time",
            mass=self.stone.mass,
            attributes=attributes,
        )

    def _contacts(self, time: Array, states: Array, force: Array) -> tuple[Contact, ...]:
        """The touches in order, with the motion at their moments and the impulse of each."""
        touches = self._touches.tolist()
        contacts = []
        for number, (entry, left, first, last, depth) in enumerate(touches, 1):
            until = touches[number][0] if number < len(touches) else float(time[-1])
            ended = not math.isnan(left)
            rows = slice(max(int(first) - 1, 0), int(last) + 1)
            impulse = np.asarray(np.trapezoid(force[rows], time[rows], axis=0))
            contacts.append(
                Contact(
                    entry=self._moment(time, states, entry),
                    exit=self._moment(time, states, left) if ended else None,
                    depth=depth,
                    impulse=_triple(impulse),
                    airtime=until - left if ended else 0.0,
                )
            )
        return tuple(contacts)

    def _moment(self, time: Array, states: Array, at: float) -> Moment:
        """The stone at time `at`, linear between rows."""
        row = int(np.clip(np.searchsorted(time, at), 1, max(len(time) - 1, 1)))
        if len(time) == 1:
            between = states[0]
        else:
            part = (at - time[row - 1]) / (time[row] - time[row - 1])
            between = (1.0 - part) * states[row - 1] + part * states[row]
        state = state_columns(between)
        normal = state.rotation @ self.stone.disc_normal
        attack, bank, spin = angles(normal / np.linalg.norm(normal), state.velocity, state.omega)
        return Moment(
            time=at,
            position=_triple(state.position),
            velocity=_triple(state.velocity),
            attack=float(attack),
            bank=float(bank),
            spin=float(spin),
        )


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
