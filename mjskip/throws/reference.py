"""The paper's own integrator (its figure 3): position, orientation, momentum, angular momentum.

It never touches MuJoCo: with the same forces it is the independent witness of the coupling.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_positive
from mjskip.errors import MjskipError
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_address
from mjskip.rigid import _rigid_kernels as kernels
from mjskip.rigid.attitude import matrices
from mjskip.throws.recording import Limits, Log
from mjskip.throws.throw import State, Throw
from mjskip.throws.trajectory import Trajectory

if TYPE_CHECKING:
    from scipy.integrate import DOP853

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
    integrator = Integrator(
        stone,
        throw.state(stone) if isinstance(throw, Throw) else throw,
        water=water,
        method=method,
        timestep=timestep,
        gravity=gravity,
        frozen_attitude=frozen_attitude,
        rtol=rtol,
    )
    log = Log(name, stone, water, limits, gravity=-gravity[2])
    done, states = 0, integrator.start()
    while True:
        times: Array = timestep * np.arange(done, done + len(states), dtype=np.float64)
        if log.extend(times, states):
            break
        done += len(states)
        states = integrator.advance(CHUNK)
    return log.trajectory(
        {
            "engine": "reference",
            "integrator": method,
            "timestep": timestep,
            "gravity": -gravity[2],
            "frozen_attitude": frozen_attitude,
        }
    )


class Integrator:
    """One stone in motion, moved on step by step.

    Attributes:
        block: what the force kernel knows of it; a patch of surface may be put there.
    """

    def __init__(
        self,
        stone: Stone,
        start: State,
        *,
        water: Water,
        method: str = "rk4",
        timestep: float = 5e-4,
        gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
        frozen_attitude: bool = False,
        rtol: float = 1e-10,
    ) -> None:
        """Take a stone as it leaves the hand; arguments and errors as for `integrate`."""
        check_positive(timestep=timestep, rtol=rtol)
        if method not in METHODS:
            raise ValueError(f"method is {method!r}: use one of {', '.join(METHODS)}")
        self.block = pack(stone, water, gravity=-gravity[2])
        self._mass = stone.mass
        self._inverse_inertia = np.zeros((3, 3)) if frozen_attitude else _inverse(stone.inertia)
        self._gravity = np.array(gravity)
        self._wrench = wrench_address()
        self._method, self._timestep = method, timestep
        self._y = _packed(stone, start)
        self._state, self._load = np.empty(kernels.STATE), np.empty(12)
        self._done = 0
        self._solver: DOP853 | None = None
        if method == "adaptive":
            from scipy.integrate import DOP853

            absolute: Any = (
                1e-3 * rtol * np.maximum(np.abs(self._y), 1e-3 * np.linalg.norm(self._y))
            )
            self._solver = DOP853(
                self._derivative, 0.0, self._y, np.inf,
                max_step=timestep, rtol=rtol, atol=absolute,
            )  # fmt: skip

    def start(self) -> Array:
        """State (1, 18) for the force kernel, as the stone leaves the hand."""
        states = np.empty((1, kernels.STATE))
        kernels.motion(self._y, self._mass, self._inverse_inertia, states[0])
        return states

    def advance(self, steps: int) -> Array:
        """Move on by some steps: states (steps, 18) after each.

        Raises:
            MjskipError: the adaptive solver gave up.
        """
        states = np.empty((steps, kernels.STATE))
        if self._solver is None:
            code = {"euler": kernels.EULER, "midpoint": kernels.MIDPOINT, "rk4": kernels.RK4}
            kernels.march(
                self._wrench, self.block, self._y, self._mass, self._inverse_inertia,
                self._gravity, code[self._method], self._timestep, states,
            )  # fmt: skip
            return states
        for row in states:
            self._done += 1
            time = self._done * self._timestep
            while self._solver.t < time:
                message = self._solver.step()
                if self._solver.status == "failed":
                    raise MjskipError(
                        f"the adaptive integrator stopped at {self._solver.t:.6g} s: {message}"
                    )
            kernels.motion(
                self._solver.dense_output()(time), self._mass, self._inverse_inertia, row
            )
        return states

    def _derivative(self, _time: float, y: Any) -> Any:
        """dy/dt of y (13,)."""
        out = np.empty(kernels.SIZE)
        kernels.derivative(
            self._wrench, self.block, y, self._mass, self._inverse_inertia, self._gravity,
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
