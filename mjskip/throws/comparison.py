"""MuJoCo against the pure integrator: the same throw over a ladder of time steps."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from mjskip._typing import Progress
from mjskip.checks import check_positive
from mjskip.errors import DivergedError, MjskipWarning
from mjskip.rigid.attitude import difference
from mjskip.throws.recording import Limits
from mjskip.throws.scene import Scene
from mjskip.throws.simulate import simulate
from mjskip.throws.trajectory import Trajectory

LADDER = (2e-3, 1e-3, 5e-4, 2e-4, 1e-4)
"""Time steps [s]; each is a multiple of the smallest, so that all runs share its moments."""

SOLVERS = (
    ("mujoco", "Euler"),
    ("mujoco", "implicitfast"),
    ("mujoco", "RK4"),
    ("reference", "euler"),
    ("reference", "midpoint"),
    ("reference", "rk4"),
)

LONGEST_TOUCH = 0.1
"""A touch that does not end is followed for this long [s]."""

ROUNDING = 1e-11
"""Differences below this [m or rad] are rounding and say nothing about order."""


@dataclass(frozen=True, kw_only=True)
class Differences:
    """Largest differences between two runs; not a number if one of them diverged.

    Attributes:
        timestep: [s].
        flight_position: before the first touch [m].
        flight_attitude: before the first touch [rad].
        touch_position: from there to the end of the first touch [m].
        touch_attitude: the same [rad].
    """

    timestep: float
    flight_position: float = math.nan
    flight_attitude: float = math.nan
    touch_position: float = math.nan
    touch_attitude: float = math.nan


@dataclass(frozen=True, kw_only=True)
class Row(Differences):
    """One solver at one time step: its differences from the yardstick, and its cost.

    Attributes:
        engine: "mujoco" or "reference".
        integrator: its name there.
        step_seconds: wall time of a step [s].
    """

    engine: str
    integrator: str
    step_seconds: float = math.nan


@dataclass(frozen=True, kw_only=True)
class Order:
    """Observed order of convergence of one solver; None where differences are mere rounding.

    Attributes:
        engine: "mujoco" or "reference".
        integrator: its name there.
        smooth_flight: of position and attitude of the same stone wobbling through heavy air, far from
            the water: the smaller of the two orders.
        touch: of the position at the end of the first touch, where triangles meeting the surface
            make kinks in the force.
    """

    engine: str
    integrator: str
    smooth_flight: float | None
    touch: float | None


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Outcome of `compare`.

    Attributes:
        touch_begins: [s].
        touch_ends: [s]; `LONGEST_TOUCH` after the beginning if the stone did not leave.
        left: whether it left the water.
        rows: differences from the yardstick.
        agreement: MuJoCo's RK4 and the pure RK4 at the same time step.
        orders: observed orders.
    """

    touch_begins: float
    touch_ends: float
    left: bool
    rows: tuple[Row, ...]
    agreement: tuple[Differences, ...]
    orders: tuple[Order, ...]


def compare(
    scene: Scene,
    *,
    timesteps: Sequence[float] = LADDER,
    progress: Progress | None = None,
) -> Comparison:
    """Run the chosen stone's throw by every solver at every time step.

    The yardstick is the pure integrator with SciPy's DOP853 at a relative tolerance of 1e-10.

    Args:
        scene: what to throw; only the chosen body is looked at.
        timesteps: [s], multiples of the smallest.
        progress: called with the runs done and to do.

    Raises:
        ValueError: a time step is not positive or no multiple of the smallest, or the stone does not
            touch the water.
    """
    ladder = _ladder(timesteps)
    fine = ladder[-1]
    scout = _run(scene, engine="reference", timestep=fine, limits=_until(2.0))
    if not scout.contacts:
        raise ValueError(
            "the stone does not touch the water within 2 s: throw it lower or downwards"
        )
    far_enough = scout.contacts[0].entry.time + LONGEST_TOUCH + 2.0 * ladder[0]
    long = _run(
        scene,
        engine="reference",
        integrator="adaptive",
        timestep=fine,
        limits=_until(far_enough),
    )
    touch = long.contacts[0]
    begins = touch.entry.time
    ends = min(begins + LONGEST_TOUCH, touch.exit.time if touch.exit else math.inf, long.time[-1])
    tumble, tumbling = _tumbling(scene, ladder)
    runs: dict[tuple[str, str, float], Trajectory] = {}
    smooth: dict[tuple[str, str], list[tuple[float, float]]] = {}
    rows: list[Row] = []
    for engine, integrator in SOLVERS:
        for step in ladder:
            if progress:
                progress(len(rows), len(SOLVERS) * len(ladder))
            options: dict[str, Any] = {"engine": engine, "integrator": integrator, "timestep": step}
            run = _attempt(scene, ends + step, options)
            row = Row(**options)
            if run is not None:
                runs[engine, integrator, step] = run
                cost = run.attributes["wall_seconds"] / (len(run.time) - 1)
                apart = _differences(run, long, begins, ends)
                row = Row(**asdict(apart), engine=engine, integrator=integrator, step_seconds=cost)
            rows.append(row)
            wobbled = _attempt(tumbling, tumble.time[-1], options)
            smooth.setdefault((engine, integrator), []).append(_last_apart(wobbled, tumble))
    pairs = [(runs.get(("mujoco", "RK4", h)), runs.get(("reference", "rk4", h))) for h in ladder]
    return Comparison(
        touch_begins=begins,
        touch_ends=ends,
        left=touch.exit is not None and ends == touch.exit.time,
        rows=tuple(rows),
        agreement=tuple(_differences(a, b, begins, ends) for a, b in pairs if a and b),
        orders=tuple(
            Order(
                engine=engine,
                integrator=integrator,
                smooth_flight=_lesser_order(ladder, smooth[engine, integrator]),
                touch=observed_order(
                    ladder,
                    [
                        r.touch_position
                        for r in rows
                        if (r.engine, r.integrator) == (engine, integrator)
                    ],
                ),
            )
            for engine, integrator in SOLVERS
        ),
    )


def observed_order(steps: Sequence[float], errors: Sequence[float]) -> float | None:
    """Slope of log error over log step at the three finest steps whose errors are above rounding.

    None if fewer than two are. Coarser steps say nothing: their errors saturate.
    """
    above = sorted((s, e) for s, e in zip(steps, errors, strict=True) if e > ROUNDING)[:3]
    if len(above) < 2:
        return None
    step, error = np.log(np.array(above)).T
    return float(np.polyfit(step, error, 1)[0])


def _last_apart(run: Trajectory | None, other: Trajectory) -> tuple[float, float]:
    """Differences of the last positions [m] and attitudes [rad]."""
    if run is None:
        return math.nan, math.nan
    position = float(np.linalg.norm(run.position[-1] - other.position[-1]))
    return position, float(difference(run.q[-1], other.q[-1]))


def _lesser_order(steps: Sequence[float], errors: Sequence[tuple[float, float]]) -> float | None:
    orders = [observed_order(steps, column) for column in zip(*errors, strict=True)]
    return min((order for order in orders if order is not None), default=None)


def _run(scene: Scene, **options: Any) -> Trajectory:
    """`simulate` without its warnings of coarse steps: they are the point of the ladder."""
    with warnings.catch_warnings(action="ignore", category=MjskipWarning):
        return simulate(scene, **options)


def _attempt(scene: Scene, until: float, options: dict[str, Any]) -> Trajectory | None:
    """The run, or None if it diverged."""
    try:
        return _run(scene, limits=_until(until), **options)
    except DivergedError:
        return None


def _ladder(timesteps: Sequence[float]) -> tuple[float, ...]:
    for step in timesteps:
        check_positive(timestep=step)
    ladder = tuple(sorted(set(timesteps), reverse=True))
    if not ladder:
        raise ValueError("no time steps: give at least one")
    for step in ladder:
        if abs(step / ladder[-1] - round(step / ladder[-1])) > 1e-6:
            raise ValueError(
                f"time step {step:g} s is no multiple of the smallest, {ladder[-1]:g} s"
            )
    return ladder


def _until(duration: float) -> Limits:
    """Limits that end a run by time, or by sinking out of reach."""
    return Limits(duration=duration, max_contact=1e9, sink_depth=1e9, rest_time=1e9)


def _tumbling(scene: Scene, ladder: Sequence[float]) -> tuple[Trajectory, Scene]:
    """A smooth flight that is hard to integrate: the stone wobbles at 20 rev/s through heavy air.

    It is thrown high up with a wobble of 5 rev/s, in air of 20 kg/m^3 so that drag curves its path within
    the tenth of a second that is followed.
    """
    turn = 2.0 * math.pi
    high = scene.rethrow(
        height=100.0, spin=20.0 * turn, wobble=5.0 * turn, attack=math.radians(30.0)
    )
    high = replace(high, water=replace(scene.water, air_density=20.0))
    until = max(round(0.1 / ladder[0]), 1) * ladder[0]
    yardstick: dict[str, Any] = {
        "engine": "reference",
        "integrator": "adaptive",
        "timestep": ladder[-1],
    }
    return _run(high, limits=_until(until), **yardstick), high


def _differences(run: Trajectory, other: Trajectory, begins: float, ends: float) -> Differences:
    """Before and during the touch, at the moments that both runs have."""
    spacing = other.time[1] - other.time[0]
    rows = np.rint(run.time / spacing).astype(int)
    shared = (rows < len(other.time)) & (run.time <= ends)
    rows, mine = rows[shared], np.flatnonzero(shared)
    position = np.linalg.norm(run.position[mine] - other.position[rows], axis=1)
    attitude = difference(run.q[mine], other.q[rows])
    flight = run.time[mine] < begins
    return Differences(
        timestep=run.attributes["timestep"],
        flight_position=float(position[flight].max(initial=0.0)),
        flight_attitude=float(attitude[flight].max(initial=0.0)),
        touch_position=float(position[~flight].max(initial=0.0)),
        touch_attitude=float(attitude[~flight].max(initial=0.0)),
    )
