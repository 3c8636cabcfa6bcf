"""The paper's own integrator (its figure 3): position, orientation, momentum, angular momentum.

It never touches MuJoCo: with the same forces it is the independent witness of the coupling.
"""

from __future__ import annotations

from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt
from scipy.integrate import DOP853

from mjskip import _rigid_kernels as kernels
from mjskip.attitude import matrices
from mjskip.errors import MjskipError
from mjskip.forces import pack, wrench_address
from mjskip.recording import Limits, Log
from mjskip.stone import Stone, check_positive
from mjskip.throw import State, Throw
from mjskip.trajectory import Trajectory
from mjskip.water import Water

Array = npt.NDArray[np.float64]
Method = Literal["euler", "midpoint", "rk4", "adaptive"]
METHODS: tuple[Method, ...] = get_args(Method)

CHUNK = 200
"""Steps between looks at whether the run is over."""


def integrate(
    stone: Stone,
    throw: Throw | State,
    *,
    water: Water | None = None,
    method: Method = "rk4",
    timestep: float = 5e-4,
    limits: Limits | None = None,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
    frozen_attitude: bool = False,
    rtol: float = 1e-10,
    name: str = "stone",
) -> Trajectory:
    """Throw a stone over still water and follow it by the pure integrator.

    Args:
        stone: the body.
        throw: how it is released, above (0, 0); or its state at release.
        water: the fluid; `Water()` if omitted.
        method: "euler" (explicit), "midpoint", "rk4": at a fixed step; "adaptive": SciPy's DOP853,
            the yardstick.
        timestep: step, and for "adaptive" the spacing of the rows and the longest step [s].
        limits: what counts as a skip and when it is over; `Limits()` if omitted.
        gravity: [m/s^2].
        frozen_attitude: the stone is thrown without spin and cannot turn (infinite inertia).
        rtol: relative tolerance of "adaptive".
        name: of the stone, for messages.

    Returns:
        The trajectory, a row per step.

    Raises:
        ValueError: a value is not allowed.
        DivergedError: the motion is no longer finite.
    """
    water, limits = water or Water(), limits or Limits()
    check_positive(timestep=timestep, rtol=rtol)
    if method not in METHODS:
        raise ValueError(f"method is {method!r}: use one of {', '.join(METHODS)}")
    start = throw.state(stone) if isinstance(throw, Throw) else throw
    inertia = np.zeros((3, 3)) if frozen_attitude else _inverse(stone.inertia)
    y = _packed(stone, start)
    stepper = _adaptive if method == "adaptive" else _fixed
    log = Log(name, stone, water, limits, gravity=-gravity[2])
    problem = _Problem(pack(stone, water, gravity=-gravity[2]), stone.mass, inertia, np.array(gravity))
    first = np.empty((1, kernels.STATE))
    kernels.motion(y, stone.mass, inertia, first[0])
    log.extend(np.zeros(1), first)
    for times, states in stepper(problem, y, method, timestep, rtol):
        if log.extend(times, states):
            break
    return log.trajectory(
        {
            "engine": "reference",
            "integrator": method,
            "timestep": timestep,
            "gravity": -gravity[2],
            "frozen_attitude": frozen_attitude,
        }
    )


class _Problem:
    """What stays the same during a run."""

    def __init__(self, block: Array, mass: float, inverse_inertia: Array, gravity: Array) -> None:
        self.block = block
        self.mass = mass
        self.inverse_inertia = inverse_inertia
        self.gravity = gravity
        self.wrench = wrench_address()
        self._state, self._load = np.empty(kernels.STATE), np.empty(12)

    def derivative(self, _time: float, y: Array) -> Array:
        """dy/dt of y (13,)."""
        out = np.empty(kernels.SIZE)
        kernels.derivative(
            self.wrench, self.block, y, self.mass, self.inverse_inertia, self.gravity,
            self._state, self._load, out,
        )  # fmt: skip
        return out


def _inverse(matrix: Array) -> Array:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _packed(stone: Stone, start: State) -> Array:
    """y (13,) = x, q, P, L at the start."""
    rotation = matrices(start.q)
    spin = rotation @ (stone.inertia @ (rotation.T @ start.omega))
    return np.concatenate([start.position, start.q, stone.mass * start.velocity, spin])


def _fixed(problem: _Problem, y: Array, method: str, timestep: float, _rtol: float) -> Any:
    """Endless chunks of (times, states) at a fixed step; y is advanced in place."""
    code = {"euler": kernels.EULER, "midpoint": kernels.MIDPOINT, "rk4": kernels.RK4}[method]
    done = 0
    while True:
        states = np.empty((CHUNK, kernels.STATE))
        kernels.march(
            problem.wrench, problem.block, y, problem.mass, problem.inverse_inertia,
            problem.gravity, code, timestep, states,
        )  # fmt: skip
        yield timestep * np.arange(done + 1, done + CHUNK + 1), states
        done += CHUNK


def _adaptive(problem: _Problem, y: Array, _method: str, timestep: float, rtol: float) -> Any:
    """Endless chunks of (times, states) from DOP853 dense output, a row every `timestep`."""
    absolute: Any = 1e-3 * rtol * np.maximum(np.abs(y), 1e-3 * np.linalg.norm(y))
    solver = DOP853(problem.derivative, 0.0, y, np.inf, max_step=timestep, rtol=rtol, atol=absolute)
    done = 0
    while True:
        rows = np.empty((CHUNK, kernels.STATE))
        times = timestep * np.arange(done + 1, done + CHUNK + 1)
        for row, time in enumerate(times):
            while solver.t < time:
                message = solver.step()
                if solver.status == "failed":
                    raise MjskipError(
                        f"the adaptive integrator stopped at {solver.t:.6g} s: {message}"
                    )
            kernels.motion(
                solver.dense_output()(time), problem.mass, problem.inverse_inertia, rows[row]
            )
        yield times, rows
        done += CHUNK
