"""Many throws at once by the pure integrator, over threads: what each did, not how it moved."""

from __future__ import annotations

import os
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from mjskip.checks import check_positive
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_address
from mjskip.rigid.attitude import matrices
from mjskip.sweeps import _batch_kernels as kernels
from mjskip.throws.recording import Limits
from mjskip.throws.throw import State, Throw

Array = npt.NDArray[np.float64]
Method = Literal["euler", "midpoint", "rk4"]
METHODS: tuple[Method, ...] = get_args(Method)
Air = Literal["fixed", "adaptive"]
AIRS: tuple[Air, ...] = get_args(Air)

ENDS = ("sunk", "at rest", "planing", "out of time", "diverged")
"""How a throw can end, in the order of the kernel's codes."""

AIR_TOLERANCE = 1e-8
"""Error of one long step in the air: of the position [m], and of the momentum as a part of it."""

PIECE = 8
"""Throws that a thread takes at a time: some sink at once, others skip for seconds."""


@dataclass(frozen=True, kw_only=True)
class Outcomes:
    """What n throws did; NaN where there is nothing to say.

    Attributes:
        skips: touches that were followed by at least `min_airtime` in the air (n,).
        touches: touches of the water (n,).
        end: why it ended, an index into `ENDS` (n,).
        time: when it ended (n,) [s].
        distance: along the throw, from release to the end (n,) [m].
        drift: to the left of the throw, from release to the end (n,) [m].
        depth: deepest immersion of the lowest point in any touch (n,) [m].
        entry: time of the first touch (n,) [s].
        exit: time at which it left the water for the first time (n,) [s].
        exit_velocity: of the centre of mass at that moment (n, 3) [m/s].
        steps: time steps taken (n,).
    """

    skips: npt.NDArray[np.int64]
    touches: npt.NDArray[np.int64]
    end: npt.NDArray[np.int64]
    time: Array
    distance: Array
    drift: Array
    depth: Array
    entry: Array
    exit: Array
    exit_velocity: Array
    steps: npt.NDArray[np.int64]


def throw_all(
    stone: Stone | Sequence[Stone],
    throws: Sequence[Throw | State],
    *,
    water: Water | Sequence[Water] | None = None,
    method: Method = "rk4",
    timestep: float = 5e-4,
    limits: Limits | None = None,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
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
        method: "euler" (explicit), "midpoint" or "rk4".
        timestep: [s].
        limits: what counts as a skip and when a throw is over; `Limits()` if omitted.
        gravity: [m/s^2].
        frozen_attitude: stones cannot turn (infinite inertia).
        air: "fixed" or "adaptive".
        threads: that share the work; as many as there are processors if None.

    Raises:
        ValueError: a value is not allowed.
    """
    limits = limits or Limits()
    check_positive(timestep=timestep)
    for name, value, allowed in (("method", method, METHODS), ("air", air, AIRS)):
        if value not in allowed:
            raise ValueError(f"{name} is {value!r}: use one of {', '.join(allowed)}")
    count = len(throws)
    stones = _each("stone", stone, Stone, count)
    waters = _each("water", water or Water(), Water, count)
    starts = np.array(
        [
            _packed(s, t.state(s) if isinstance(t, Throw) else t)
            for s, t in zip(stones, throws, strict=True)
        ]
    ).reshape(count, kernels.SIZE)
    which, bodies, vertices, blocks = _tables(stones, waters, frozen_attitude)
    rules = np.zeros(kernels.RULES)
    rules[: kernels.GRAVITY] = [
        timestep,
        limits.duration,
        limits.min_airtime,
        limits.max_contact,
        limits.sink_depth,
        limits.rest_speed,
        limits.rest_time,
    ]
    rules[kernels.GRAVITY : kernels.METHOD] = gravity
    rules[kernels.METHOD] = METHODS.index(method)
    rules[kernels.AIR_TOLERANCE] = AIR_TOLERANCE if air == "adaptive" else 0.0
    out = np.empty((count, kernels.OUT))
    wrench = wrench_address()

    def fly(first: int) -> None:
        rows = slice(first, first + PIECE)
        kernels.fly_all(
            wrench, blocks, bodies, which[rows], rules, vertices, starts[rows], DORMAND_PRINCE,
            out[rows],
        )  # fmt: skip

    workers = threads or processors()
    if workers == 1 or count <= PIECE:
        for first in range(0, count, PIECE):
            fly(first)
    else:
        fly(0)  # compiles, if need be, before threads wait for each other
        with ThreadPoolExecutor(workers) as pool:
            for _ in pool.map(fly, range(PIECE, count, PIECE)):
                pass
    return _outcomes(out)


def processors() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0))


def _each(name: str, given: Any, kind: type, count: int) -> list[Any]:
    found = [given] * count if isinstance(given, kind) else list(given)
    if len(found) != count:
        raise ValueError(f"{len(found)} of {name} for {count} throws: give one, or one for each")
    return found


def _packed(stone: Stone, start: State) -> Array:
    """y (13,) = x, q, P, L at the start."""
    rotation = matrices(start.q)
    spin = rotation @ (stone.inertia @ (rotation.T @ start.omega))
    return np.concatenate([start.position, start.q, stone.mass * start.velocity, spin])


def _tables(
    stones: list[Stone], waters: list[Water], frozen: bool
) -> tuple[npt.NDArray[np.int64], Array, Array, Array]:
    """For the kernel: the body of every throw (n,), the bodies, their vertices and their blocks."""
    numbers: dict[tuple[int, Water], int] = {}
    places: dict[int, int] = {}  # of a stone's vertices
    which = np.empty(len(stones), dtype=np.int64)
    bodies: list[Array] = []
    vertices: list[Array] = []
    blocks: list[Array] = []
    length = rows = 0
    for k, (stone, water) in enumerate(zip(stones, waters, strict=True)):
        key = (id(stone), water)
        if key not in numbers:
            numbers[key] = len(bodies)
            if id(stone) not in places:
                places[id(stone)] = rows
                vertices.append(stone.vertices)
                rows += len(stone.vertices)
            block = pack(stone, water)
            bodies.append(_body(stone, length, places[id(stone)], frozen))
            blocks.append(block)
            length += len(block)
        which[k] = numbers[key]
    if not bodies:
        return which, np.empty((0, kernels.BODY)), np.empty((0, 3)), np.empty(0)
    return which, np.array(bodies), np.vstack(vertices), np.concatenate(blocks)


def _body(stone: Stone, block: int, place: int, frozen: bool) -> Array:
    """What the kernel knows a stone by (BODY,)."""
    axis = stone.disc_normal
    along = stone.vertices @ axis
    largest = float(axis @ stone.inertia @ axis)
    across = 0.5 * (float(np.trace(stone.inertia)) - largest)
    ideal = across * np.eye(3) + (largest - across) * np.outer(axis, axis)
    round_ = np.allclose(stone.inertia, ideal, rtol=0.0, atol=1e-9 * largest)
    body = np.zeros(kernels.BODY)
    body[kernels.MASS] = stone.mass
    body[kernels.RADIUS] = stone.radius
    body[kernels.REACH] = np.linalg.norm(stone.vertices - np.outer(along, axis), axis=1).max()
    body[kernels.HALF] = np.abs(along).max()
    # the air turns a stone whose disc is off its centre
    body[kernels.ROUND] = frozen or (round_ and not stone.disc_centre.any())
    body[kernels.AXIS : kernels.INVERSE] = axis
    if not frozen:
        body[kernels.PRECESSION] = 1.0 / across
        body[kernels.SPINNING] = 1.0 / largest - 1.0 / across
        body[kernels.INVERSE : kernels.BLOCK] = np.linalg.inv(stone.inertia).reshape(9)
    body[kernels.BLOCK] = block
    body[kernels.FIRST], body[kernels.LAST] = place, place + len(stone.vertices)
    return body


def _outcomes(out: Array) -> Outcomes:
    def whole(column: int) -> npt.NDArray[np.int64]:
        return out[:, column].astype(np.int64)

    return Outcomes(
        skips=whole(kernels.SKIPS),
        touches=whole(kernels.TOUCHES),
        end=whole(kernels.END),
        time=out[:, kernels.TIME],
        distance=out[:, kernels.X],
        drift=out[:, kernels.Y],
        depth=out[:, kernels.DEPTH],
        entry=out[:, kernels.ENTRY],
        exit=out[:, kernels.EXIT],
        exit_velocity=out[:, kernels.EXIT_VELOCITY : kernels.EXIT_VELOCITY + 3],
        steps=whole(kernels.STEPS),
    )


def _dormand_prince() -> Array:
    """Stages (rows 1-6, the last is the step; column 7 the time) and the error estimate (row 7)."""
    table = np.zeros((8, 8))
    table[1, :1] = [1 / 5]
    table[2, :2] = [3 / 40, 9 / 40]
    table[3, :3] = [44 / 45, -56 / 15, 32 / 9]
    table[4, :4] = [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729]
    table[5, :5] = [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656]
    table[6, :6] = [35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]
    table[1:7, 7] = [1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1]
    table[7, :7] = [
        71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40,
    ]  # fmt: skip
    return table


DORMAND_PRINCE = _dormand_prince()
"""J. R. Dormand & P. J. Prince, J. Comput. Appl. Math. 6:19, 1980."""
