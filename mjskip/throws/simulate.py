"""Throw the stones of a scene, by MuJoCo or by the pure integrator."""

from __future__ import annotations

import math
import os
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cache
from importlib.metadata import version
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from mjskip.checks import check_positive
from mjskip.coupling.bodies import find_body
from mjskip.coupling.callback import compile_callback
from mjskip.errors import MjskipWarning
from mjskip.hydro.stone import Stone
from mjskip.rigid.attitude import angles, matrices
from mjskip.throws.engines import Engine, Motion, MujocoEngine, ReferenceEngine, releases
from mjskip.throws.recording import Limits, Recorder
from mjskip.throws.reference import integrate
from mjskip.throws.scene import Scene, load_scene
from mjskip.throws.throw import Throw
from mjskip.throws.trajectory import Trajectory
from mjskip.waves.lake import Lake
from mjskip.waves.twoway import MovingSurface

Array = npt.NDArray[np.float64]
EngineName = Literal["mujoco", "reference"]
ENGINES: tuple[EngineName, ...] = get_args(EngineName)
Surface = Literal["still", "waves"]
SURFACES: tuple[Surface, ...] = get_args(Surface)

STEP_FRACTION = 0.5
"""Largest time step, in times that the stone takes to fly through its own thickness."""

MOST_STEPS = 1e7
"""Every step is kept: ten million fill some gigabytes."""

CHUNK = 200
"""Steps between looks at whether the run is over."""

WAVES_CHUNK = 50
"""The same over waves, where a step costs more."""


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
    engine: EngineName = "mujoco",
    integrator: str | None = None,
    timestep: float | None = None,
    limits: Limits | None = None,
    frozen_attitude: bool = False,
    surface: Surface = "still",
    own_dent: bool = False,
) -> dict[str, Trajectory]:
    """Throw every stone of a scene.

    Args:
        scene: what to throw, and how.
        engine: "mujoco", or "reference" for the pure integrator (which knows no contacts).
        integrator: MuJoCo's Euler, implicitfast, implicit or RK4; or euler, midpoint, rk4 or adaptive
            of the pure one. The scene's, or rk4, if None.
        timestep: [s]; the scene's if None.
        limits: what counts as a skip and when a stone's run is over; `Limits()` if omitted.
        frozen_attitude: stones are thrown without spin and cannot turn.
        surface: "still": stones feel the undisturbed level; "waves": the moving surface, see
            `mjskip.waves.twoway`.
        own_dent: over waves, whether a stone feels the response to its own current touch.

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
    for option, value, allowed in (("engine", engine, ENGINES), ("surface", surface, SURFACES)):
        if value not in allowed:
            raise ValueError(f"{option} is {value!r}: use one of {', '.join(allowed)}")
    if surface == "waves" and integrator == "adaptive":
        raise ValueError("integrator is 'adaptive': waves move on at a fixed step; use rk4")
    if surface == "waves" and scene.plugged:
        raise ValueError(
            "surface is 'waves': the engine plugin knows still water only; take it out of the scene"
        )
    if scene.plugged and scene.water != scene.plugged[scene.body]:
        raise ValueError(
            f"the water of {scene.body!r} comes from the plugin in {scene.path}: change its <config> there"
        )
    if scene.held and (engine != "mujoco" or frozen_attitude):
        raise ValueError(
            f"{', '.join(scene.held)}: thrown by an arm, so that engine must be 'mujoco' (the reference "
            "engine knows no arm) and the attitude free"
        )
    for name in scene.stones.keys() - scene.held:
        _doubt_timestep(name, scene.stones[name], scene.throws[name], timestep)
    if frozen_attitude:
        scene = replace(scene, throws={n: replace(t, spin=0.0) for n, t in scene.throws.items()})
    make = MujocoEngine if engine == "mujoco" else ReferenceEngine
    machine: MujocoEngine | ReferenceEngine = make(
        scene, integrator, timestep, frozen_attitude=frozen_attitude
    )
    gravity = float(-scene.model.opt.gravity[2])
    lake = scene.lake() if surface == "waves" else None
    if lake is not None:
        _doubt_lake(scene, lake, timestep, engine)
    walls = None if lake is None else _walls(lake)
    logs = {
        name: Recorder(
            name, stone, scene.water_of(name), limits, gravity=scene.model.opt.gravity, walls=walls
        )
        for name, stone in scene.stones.items()
    }
    warm_up()
    begun = time.perf_counter()
    with machine:
        if lake is None:
            _over_still_water(machine, logs, timestep)
        else:
            moving = MovingSurface(
                lake,
                machine.blocks,
                density=scene.water.density,
                gravity=gravity,
                own_dent=own_dent,
            )
            _over_waves(machine, logs, timestep, moving)
    wall = time.perf_counter() - begun
    trajectories = {name: log.trajectory({}) for name, log in logs.items()}
    thrown = {name: _thrown(scene, name, trajectories[name]) for name in scene.held}
    scene = replace(scene, throws={**scene.throws, **thrown})
    for name, trajectory in trajectories.items():
        if own_dent and surface == "waves":
            _doubt_energy(name, trajectory, gravity)
        trajectory.attributes.update(
            version=version("mjskip"),
            scene=str(scene.path),
            body=name,
            engine=engine,
            integrator=machine.integrator,
            timestep=timestep,
            gravity=scene.model.opt.gravity.tolist(),
            surface=surface,
            own_dent=own_dent,
            frozen_attitude=frozen_attitude,
            throw=asdict(scene.throws[name]),
            water=asdict(scene.water_of(name)),
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


def _doubt_lake(scene: Scene, lake: Lake, timestep: float, engine: EngineName) -> None:
    """Refuse a run that a lake cannot be part of."""
    if timestep > lake.max_timestep:
        raise ValueError(
            f"time step {timestep:g} s is too long for the waves of {scene.path}: use at most "
            f"{lake.max_timestep:.3g} s, or a larger spacing"
        )
    for name, start in releases(scene).items():
        if not lake.contains(float(start.position[0]), float(start.position[1])):
            west, east, south, north = _walls(lake) or (0.0, 0.0, 0.0, 0.0)
            raise ValueError(
                f"{name!r} starts at ({start.position[0]:g}, {start.position[1]:g}), outside the walls of the lake of "
                f"{scene.path}: x from {west:g} to {east:g} m, y from {south:g} to {north:g} m"
            )
    if engine == "reference" and scene.obstacles:
        warnings.warn(
            "the reference engine knows no contacts: its stones pass through land, and over still water there",
            MjskipWarning,
            stacklevel=3,
        )


def _walls(lake: Lake) -> tuple[float, float, float, float] | None:
    """West, east, south and north wall [m], half a cell outside the outermost points; None if endless."""
    if lake.shape is None:
        return None
    half = 0.5 * lake.spacing
    (west, south), (east, north) = lake.place_of(0, 0), lake.place_of(*(n - 1 for n in lake.shape))
    return west - half, east + half, south - half, north + half


def _doubt_energy(name: str, trajectory: Trajectory, gravity: float) -> None:
    """Say if a stone got more energy from its own dent than it was thrown with."""
    moving = 0.5 * (trajectory.P * trajectory.velocity + trajectory.L * trajectory.omega).sum(
        axis=1
    )
    energy = moving + trajectory.mass * gravity * trajectory.x[:, 2]
    if energy.max() > 1.01 * energy[0]:
        k = int(energy.argmax())
        warnings.warn(
            f"{name!r} has {energy[k] / energy[0]:.3g} times the energy of its release at {trajectory.time[k]:.4g} s: "
            "its own dent has driven it; take this run for wrong, and leave own_dent off",
            MjskipWarning,
            stacklevel=3,
        )


def _over_still_water(engine: Engine, logs: Mapping[str, Recorder], timestep: float) -> None:
    """Run until every stone's run is over; forces are observed from the motion afterwards."""
    motion, done = engine.start(), 0
    while True:
        count = len(next(iter(motion.values())))
        times = timestep * np.arange(done, done + count, dtype=np.float64)
        for name, log in logs.items():
            log.extend(times, motion[name])
        if all(log.end for log in logs.values()):
            return
        done += count
        motion = engine.advance(CHUNK)
        engine.check()


def _over_waves(
    engine: Engine, logs: Mapping[str, Recorder], timestep: float, surface: MovingSurface
) -> None:
    """The same with the surface moving: it is looked at before every step and pressed on after.

    A single stone does so in compiled code wherever it can.
    """
    motion, done, count, hop = engine.start(), 0, 0, engine.hop
    rows: dict[str, list[tuple[Array, Array, Array]]] = {name: [] for name in logs}
    while True:
        most = WAVES_CHUNK - count
        parts = surface.glide(hop, motion, timestep, most) if hop else None
        for name, part in (parts or _step(engine, surface, motion, timestep)).items():
            motion[name] = part[0][-1:]
            rows[name].append(part)
        steps = len(part[1])
        count += steps
        if count == WAVES_CHUNK:
            engine.check()
            times = timestep * np.arange(done, done + count, dtype=np.float64)
            for name, log in logs.items():
                states, observed, shares = zip(*rows[name], strict=True)
                log.extend(
                    times,
                    np.concatenate([part[:-1] for part in states]),
                    np.concatenate(observed),
                    np.concatenate(shares),
                )
                rows[name].clear()
            if all(log.end for log in logs.values()):
                return
            done, count = done + count, 0


def _step(
    engine: Engine, surface: MovingSurface, motion: Motion, timestep: float
) -> dict[str, tuple[Array, Array, Array]]:
    """One step over waves, as `MovingSurface.glide` makes several."""
    seen = surface.look(motion)
    shares = surface.advance(timestep)
    after = engine.advance(1)
    return {
        name: (np.concatenate([motion[name], after[name]]), seen[name], np.array([shares[name]]))
        for name in after
    }


def _thrown(scene: Scene, name: str, trajectory: Trajectory) -> Throw:
    """The throw that an arm made, as it was when the stone was let go."""
    model, body = scene.model, find_body(scene.model, name)
    let_go = max(
        when
        for grip, when in scene.arm.release_times.items()
        if body in (model.equality(grip).obj1id[0], model.equality(grip).obj2id[0])
    )
    k = min(int(np.searchsorted(trajectory.time, let_go)), len(trajectory.time) - 1)
    velocity, omega = trajectory.velocity[k], trajectory.omega[k]
    normal = matrices(trajectory.q[k]) @ scene.stones[name].disc_normal
    attack, bank, spin = angles(normal, velocity, omega)
    return Throw(
        speed=float(np.linalg.norm(velocity)),
        spin=float(spin),
        attack=float(attack),
        descent=float(np.arctan2(-velocity[2], np.hypot(velocity[0], velocity[1]))),
        bank=float(bank),
        wobble=float(np.linalg.norm(omega - spin * normal)),
        height=max(0.0, float(trajectory.clearance[k])),
    )
