"""The paper's own integrator (its figure 3): position, orientation, momentum, angular momentum.

It never touches MuJoCo: with the same forces it is the independent witness of the coupling.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from mjskip._typing import Array
from mjskip.checks import check_choice, check_positive, check_switch, check_type, check_vector
from mjskip.errors import MjskipError
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_address
from mjskip.rigid import _rigid_kernels as kernels
from mjskip.rigid.body import body_row, momenta
from mjskip.rigid.state import STATE
from mjskip.throws.recording import Limits, Recorder
from mjskip.throws.throw import State, Throw
from mjskip.throws.trajectory import GRAVITY, Trajectory

if TYPE_CHECKING:
    from scipy.integrate import DOP853

FixedStep = Literal["euler", "midpoint", "rk4"]
FIXED_STEP: dict[str, int] = {
    "euler": kernels.EULER, "midpoint": kernels.MIDPOINT, "rk4": kernels.RK4,
}  # fmt: skip
Integration = Literal["euler", "midpoint", "rk4", "adaptive"]
PURE_INTEGRATORS: tuple[Integration, ...] = get_args(Integration)

CHUNK = 200
"""Steps between looks at whether the run is over."""


def integrate(
    stone: Stone,
    throw: Throw | State,
    *,
    water: Water | None = None,
    integrator: Integration = "rk4",
    timestep: float = 5e-4,
    limits: Limits | None = None,
    gravity: Sequence[float] = GRAVITY,
    frozen_attitude: bool = False,
    rtol: float = 1e-10,
    name: str = "stone",
) -> Trajectory:
    """Throw a stone over still water and follow it by the pure integrator.

    Args:
        stone: the body.
        throw: how it is released, above (0, 0); or its state at release.
        water: the fluid; `Water()` if omitted.
        integrator: "euler" (explicit), "midpoint", "rk4": at a fixed step; "adaptive": SciPy's DOP853,
            the yardstick.
        timestep: step, and for "adaptive" the spacing of the rows and the longest step [s].
        limits: what counts as a skip and when it is over; `Limits()` if omitted.
        gravity: (3,) [m/s^2].
        frozen_attitude: the stone is thrown without spin and cannot turn (infinite inertia).
        rtol: relative tolerance of "adaptive".
        name: of the stone, for messages.

    Returns:
        The trajectory, a row per step.

    Raises:
        ValueError: a value is not allowed.
        DivergedError: the motion is no longer finite.
    """
    water = Water() if water is None else water
    limits = Limits() if limits is None else check_type("limits", limits, Limits)
    check_positive(timestep=timestep)
    limits.check_steps(timestep, bodies=1)
    moving = Integrator(
        stone,
        state_at_release(stone, throw),
        water=water,
        integrator=integrator,
        timestep=timestep,
        gravity=gravity,
        frozen_attitude=frozen_attitude,
        rtol=rtol,
    )
    recorder = Recorder(name, stone, water, limits, gravity=gravity)
    done, states = 0, moving.start()
    while True:
        times: Array = timestep * np.arange(done, done + len(states), dtype=np.float64)
        if recorder.extend(times, states):
            break
        done += len(states)
        states = moving.advance(CHUNK)
    return recorder.trajectory(
        {
            "engine": "reference",
            "integrator": integrator,
            "timestep": timestep,
            "gravity": [float(g) for g in gravity],
            "frozen_attitude": frozen_attitude,
        }
    )


def state_at_release(stone: Stone, throw: Throw | State) -> State:
    """A throw's state as it leaves the hand above (0, 0); a state as it is."""
    check_type("stone", stone, Stone)
    if isinstance(throw, State):
        return throw
    return check_type("throw", throw, Throw, "give a mjskip.Throw, or a State").state(stone)


def rigid_body(stone: Stone, block: Array, gravity: Array, *, frozen_attitude: bool) -> Array:
    """The row of a stone in its water, whose packed block must stay alive."""
    return body_row(
        stone.mass, stone.inertia, gravity=gravity, forces=wrench_address(), block=block.ctypes.data,
        frozen_attitude=frozen_attitude,
    )  # fmt: skip


def start_of(stone: Stone, state: State) -> Array:
    """x, q, P, L (13,) of a stone in a state."""
    return momenta(stone.mass, stone.inertia, **vars(state))


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
        integrator: str = "rk4",
        timestep: float = 5e-4,
        gravity: Sequence[float] | Array = GRAVITY,
        frozen_attitude: bool = False,
        rtol: float = 1e-10,
    ) -> None:
        """Take a stone as it leaves the hand; arguments and errors as for `integrate`."""
        check_positive(timestep=timestep, rtol=rtol)
        check_choice("integrator", integrator, PURE_INTEGRATORS)
        check_type("water", water, Water)
        check_switch("frozen_attitude", frozen_attitude)
        vector = check_vector("gravity", gravity, 3)
        self.block = pack(stone, water, gravity=-float(vector[2]))
        self._body = rigid_body(stone, self.block, vector, frozen_attitude=frozen_attitude)
        self._integrator, self._timestep = integrator, timestep
        self._y = start_of(stone, start)
        self._state, self._load = np.empty(STATE), np.empty(12)
        self._done = 0
        self._solver: DOP853 | None = None
        if integrator == "adaptive":
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
        states = np.empty((1, STATE))
        kernels.motion(self._body, self._y, states[0])
        return states

    def advance(self, steps: int) -> Array:
        """Move on by some steps: states (steps, 18) after each.

        Raises:
            MjskipError: the adaptive solver gave up.
        """
        states = np.empty((steps, STATE))
        if self._solver is None:
            method = FIXED_STEP[self._integrator]
            kernels.advance(self._body, method, self._timestep, self._y, states)
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
            kernels.motion(self._body, self._solver.dense_output()(time), row)
        return states

    def _derivative(self, _time: float, y: Any) -> Any:
        """dy/dt of y (13,)."""
        out = np.empty(kernels.SIZE)
        kernels.derivative(self._body, y, self._state, self._load, out)
        return out
