"""Many throws at once by the pure integrator, over threads: what each did, not how it moved."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from mjskip._typing import Array, Integers
from mjskip.checks import (
    check_choice,
    check_count,
    check_positive,
    check_type,
    check_vector,
    fault,
)
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack
from mjskip.rigid._rigid_kernels import BODY as RIGID_BODY
from mjskip.rigid._rigid_kernels import SIZE
from mjskip.sweeps import _batch_kernels as kernels
from mjskip.throws._touch_kernels import RULES as TOUCH_RULES
from mjskip.throws.recording import Limits
from mjskip.throws.reference import (
    FIXED_STEP,
    FixedStep,
    rigid_body,
    start_of,
    state_at_release,
)
from mjskip.throws.throw import State, Throw
from mjskip.throws.trajectory import ENDS, GRAVITY

Air = Literal["fixed", "adaptive"]
AIRS: tuple[Air, ...] = get_args(Air)

AIR_TOLERANCE = 1e-8
"""Error of one long step in the air: of the position [m], and of the momentum as a part of it."""

PIECE = 8
"""Throws that a thread takes at a time: some sink at once, others skip for seconds."""


MAX_THREADS = 1024


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Outcomes:
    """What n throws did; NaN where there is nothing to say.

    Attributes:
        skips: touches that were followed by at least `min_airtime` in the air (n,).
        touches: touches of the water (n,).
        end: why it ended, one of `mjskip.throws.trajectory.ENDS` (n,).
        time: when it ended (n,) [s].
        distance: along the throw, from release to the end (n,) [m].
        drift: to the left of the throw, from release to the end (n,) [m].
        depth: deepest immersion of the lowest point in any touch (n,) [m].
        first_entry: time of the first touch (n,) [s].
        first_exit: time at which it left the water for the first time (n,) [s].
        exit_velocity: of the centre of mass at that moment (n, 3) [m/s].
        steps: time steps taken (n,).
    """

    skips: Integers
    touches: Integers
    end: npt.NDArray[np.str_]
    time: Array
    distance: Array
    drift: Array
    depth: Array
    first_entry: Array
    first_exit: Array
    exit_velocity: Array
    steps: Integers

    @property
    def exit_speed(self) -> Array:
        """Speed as it first left the water (n,) [m/s]."""
        return np.asarray(np.linalg.norm(self.exit_velocity, axis=1), dtype=np.float64)

    @property
    def exit_climb(self) -> Array:
        """Vertical velocity as it first left the water (n,) [m/s]."""
        return self.exit_velocity[:, 2]

    def __repr__(self) -> str:
        return f"Outcomes({len(self.skips)} throws, {self.skips.sum()} skips)"


def throw_all(
    stone: Stone | Sequence[Stone],
    throws: Sequence[Throw | State],
    *,
    water: Water | Sequence[Water] | None = None,
    integrator: FixedStep = "rk4",
    timestep: float = 5e-4,
    limits: Limits | None = None,
    gravity: Sequence[float] = GRAVITY,
    frozen_attitude: bool = False,
    air: Air = "adaptive",
    threads: int | None = None,
) -> Outcomes:
    """Throw many stones over still water, each on its own.

    The same motion, to the last bit, as `mjskip.integrate` at the same fixed step with air="fixed". With
    air="adaptive" stretches in the air are taken in long steps and the touch is located within one, which
    is faster and nearer to the exact motion. The result does not depend on the number of threads.

    Args:
        stone: the body, or one for every throw.
        throws: how each is released, above (0, 0); or its state at release.
        water: the fluid, or one for every throw; `Water()` if omitted.
        integrator: "euler" (explicit), "midpoint" or "rk4".
        timestep: [s].
        limits: what counts as a skip and when a throw is over; `Limits()` if omitted.
        gravity: (3,) [m/s^2].
        frozen_attitude: stones cannot turn (infinite inertia).
        air: "fixed" or "adaptive".
        threads: that share the work; as many as there are processors if None.

    Raises:
        ValueError: a value is not allowed.
    """
    limits = Limits() if limits is None else check_type("limits", limits, Limits)
    check_positive(timestep=timestep)
    limits.check_steps(timestep)
    check_choice("integrator", integrator, FIXED_STEP)
    check_choice("air", air, AIRS)
    if not isinstance(throws, Sequence):
        raise fault("throws", throws, "give a row of throws")
    count = len(throws)
    stones = _each("stone", stone, Stone, count)
    waters = _each("water", Water() if water is None else water, Water, count)
    pairs = zip(stones, throws, strict=True)
    starts = np.array([start_of(each, state_at_release(each, t)) for each, t in pairs])
    starts = starts.reshape(count, SIZE)
    table = _Table(stones, waters, check_vector("gravity", gravity, 3), frozen_attitude)
    rules = np.zeros(kernels.RULES)
    rules[:TOUCH_RULES] = limits.rules()
    rules[kernels.TIMESTEP], rules[kernels.METHOD] = timestep, FIXED_STEP[integrator]
    rules[kernels.AIR_TOLERANCE] = AIR_TOLERANCE if air == "adaptive" else 0.0
    out = np.empty((count, kernels.OUT))

    def throw_piece(first: int) -> None:
        rows = slice(first, first + PIECE)
        kernels.throw_many(
            table.bodies, table.which[rows], rules, table.vertices, starts[rows], out[rows]
        )

    workers = processors() if threads is None else check_count("threads", threads, high=MAX_THREADS)
    if workers == 1 or count <= PIECE:
        for first in range(0, count, PIECE):
            throw_piece(first)
    else:
        throw_piece(0)  # compiles, if need be, before threads wait for each other
        with ThreadPoolExecutor(workers) as pool:
            for _ in pool.map(throw_piece, range(PIECE, count, PIECE)):
                pass
    return _outcomes(out)


def processors() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0))


def _each(name: str, given: Any, kind: type, count: int) -> list[Any]:
    found = [given] * count if isinstance(given, kind) else given
    if not isinstance(found, Sequence) or not all(isinstance(one, kind) for one in found):
        raise fault(name, given, f"give a mjskip.{kind.__name__}, or one for every throw")
    if len(found) != count:
        raise ValueError(f"{len(found)} of {name} for {count} throws: give one, or one for each")
    return list(found)


class _Table:
    """The different stones in their waters, for the kernel.

    Attributes:
        which: the row of `bodies` of every throw (n,).
        bodies: (m, BODY).
        vertices: of all stones, one after the other.
    """

    def __init__(
        self, stones: list[Stone], waters: list[Water], gravity: Array, frozen: bool
    ) -> None:
        rows: dict[tuple[int, Water], int] = {}
        places: dict[int, int] = {}  # of a stone's vertices
        bodies: list[Array] = []
        vertices = [np.empty((0, 3))]
        self.which = np.empty(len(stones), dtype=np.int64)
        self._blocks = []  # the kernel has their addresses
        for k, (stone, water) in enumerate(zip(stones, waters, strict=True)):
            key = (id(stone), water)
            if key not in rows:
                rows[key] = len(bodies)
                if id(stone) not in places:
                    places[id(stone)] = sum(map(len, vertices))
                    vertices.append(stone.vertices)
                block = pack(stone, water, gravity=-float(gravity[2]))
                self._blocks.append(block)
                bodies.append(_body(stone, block, places[id(stone)], gravity, frozen))
            self.which[k] = rows[key]
        self.bodies = np.array(bodies).reshape(-1, kernels.BODY)
        self.vertices = np.vstack(vertices)


def _body(stone: Stone, block: Array, place: int, gravity: Array, frozen: bool) -> Array:
    """What the kernel knows a stone by (BODY,)."""
    axis = stone.disc_normal
    along = stone.vertices @ axis
    largest = float(axis @ stone.inertia @ axis)
    across = 0.5 * (float(np.trace(stone.inertia)) - largest)
    ideal = across * np.eye(3) + (largest - across) * np.outer(axis, axis)
    round_ = np.allclose(stone.inertia, ideal, rtol=0.0, atol=1e-9 * largest)
    body = np.zeros(kernels.BODY)
    body[:RIGID_BODY] = rigid_body(stone, block, gravity, frozen_attitude=frozen)
    body[kernels.RADIUS] = stone.radius
    body[kernels.REACH] = np.linalg.norm(stone.vertices - np.outer(along, axis), axis=1).max()
    body[kernels.HALF] = np.abs(along).max()
    # the air turns a stone whose disc is off its centre
    body[kernels.ROUND] = frozen or (round_ and not stone.disc_centre.any())
    body[kernels.AXIS : kernels.AXIS + 3] = axis
    if not frozen:
        body[kernels.PRECESSION] = 1.0 / across
        body[kernels.SPINNING] = 1.0 / largest - 1.0 / across
    body[kernels.FIRST], body[kernels.LAST] = place, place + len(stone.vertices)
    return body


def _outcomes(out: Array) -> Outcomes:
    def whole(column: int) -> Integers:
        return out[:, column].astype(np.int64)

    return Outcomes(
        skips=whole(kernels.SKIPS),
        touches=whole(kernels.TOUCHES),
        end=np.array(list(ENDS))[whole(kernels.END)],
        time=out[:, kernels.TIME],
        distance=out[:, kernels.DISTANCE],
        drift=out[:, kernels.DRIFT],
        depth=out[:, kernels.DEPTH],
        first_entry=out[:, kernels.FIRST_ENTRY],
        first_exit=out[:, kernels.FIRST_EXIT],
        exit_velocity=out[:, kernels.EXIT_VELOCITY : kernels.EXIT_VELOCITY + 3],
        steps=whole(kernels.STEPS),
    )
