"""The two engines behind one face: they hold the stones of a scene and move them on, step by step."""

from __future__ import annotations

import copy
import ctypes
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from types import TracebackType
from typing import Protocol

import mujoco
import numpy as np

from mjskip._typing import Array
from mjskip.checks import fault
from mjskip.coupling._struct_layout import library
from mjskip.coupling.attach import Coupling, attach
from mjskip.coupling.bodies import find_body
from mjskip.coupling.water_surface import PluginSea, WaterSurface, model_surface
from mjskip.coupling.wet import THROWN_OPTIONS, centre_of_mass
from mjskip.errors import DivergedError, SceneError
from mjskip.hydro.wrench import entry_address, wrench_address
from mjskip.rigid.attitude import matrices
from mjskip.rigid.state import STATE
from mjskip.throws import _engine_kernels as kernels
from mjskip.throws.kick import KickedStones
from mjskip.throws.reference import PURE_INTEGRATORS, Integrator
from mjskip.throws.scene import Scene
from mjskip.throws.throw import State
from mjskip.waves.coupled import CoupledWater

INTEGRATORS: dict[str, int] = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}

KICK = "kick"
"""What the pure integrator does over waves: see `mjskip.waves._kick_kernels.kick_step`."""

FROZEN = 1e12
"""Factor on the inertia of a stone that must not turn: its turn over a throw is below rounding."""


class Engine(Protocol):
    """Stones in motion.

    Attributes:
        integrator: its name.
        names: of the stones, in the order of their states.
        stages: evaluations of the forces in a step; 0 if it finds the loads of waves itself.
        acts: whether an arm must be moved before each step.
    """

    integrator: str
    names: tuple[str, ...]
    stages: int
    acts: bool

    @property
    def step(self) -> int:
        """Address of a C function void(context, states after a step, unused)."""

    @property
    def context(self) -> Array:
        """What to hand to it."""

    def states(self) -> Array:
        """States (n, 18) of the stones as they are."""

    def advance(self, steps: int) -> Array:
        """Move on over still water by some steps: states (steps, n, 18) after each."""

    def before_step(self) -> None:
        """Move the arm."""

    def after_step(self) -> None:
        """Let whoever observes see the data."""

    def couple(self, water: CoupledWater) -> None:
        """Have the loads from moving water from now on."""

    def check(self) -> None:
        """Raise DivergedError if a force or a state was not finite since the start."""


def release_states(scene: Scene) -> dict[str, State]:
    """How every stone leaves the hand, above the place where the scene has it; not those an arm holds."""
    found = {}
    for name, stone in scene.stones.items():
        if scene.afloat or name in scene.held:
            continue
        body = scene.model.body(find_body(scene.model, name))
        found[name] = scene.throws[name].state(stone, x=float(body.pos[0]), y=float(body.pos[1]))
    return found


class ReferenceEngine:
    """The pure integrator: it knows no contacts. Over still water a stone at a time."""

    stages, acts = 0, False

    def __init__(
        self,
        scene: Scene,
        integrator: str | None,
        timestep: float,
        *,
        frozen_attitude: bool,
        over_waves: bool = False,
    ) -> None:
        """Take the stones of a scene.

        Raises:
            ValueError: there is no such integrator.
        """
        known = (KICK,) if over_waves else PURE_INTEGRATORS
        self.integrator = integrator or (KICK if over_waves else "rk4")
        if self.integrator not in known:
            where = "over waves" if over_waves else "over still water"
            raise ValueError(
                f"integrator is {integrator!r}: the reference engine has {', '.join(known)} {where}"
            )
        gravity, starts = scene.model.opt.gravity.copy(), release_states(scene)
        self.names = tuple(starts)
        stones = [scene.stones[name] for name in self.names]
        self._kicked: KickedStones | None = None
        self._stones: list[Integrator] = []
        if over_waves:
            self._kicked = KickedStones(
                stones, [starts[name] for name in self.names], timestep=timestep, gravity=gravity,
                frozen_attitude=frozen_attitude,
            )  # fmt: skip
        else:
            self._stones = [
                Integrator(
                    stone, starts[name], water=scene.water_of(name), integrator=self.integrator,
                    timestep=timestep, gravity=gravity, frozen_attitude=frozen_attitude,
                )
                for name, stone in zip(self.names, stones, strict=True)
            ]  # fmt: skip

    def __enter__(self) -> ReferenceEngine:
        return self

    def __exit__(self, *_: object) -> None:
        return None

    @property
    def step(self) -> int:
        """What steps the stones over waves."""
        assert self._kicked is not None
        return self._kicked.step

    @property
    def context(self) -> Array:
        """What to hand to it."""
        assert self._kicked is not None
        return self._kicked.context

    def states(self) -> Array:
        """States (n, 18) of the stones as they are."""
        if self._kicked is not None:
            return self._kicked.states()
        return np.concatenate([stone.start() for stone in self._stones])

    def advance(self, steps: int) -> Array:
        """Move on over still water by some steps: states (steps, n, 18) after each."""
        return np.stack([stone.advance(steps) for stone in self._stones], axis=1)

    def before_step(self) -> None:
        """There is no arm."""

    def after_step(self) -> None:
        """There is no data."""

    def couple(self, water: CoupledWater) -> None:
        """Have the loads from moving water from now on."""
        assert self._kicked is not None
        self._kicked.couple(water)

    def check(self) -> None:
        """What is not finite here shows in the states."""


class MujocoEngine:
    """MuJoCo, with water on the scene's stones while the context is open: attached, or its plugin's own."""

    def __init__(
        self,
        scene: Scene,
        integrator: str | None,
        timestep: float,
        *,
        frozen_attitude: bool,
        over_waves: bool = False,
    ) -> None:
        """Make a model and data of this engine's own; over waves, `couple` it before its first step.

        Raises:
            ValueError: there is no such integrator.
        """
        del over_waves
        model = copy.copy(scene.model)
        if integrator is not None:
            if not isinstance(integrator, str) or integrator not in INTEGRATORS:
                has = ", ".join(INTEGRATORS)
                raise fault("integrator", integrator, f"the mujoco engine has {has}")
            model.opt.integrator = INTEGRATORS[integrator]
        self.integrator = next(n for n, code in INTEGRATORS.items() if code == model.opt.integrator)
        self.stages = 4 if self.integrator == "RK4" else 1
        model.opt.timestep = timestep
        self.model, self.data = model, mujoco.MjData(model)
        if frozen_attitude:
            for name in scene.stones:
                model.body_inertia[find_body(model, name)] *= FROZEN
            mujoco.mj_setConst(model, self.data)
            mujoco.mj_resetData(model, self.data)
        self.names = tuple(scene.stones)
        self.context = _context(model, self.data, self.names)
        for name, start in release_states(scene).items():
            _place(model, self.data, name, start)
        self._sound = 0.0  # when it was last checked: MuJoCo's own clock begins anew if it diverges
        self._arm = scene.arm
        self._afloat = scene.afloat
        self.jointed = scene.afloat or model.nv != 6 * len(self.names)
        self.acts = bool(scene.arm.controls or scene.arm.release_times)
        self.observe: Callable[[mujoco.MjData], None] | None = None
        self._water = None if scene.plugged else scene.water
        self._open = ExitStack()
        self._coupling: Coupling | None = None

    def __enter__(self) -> MujocoEngine:
        self._open.enter_context(_unlogged())
        if self._water is not None:
            coupling = attach(
                self.model, self.data, water=self._water,
                bodies=None if self._afloat else list(self.names), max_faces=THROWN_OPTIONS.max_faces,
            )  # fmt: skip
            self._coupling = self._open.enter_context(coupling)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._open.__exit__(kind, error, trace)

    @property
    def step(self) -> int:
        """Address of `mujoco_step`."""
        return entry_address(kernels.mujoco_step)

    def states(self) -> Array:
        """States (n, 18) of the stones as they are."""
        states = np.empty((1, len(self.names), STATE))
        kernels.advance(entry_address(kernels.mujoco_states), self.context, states)
        return np.asarray(states[0])

    def advance(self, steps: int) -> Array:
        """Move on over still water by some steps: states (steps, n, 18) after each."""
        states = np.empty((steps, len(self.names), STATE))
        alone = self.model.nv == 6 * len(self.names) and self.observe is None
        if alone and not self.acts:
            kernels.advance(self.step, self.context, states)
            return states
        for row in states:  # what may run out of memory is stepped where MuJoCo's errors are caught
            self.before_step()
            mujoco.mj_step(self.model, self.data)
            row[:] = self.states()
            self.after_step()
        return states

    def before_step(self) -> None:
        """Move the arm."""
        if self.acts:
            self._arm.act(self.model, self.data)

    def after_step(self) -> None:
        """Let `observe` see the data."""
        if self.observe is not None:
            self.observe(self.data)

    def surface(self) -> WaterSurface | PluginSea | Coupling | None:
        """The moving water under what floats: the plugin's, or that of bodies that radiate; None if it is still."""
        if self._coupling is not None:
            return self._coupling if self._coupling.surface is not None else None
        return model_surface(self.model, self.data)

    def couple(self, water: CoupledWater) -> None:
        """Have the loads from moving water from now on."""
        assert self._coupling is not None
        addresses = np.array([water.words.ctypes.data, wrench_address()], np.int64)
        self.context[[kernels.COUPLED, kernels.WRENCH]] = addresses.view(np.float64)
        self._coupling.replace_loads(entry_address(kernels.mujoco_loads), self.context)

    def check(self) -> None:
        """Raise DivergedError if a force or a state was not finite since the start."""
        if self._coupling is not None:
            self._coupling.check()  # the plugin's warnings are in the data
        _check_warnings(self.data, self._sound)
        self._sound = float(self.data.time)


def _context(model: mujoco.MjModel, data: mujoco.MjData, names: tuple[str, ...]) -> Array:
    """What `_engine_kernels` need to know of a model and its stones."""
    addresses = [
        ctypes.cast(library.mj_step, ctypes.c_void_p).value or 0,
        model._address,
        data._address,
        data.qpos.ctypes.data,
        data.qvel.ctypes.data,
        data.xfrc_applied.ctypes.data,
    ]
    context = np.zeros(kernels.STONES + kernels.STONE * len(names))
    context[: len(addresses)] = np.array(addresses, np.int64).view(np.float64)
    context[kernels.BODIES] = len(names)
    rows = context[kernels.STONES :].reshape(-1, kernels.STONE)
    for row, name in zip(rows, names, strict=True):
        body = find_body(model, name)
        joint = model.body_jntadr[body]
        if model.body_parentid[body] != 0:
            raise SceneError(f"body {name!r} is not a child of the world: a stone must be")
        row[:3] = model.jnt_qposadr[joint], model.jnt_dofadr[joint], body
        row[3:] = centre_of_mass(model, body)
    return context


def _place(model: mujoco.MjModel, data: mujoco.MjData, name: str, start: State) -> None:
    """Put a stone into MuJoCo's coordinates: of the body's own origin, not of its centre of mass."""
    body = find_body(model, name)
    joint = model.body_jntadr[body]
    q, v = model.jnt_qposadr[joint], model.jnt_dofadr[joint]
    rotation = matrices(start.q)
    arm = rotation @ centre_of_mass(model, body)
    data.qpos[q : q + 7] = [*(start.position - arm), *start.q]
    data.qvel[v : v + 6] = [
        *(start.velocity - np.cross(start.omega, arm)),
        *(rotation.T @ start.omega),
    ]


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
