"""The two engines behind one face: they hold the stones of a scene and move them on, step by step."""

from __future__ import annotations

import copy
import ctypes
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import Protocol

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip.coupling._free_joint_kernels import free_motion, hop
from mjskip.coupling._struct_layout import library
from mjskip.coupling.attach import Coupling, attach
from mjskip.coupling.bodies import find_body
from mjskip.coupling.wet import THROWN
from mjskip.errors import DivergedError, SceneError
from mjskip.hydro.wrench import entry_address
from mjskip.rigid.attitude import matrices
from mjskip.rigid.state import STATE
from mjskip.throws.reference import PURE_INTEGRATORS, Integrator
from mjskip.throws.scene import Scene
from mjskip.throws.throw import State

Array = npt.NDArray[np.float64]
Motion = dict[str, Array]
"""States (n, 18) for the force kernel, by body."""

INTEGRATORS: dict[str, int] = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}

FROZEN = 1e12
"""Factor on the inertia of a stone that must not turn: its turn over a throw is below rounding."""


class Engine(Protocol):
    """Stones in motion.

    Attributes:
        integrator: its name.
        blocks: what the force kernel knows of each body, by name; a patch of surface may be put there.
    """

    integrator: str
    blocks: Mapping[str, Array]

    @property
    def hop(self) -> tuple[int, Array] | None:
        """What steps it in compiled code, if anything can, and its context: see `mjskip.coupling._free_joint_kernels.hop`."""

    def start(self) -> Motion:
        """States (1, 18) as the stones leave the hand."""

    def advance(self, steps: int) -> Motion:
        """Move on by some steps: states (steps, 18) after each."""

    def check(self) -> None:
        """Raise DivergedError if a force or a state was not finite since the start."""


def releases(scene: Scene) -> dict[str, State]:
    """How every stone leaves the hand, above the place where the scene has it; not those an arm holds."""
    found = {}
    for name, stone in scene.stones.items():
        if name in scene.held:
            continue
        body = scene.model.body(find_body(scene.model, name))
        found[name] = scene.throws[name].state(stone, x=float(body.pos[0]), y=float(body.pos[1]))
    return found


class ReferenceEngine:
    """The pure integrator, a stone at a time: it knows no contacts."""

    def __init__(
        self, scene: Scene, integrator: str | None, timestep: float, *, frozen_attitude: bool
    ) -> None:
        """Take the stones of a scene.

        Raises:
            ValueError: there is no such integrator.
        """
        self.integrator = integrator or "rk4"
        if self.integrator not in PURE_INTEGRATORS:
            raise ValueError(
                f"integrator is {integrator!r}: the reference engine has {', '.join(PURE_INTEGRATORS)}"
            )
        gravity = scene.model.opt.gravity
        self._stones = {
            name: Integrator(
                scene.stones[name],
                start,
                water=scene.water_of(name),
                integrator=self.integrator,
                timestep=timestep,
                gravity=(float(gravity[0]), float(gravity[1]), float(gravity[2])),
                frozen_attitude=frozen_attitude,
            )
            for name, start in releases(scene).items()
        }
        self.blocks: Mapping[str, Array] = {n: stone.block for n, stone in self._stones.items()}

    def __enter__(self) -> ReferenceEngine:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    def start(self) -> Motion:
        """States (1, 18) as the stones leave the hand."""
        return {name: stone.start() for name, stone in self._stones.items()}

    def advance(self, steps: int) -> Motion:
        """Move on by some steps: states (steps, 18) after each."""
        return {name: stone.advance(steps) for name, stone in self._stones.items()}

    def check(self) -> None:
        """What is not finite here shows in the states."""

    @property
    def hop(self) -> None:
        """It steps in compiled code already, but a stone at a time."""


class MujocoEngine:
    """MuJoCo, with water on the scene's stones while the context is open: attached, or its plugin's own."""

    def __init__(
        self, scene: Scene, integrator: str | None, timestep: float, *, frozen_attitude: bool
    ) -> None:
        """Make a model and data of this engine's own.

        Raises:
            ValueError: there is no such integrator.
        """
        model = copy.copy(scene.model)
        if integrator is not None:
            if integrator not in INTEGRATORS:
                raise ValueError(
                    f"integrator is {integrator!r}: the mujoco engine has {', '.join(INTEGRATORS)}"
                )
            model.opt.integrator = INTEGRATORS[integrator]
        self.integrator = next(n for n, code in INTEGRATORS.items() if code == model.opt.integrator)
        model.opt.timestep = timestep
        self.model, self.data = model, mujoco.MjData(model)
        if frozen_attitude:
            for name in scene.stones:
                model.body_inertia[find_body(model, name)] *= FROZEN
            mujoco.mj_setConst(model, self.data)
            mujoco.mj_resetData(model, self.data)
        self._free = {name: _FreeBody(model, name) for name in scene.stones}
        for name, start in releases(scene).items():
            self._free[name].place(self.data, start)
        self._qpos, self._qvel = (
            self.data.qpos,
            self.data.qvel,
        )  # views: every look-up makes them anew
        self._sound = 0.0  # when it was last checked: MuJoCo's own clock begins anew if it diverges
        self._arm = scene.arm
        self._acts = bool(scene.arm.controls or scene.arm.release_times)
        self._water = None if scene.plugged else scene.water
        self._open = ExitStack()
        self._coupling: Coupling | None = None
        self.blocks: Mapping[str, Array] = {}

    def __enter__(self) -> MujocoEngine:
        self._open.enter_context(_unlogged())
        if self._water is not None:
            names = list(self._free)
            water = attach(
                self.model, self.data, water=self._water, bodies=names, max_faces=THROWN.max_faces
            )
            self._coupling = self._open.enter_context(water)
            self.blocks = dict(zip(names, self._coupling.blocks, strict=True))
        return self

    @property
    def hop(self) -> tuple[int, Array] | None:
        """Only of a model that is nothing but one stone, where a step cannot fail for want of memory."""
        if self._acts or self.model.nv != 6 or len(self._free) != 1:
            return None
        (body,) = self._free.values()
        words = [
            ctypes.cast(library.mj_step, ctypes.c_void_p).value or 0,
            self.model._address,
            self.data._address,
            self._qpos.ctypes.data,
            self._qvel.ctypes.data,
        ]
        centre = body.centre.astype(np.float64).view(np.int64).tolist()
        return entry_address(hop), np.array([*words, *centre], np.int64).view(np.float64)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.__exit__(kind, error, trace)

    def start(self) -> Motion:
        """States (1, 18) as the stones leave the hand."""
        return self._states(self._qpos[None], self._qvel[None])

    def advance(self, steps: int) -> Motion:
        """Move on by some steps: states (steps, 18) after each."""
        model, data = self.model, self.data
        if steps == 1 and not self._acts:  # over waves there are thousands of these
            mujoco.mj_step(model, data)
            return self._states(self._qpos[None], self._qvel[None])
        qpos, qvel = np.empty((steps, model.nq)), np.empty((steps, model.nv))
        for row in range(steps):
            if self._acts:
                self._arm.act(model, data)
            mujoco.mj_step(model, data)
            qpos[row], qvel[row] = self._qpos, self._qvel
        return self._states(qpos, qvel)

    def check(self) -> None:
        """Raise DivergedError if a force or a state was not finite since the start."""
        if self._coupling is not None:
            self._coupling.check()  # the plugin's doubts are warnings in the data
        _check_warnings(self.data, self._sound)
        self._sound = float(self.data.time)

    def _states(self, qpos: Array, qvel: Array) -> Motion:
        return {name: body.states(qpos, qvel) for name, body in self._free.items()}


class _FreeBody:
    """A body with a free joint: between MuJoCo's coordinates and the motion of its centre of mass."""

    def __init__(self, model: mujoco.MjModel, name: str) -> None:
        body = find_body(model, name)
        joint = model.body_jntadr[body]
        if model.body_parentid[body] != 0:
            raise SceneError(f"body {name!r} is not a child of the world: a stone must be")
        self._q = slice(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + 7)
        self._v = slice(model.jnt_dofadr[joint], model.jnt_dofadr[joint] + 6)
        self.centre = np.array(model.body_ipos[body])

    def place(self, data: mujoco.MjData, start: State) -> None:
        rotation = matrices(start.q)
        arm = rotation @ self.centre
        data.qpos[self._q] = [*(start.position - arm), *start.q]
        data.qvel[self._v] = [
            *(start.velocity - np.cross(start.omega, arm)),
            *(rotation.T @ start.omega),
        ]

    def states(self, qpos: Array, qvel: Array) -> Array:
        """(n, 18) for the force kernel."""
        states = np.empty((len(qpos), STATE))
        free_motion(qpos[:, self._q], qvel[:, self._v], self.centre, states)
        return states


@contextmanager
def _unlogged() -> Iterator[None]:
    """Keep MuJoCo from printing, and writing to a log file here, what is raised as an error."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _check_warnings(data: mujoco.MjData, since: float) -> None:
    """MuJoCo resets a simulation whose state is not finite, and only counts it."""
    counts = data.warning.number
    if not counts.any():
        return
    for kind in ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC"):
        if counts[getattr(mujoco.mjtWarning, kind)]:
            raise DivergedError(
                f"MuJoCo's state is not finite soon after t = {since:.6g} s ({kind}): use a smaller "
                "time step",
                time=since,
            )
