"""Throw the stones of a scene, by MuJoCo or by the pure integrator."""

from __future__ import annotations

import copy
import math
import os
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from dataclasses import asdict, replace
from importlib.metadata import version
from typing import Any, Literal, get_args

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip.attitude import matrices
from mjskip.bodies import find_body
from mjskip.coupling import attach, compile_callback
from mjskip.errors import DivergedError, MjskipWarning, SceneError
from mjskip.forces import pack_states
from mjskip.recording import Limits, Log
from mjskip.reference import METHODS, integrate
from mjskip.scene import Scene, load_scene
from mjskip.stone import Stone, check_positive
from mjskip.throw import State, Throw
from mjskip.trajectory import Trajectory

Array = npt.NDArray[np.float64]
Engine = Literal["mujoco", "reference"]
ENGINES: tuple[Engine, ...] = get_args(Engine)
INTEGRATORS: dict[str, int] = {
    "Euler": mujoco.mjtIntegrator.mjINT_EULER,
    "implicitfast": mujoco.mjtIntegrator.mjINT_IMPLICITFAST,
    "implicit": mujoco.mjtIntegrator.mjINT_IMPLICIT,
    "RK4": mujoco.mjtIntegrator.mjINT_RK4,
}

STEP_FRACTION = 0.5
"""Largest time step, in times that the stone takes to fly through its own thickness."""

FROZEN = 1e12
"""Factor on the inertia of a stone that must not turn: its turn over a throw is below rounding."""

MOST_STEPS = 1e7
"""Every step is kept: ten million fill some gigabytes."""

CHUNK = 200
"""Steps between looks at whether the run is over."""


def simulate(
    scene: Scene | str | os.PathLike[str] = "lake", throw: Throw | None = None, **options: Any
) -> Trajectory:
    """Throw a scene's stones and return the trajectory of the chosen one.

    Args:
        scene: a scene, the path of one, or the name of a shipped one.
        throw: of the chosen body, instead of the scene's.
        **options: as for `simulate_all`.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    if throw is not None:
        scene = scene.rethrow(**asdict(throw))
    return simulate_all(scene, **options)[scene.body]


def simulate_all(
    scene: Scene,
    *,
    engine: Engine = "mujoco",
    integrator: str | None = None,
    timestep: float | None = None,
    limits: Limits | None = None,
    frozen_attitude: bool = False,
) -> dict[str, Trajectory]:
    """Throw every stone of a scene over still water.

    Args:
        scene: what to throw, and how.
        engine: "mujoco", or "reference" for the pure integrator (which knows no contacts).
        integrator: MuJoCo's Euler, implicitfast, implicit or RK4; or euler, midpoint, rk4 or adaptive
            of the pure one. The scene's, or rk4, if None.
        timestep: [s]; the scene's if None.
        limits: what counts as a skip and when a stone's run is over; `Limits()` if omitted.
        frozen_attitude: stones are thrown without spin and cannot turn.

    Returns:
        The trajectory of every free body, by name, in the scene's order.

    Raises:
        ValueError: an option is not allowed.
        DivergedError: a force or a motion is not finite.
    """
    limits = limits or Limits()
    timestep = float(scene.model.opt.timestep) if timestep is None else timestep
    check_positive(timestep=timestep)
    if limits.duration / timestep > MOST_STEPS:
        raise ValueError(
            f"duration {limits.duration:g} s at {timestep:g} s a step makes {limits.duration / timestep:.3g} "
            f"steps: at most {MOST_STEPS:g} are allowed; shorten the duration or lengthen the step"
        )
    if engine not in ENGINES:
        raise ValueError(f"engine is {engine!r}: use one of {', '.join(ENGINES)}")
    for name, stone in scene.stones.items():
        _doubt_timestep(name, stone, scene.throws[name], timestep)
    if frozen_attitude:
        scene = replace(scene, throws={n: replace(t, spin=0.0) for n, t in scene.throws.items()})
    warm_up()
    begun = time.perf_counter()
    run = _by_mujoco if engine == "mujoco" else _by_reference
    trajectories, used = run(scene, integrator, timestep, limits, frozen_attitude)
    wall = time.perf_counter() - begun
    for name, trajectory in trajectories.items():
        trajectory.attributes.update(
            version=version("mjskip"),
            scene=str(scene.path),
            body=name,
            engine=engine,
            integrator=used,
            timestep=timestep,
            gravity=float(-scene.model.opt.gravity[2]),
            frozen_attitude=frozen_attitude,
            throw=asdict(scene.throws[name]),
            water=asdict(scene.water),
            limits=asdict(limits),
            wall_seconds=wall,
        )
    return trajectories


@cache
def warm_up() -> None:
    """Compile or load what a run needs, so that its time is its own."""
    stone = Stone.disc(1.0, 1.0, segments=3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MjskipWarning)
        integrate(stone, Throw(), limits=Limits(duration=1e-3))
    compile_callback()


def largest_timestep(stone: Stone, speed: float) -> float:
    """Largest advisable time step for a stone at this speed [s]; infinite at rest."""
    return STEP_FRACTION * stone.thickness / speed if speed > 0.0 else math.inf


def _doubt_timestep(name: str, stone: Stone, throw: Throw, timestep: float) -> None:
    limit = largest_timestep(stone, throw.speed)
    if timestep > limit * (1.0 + 1e-9):
        warnings.warn(
            f"time step {timestep:g} s is too large for {name!r} at {throw.speed:g} m/s: skips may be "
            f"numerical; use at most {limit:.2g} s ({STEP_FRACTION:g} thickness / speed)",
            MjskipWarning,
            stacklevel=4,
        )


def _releases(scene: Scene) -> dict[str, State]:
    """How every stone leaves the hand, above the place where the scene has it."""
    found = {}
    for name, stone in scene.stones.items():
        body = scene.model.body(find_body(scene.model, name))
        found[name] = scene.throws[name].state(stone, x=float(body.pos[0]), y=float(body.pos[1]))
    return found


def _by_reference(
    scene: Scene, integrator: str | None, timestep: float, limits: Limits, frozen_attitude: bool
) -> tuple[dict[str, Trajectory], str]:
    method = integrator or "rk4"
    if method not in METHODS:
        raise ValueError(f"integrator is {method!r}: the reference engine has {', '.join(METHODS)}")
    gravity = scene.model.opt.gravity
    found = {
        name: integrate(
            scene.stones[name],
            start,
            water=scene.water,
            method=method,
            timestep=timestep,
            limits=limits,
            gravity=(float(gravity[0]), float(gravity[1]), float(gravity[2])),
            frozen_attitude=frozen_attitude,
            name=name,
        )
        for name, start in _releases(scene).items()
    }
    return found, method


def _by_mujoco(
    scene: Scene, integrator: str | None, timestep: float, limits: Limits, frozen_attitude: bool
) -> tuple[dict[str, Trajectory], str]:
    model = copy.copy(scene.model)
    if integrator is not None:
        if integrator not in INTEGRATORS:
            raise ValueError(
                f"integrator is {integrator!r}: the mujoco engine has {', '.join(INTEGRATORS)}"
            )
        model.opt.integrator = INTEGRATORS[integrator]
    used = next((n for n, code in INTEGRATORS.items() if code == model.opt.integrator), "other")
    model.opt.timestep = timestep
    data = mujoco.MjData(model)
    if frozen_attitude:
        for name in scene.stones:
            model.body_inertia[find_body(model, name)] *= FROZEN
        mujoco.mj_setConst(model, data)
        mujoco.mj_resetData(model, data)
    free = {name: _FreeBody(model, name) for name in scene.stones}
    for name, start in _releases(scene).items():
        free[name].place(data, start)
    gravity = float(-model.opt.gravity[2])
    logs = {
        name: Log(name, stone, scene.water, limits, gravity=gravity)
        for name, stone in scene.stones.items()
    }
    done = 0
    qpos, qvel = np.empty((CHUNK, model.nq)), np.empty((CHUNK, model.nv))
    with _unlogged(), attach(model, data, water=scene.water, bodies=list(scene.stones)) as coupling:
        count = 1
        qpos[0], qvel[0] = data.qpos, data.qvel
        while True:
            times: Array = timestep * np.arange(done, done + count, dtype=np.float64)
            for name, log in logs.items():
                log.extend(times, free[name].states(qpos[:count], qvel[:count]))
            coupling.check()
            _check_warnings(data)
            if all(log.end for log in logs.values()):
                break
            done, count = done + count, CHUNK
            for row in range(CHUNK):
                mujoco.mj_step(model, data)
                qpos[row], qvel[row] = data.qpos, data.qvel
    return {name: log.trajectory({}) for name, log in logs.items()}, used


class _FreeBody:
    """A body with a free joint: between MuJoCo's coordinates and the motion of its centre of mass."""

    def __init__(self, model: mujoco.MjModel, name: str) -> None:
        body = find_body(model, name)
        joint = model.body_jntadr[body]
        if model.body_parentid[body] != 0:
            raise SceneError(f"body {name!r} is not a child of the world: a stone must be")
        self._q = slice(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + 7)
        self._v = slice(model.jnt_dofadr[joint], model.jnt_dofadr[joint] + 6)
        self._centre = np.array(model.body_ipos[body])

    def place(self, data: mujoco.MjData, start: State) -> None:
        rotation = matrices(start.q)
        arm = rotation @ self._centre
        data.qpos[self._q] = [*(start.position - arm), *start.q]
        data.qvel[self._v] = [
            *(start.velocity - np.cross(start.omega, arm)),
            *(rotation.T @ start.omega),
        ]

    def states(self, qpos: Array, qvel: Array) -> Array:
        """(n, 18) for the force kernel. MuJoCo's free joint has omega in body axes."""
        position, q = qpos[:, self._q][:, :3], qpos[:, self._q][:, 3:]
        velocity, omega_body = qvel[:, self._v][:, :3], qvel[:, self._v][:, 3:]
        if not (np.isfinite(q).all() and np.linalg.norm(q, axis=1).all()):
            q = np.where(np.isfinite(q), q, 1.0)  # the log refuses the row by its other columns
        rotation = matrices(q)
        omega = np.einsum("nij,nj->ni", rotation, omega_body)
        arm = rotation @ self._centre
        return pack_states(position + arm, rotation, velocity + np.cross(omega, arm), omega)


@contextmanager
def _unlogged() -> Iterator[None]:
    """Keep MuJoCo from printing, and writing to a log file here, what is raised as an error."""
    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)


def _check_warnings(data: mujoco.MjData) -> None:
    """MuJoCo resets a simulation whose state is not finite, and only counts it."""
    for kind in ("mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC"):
        if data.warning[getattr(mujoco.mjtWarning, kind)].number:
            raise DivergedError(
                f"MuJoCo's state is not finite before t = {data.time:.6g} s ({kind}): use a smaller "
                "time step",
                time=float(data.time),
            )
