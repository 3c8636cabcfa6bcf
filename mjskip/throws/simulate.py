"""Throw the stones of a scene, by MuJoCo or by the pure integrator."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, replace
from functools import cache
from importlib.metadata import version
from typing import Any, Literal, get_args

import numpy as np

from mjskip._typing import PathLike, Progress
from mjskip.checks import check_choice, check_positive, check_switch, check_type
from mjskip.coupling.bodies import find_body
from mjskip.coupling.callback import compile_callback
from mjskip.errors import MjskipWarning
from mjskip.hydro.stone import Stone
from mjskip.rigid.attitude import angles, matrices
from mjskip.throws.engines import MujocoEngine, ReferenceEngine, release_states
from mjskip.throws.model_recording import ModelRecorder
from mjskip.throws.recording import Limits, Recorder
from mjskip.throws.reference import integrate
from mjskip.throws.run import Run
from mjskip.throws.scene import Scene, load_scene
from mjskip.throws.throw import Throw
from mjskip.throws.trajectory import Trajectory
from mjskip.waves._cells import FARTHEST
from mjskip.waves.coupled import check_water
from mjskip.waves.coupling import LOAD_RADIUS, check_law
from mjskip.waves.field import HeightField
from mjskip.waves.recording import SurfaceFrames, SurfaceRecorder

EngineName = Literal["mujoco", "reference"]
ENGINES: tuple[EngineName, ...] = get_args(EngineName)
Surface = Literal["still", "waves"]
SURFACES: tuple[Surface, ...] = get_args(Surface)
"""Of a throw: of the words of `mjskip.coupling.moving_water` those that a scene's lake knows."""

STEP_FRACTION = 0.5
"""Largest time step, in times that the stone takes to fly through its own thickness."""

CHUNK = 200
"""Steps between looks at whether the run is over."""


def simulate(
    scene: Scene | PathLike = "lake",
    throw: Throw | None = None,
    *,
    engine: EngineName = "mujoco",
    integrator: str | None = None,
    timestep: float | None = None,
    limits: Limits | None = None,
    frozen_attitude: bool = False,
    surface: Surface = "still",
    load_radius: float = LOAD_RADIUS,
    record: SurfaceFrames | None = None,
    progress: Progress | None = None,
) -> Trajectory:
    """Throw a scene's stones and return the trajectory of the chosen one.

    Arguments and errors are those of `simulate_all`, which returns the trajectories of all stones.
    """
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    return simulate_all(
        scene, throw, engine=engine, integrator=integrator, timestep=timestep, limits=limits,
        frozen_attitude=frozen_attitude, surface=surface, load_radius=load_radius, record=record,
        progress=progress,
    )[scene.body]  # fmt: skip


# Over 80 lines: the docstring explains every option; what follows is the order in which a run is put together.
def simulate_all(
    scene: Scene | PathLike = "lake",
    throw: Throw | None = None,
    *,
    engine: EngineName = "mujoco",
    integrator: str | None = None,
    timestep: float | None = None,
    limits: Limits | None = None,
    frozen_attitude: bool = False,
    surface: Surface = "still",
    load_radius: float = LOAD_RADIUS,
    record: SurfaceFrames | None = None,
    progress: Progress | None = None,
) -> dict[str, Trajectory]:
    """Throw every stone of a scene.

    Args:
        scene: a scene, the path of one, or the name of a shipped one: what to throw, and how.
        throw: of the chosen body, instead of the scene's.
        engine: "mujoco", or "reference" for the pure integrator (which knows no contacts).
        integrator: MuJoCo's Euler, implicitfast, implicit or RK4; or euler, midpoint, rk4 or adaptive
            of the pure one, which has a scheme of its own over waves. The scene's, or rk4, if None.
        timestep: [s]; the scene's if None.
        limits: what counts as a skip and when a stone's run is over; `Limits()` if omitted.
        frozen_attitude: stones are thrown without spin and cannot turn.
        surface: "still": stones feel the undisturbed level; "waves": the surface that moves under them and
            that they move (docs/water.md).
        load_radius: over waves, of the bumps that spread a load and sample the surface under it [m].
        record: keep the surface at some moments, in `Trajectory.surface`: what pictures are drawn from. Over
            still water it is that which the stones press on, and do not feel.
        progress: called with the steps done and those that the duration allows; most runs end before.

    Returns:
        The trajectory of every free body, by name, in the scene's order.

    Raises:
        ValueError: an option is not allowed.
        DivergedError: a force or a motion is not finite.
    """
    waves = surface == "waves"
    scene = scene if isinstance(scene, Scene) else load_scene(scene)
    if throw is not None:
        scene = scene.rethrow(**asdict(check_type("throw", throw, Throw)))
    limits = Limits() if limits is None else check_type("limits", limits, Limits)
    timestep = float(scene.model.opt.timestep) if timestep is None else timestep
    if record is not None:
        check_type("record", record, SurfaceFrames, "give a mjskip.waves.SurfaceFrames")
    check_switch("frozen_attitude", frozen_attitude)
    check_choice("engine", engine, ENGINES)
    check_surface(surface, scene)
    check_positive(timestep=timestep)
    _check_options(scene, engine, timestep, limits, frozen_attitude=frozen_attitude, waves=waves)
    if scene.afloat:
        limits = replace(limits, max_contact=max(limits.max_contact, 2.0 * limits.duration))
    for name in () if scene.afloat else scene.stones.keys() - scene.held:
        _warn_timestep(name, scene.stones[name], scene.throws[name], timestep)
    if frozen_attitude:
        scene = replace(scene, throws={n: replace(t, spin=0.0) for n, t in scene.throws.items()})

    make = MujocoEngine if engine == "mujoco" else ReferenceEngine
    machine: MujocoEngine | ReferenceEngine = make(
        scene, integrator, timestep, frozen_attitude=frozen_attitude, over_waves=waves
    )
    gravity = scene.model.opt.gravity.copy()
    field = scene.field() if waves or record is not None else None
    recorder = None
    if field is not None and record is not None:
        record.check_duration(limits.duration, timestep)
        recorder = SurfaceRecorder(record, field, timestep=timestep)
    walls = None
    if field is not None and waves:
        _check_field(scene, field, timestep, engine)
        walls = _walls(field)
    logs = {
        name: Recorder(name, stone, scene.water_of(name), limits, gravity=gravity, walls=walls)
        for name, stone in scene.stones.items()
    }
    warm_up()
    begun = time.perf_counter()
    model_log = None
    with machine:
        if isinstance(machine, MujocoEngine) and machine.jointed:
            model_log = ModelRecorder(
                machine.data, timestep=timestep, frames=record, surface=machine.surface(), middle=_middle(scene)
            )  # fmt: skip
            machine.observe = model_log.step
            if (
                model_log.recording is not None
            ):  # the sea is shown, not the rings that loads would make
                field = recorder = None
        run = Run(
            scene, machine, timestep, field=field, feel=waves, load_radius=load_radius, recorder=recorder
        )  # fmt: skip
        _follow(run, logs, timestep, round(limits.duration / timestep), progress)
    wall = time.perf_counter() - begun

    trajectories = {name: log.trajectory({}) for name, log in logs.items()}
    qpos, surfaces = None, recorder.recording if recorder is not None else None
    if model_log is not None:
        surfaces, qpos = model_log.recording or surfaces, np.array(model_log.qpos)
    thrown = {name: _thrown(scene, name, trajectories[name]) for name in scene.held}
    scene = replace(scene, throws={**scene.throws, **thrown})
    common = {
        "engine": engine, "integrator": machine.integrator, "timestep": timestep, "surface": surface,
        "frozen_attitude": frozen_attitude, "limits": asdict(limits), "wall_seconds": wall,
        **({"load_radius": load_radius} if waves else {}),
    }  # fmt: skip
    return {
        name: replace(
            one, surface=surfaces, qpos=None if qpos is None else qpos[: len(one.time)],
            attributes=_provenance(scene, name) | common,
        )
        for name, one in trajectories.items()
    }  # fmt: skip


def _provenance(scene: Scene, name: str) -> dict[str, Any]:
    """What a stone of a scene was, for the attributes of its trajectory."""
    return {
        "version": version("mjskip"), "scene": str(scene.path), "body": name, "afloat": scene.afloat,
        "gravity": scene.model.opt.gravity.tolist(), "throw": asdict(scene.throws[name]),
        "water": asdict(scene.water_of(name)),
    }  # fmt: skip


def _follow(
    run: Run,
    logs: Mapping[str, Recorder],
    timestep: float,
    most: int,
    progress: Progress | None,
) -> None:
    """Move on until every stone's run is over; where steps are slow, tell of progress more often."""
    done, piece = 0, CHUNK if progress is None else 1
    while not all(log.end for log in logs.values()):
        left = CHUNK
        while left:
            steps, begun = min(piece, left), time.perf_counter()
            block = run.advance(steps)
            times = timestep * np.arange(done, done + steps, dtype=np.float64)
            for n, name in enumerate(run.engine.names):
                logs[name].extend(
                    times, block.states[:, n], block.loads[:, n], block.reactions[:, n]
                )
            done, left = done + steps, left - steps
            if progress is not None:
                progress(min(done, most), most)
                took = time.perf_counter() - begun
                piece = (
                    min(2 * piece, CHUNK)
                    if took < 0.05
                    else max(1, min(piece, int(piece * 0.2 / took)))
                )
    run.finish()


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


def check_surface(surface: str, scene: Scene) -> None:
    """Refuse a surface that a throw of this scene does not know.

    Raises:
        ValueError: says which it knows, and where the other is.
    """
    if surface == "deep":
        raise ValueError(
            "surface is 'deep': a throw keeps the lake of its scene, which is 'still' or 'waves'; real waves go with "
            "the bodies, by mjskip.add_water(spec, surface='deep') and mj_step, or by mjskip.throws.two_way"
        )
    check_choice("surface", surface, SURFACES)
    if surface == "waves" and scene.plugged:
        there = (
            "its bodies radiate, and make and feel waves already; leave surface out"
            if scene.water.radiation
            else "say surface there by <config>"
        )
        raise ValueError(
            f"surface is 'waves': this scene's water comes from the engine plugin; {there}"
        )


def _check_options(
    scene: Scene, engine: EngineName, timestep: float, limits: Limits, *,
    frozen_attitude: bool, waves: bool,
) -> None:  # fmt: skip
    """Refuse what cannot be done together."""
    limits.check_steps(timestep, bodies=len(scene.stones))
    if waves:
        check_law(scene.water.law)
    if scene.plugged and scene.water != scene.plugged[scene.body]:
        raise ValueError(
            f"the water of {scene.body!r} comes from the plugin in {scene.path}: change its <config> there"
        )
    if scene.afloat and (engine != "mujoco" or frozen_attitude or waves):
        raise ValueError(
            f"{scene.path} is afloat: engine must be 'mujoco' (the reference engine has no joints), the attitude "
            "free, and surface 'still' (waves under what floats: mjskip.add_water)"
        )
    if scene.held and (engine != "mujoco" or frozen_attitude):
        raise ValueError(
            f"{', '.join(scene.held)}: thrown by an arm, so that engine must be 'mujoco' (the reference "
            "engine knows no arm) and the attitude free"
        )


def _warn_timestep(name: str, stone: Stone, throw: Throw, timestep: float) -> None:
    limit = largest_timestep(stone, throw.speed)
    if timestep > limit * (1.0 + 1e-9):
        warnings.warn(
            f"time step {timestep:g} s is too large for {name!r} at {throw.speed:g} m/s: skips may be "
            f"numerical; use at most {limit:.2g} s ({STEP_FRACTION:g} thickness / speed)",
            MjskipWarning,
            stacklevel=4,
        )


def _check_field(scene: Scene, field: HeightField, timestep: float, engine: EngineName) -> None:
    """Refuse a run that the water cannot be part of."""
    check_water(field, timestep, float(-scene.model.opt.gravity[2]))
    for name, start in release_states(scene).items():
        x, y = float(start.position[0]), float(start.position[1])
        if not (abs(x) < FARTHEST * field.spacing and abs(y) < FARTHEST * field.spacing):
            raise ValueError(
                f"{name!r} starts at ({x:g}, {y:g}): over waves give places within {FARTHEST * field.spacing:g} m"
            )
        if not field.contains(x, y):
            west, east, south, north = _walls(field) or (0.0, 0.0, 0.0, 0.0)
            raise ValueError(
                f"{name!r} starts at ({x:g}, {y:g}), outside the walls of the lake of {scene.path}: x from {west:g} to "
                f"{east:g} m, y from {south:g} to {north:g} m"
            )
    if engine == "reference" and scene.obstacles:
        warnings.warn(
            "the reference engine knows no contacts: its stones pass through land, and over still water there",
            MjskipWarning,
            stacklevel=3,
        )


def _middle(scene: Scene) -> tuple[float, float]:
    """Where the chosen body begins (x, y) [m]."""
    x, y, _ = scene.model.body_pos[find_body(scene.model, scene.body)].tolist()
    return x, y


def _walls(field: HeightField) -> tuple[float, float, float, float] | None:
    """West, east, south and north wall [m]; None if there are none."""
    if field.shape is None or field.boundary == "periodic":
        return None
    (x, y), (nx, ny), half = field.centre, field.shape, 0.5 * field.spacing
    return x - nx * half, x + nx * half, y - ny * half, y + ny * half


def _thrown(scene: Scene, name: str, trajectory: Trajectory) -> Throw:
    """The throw that an arm made, as it was when the stone was let go."""
    model, body = scene.model, find_body(scene.model, name)
    release = max(
        when
        for grip, when in scene.arm.release_times.items()
        if body in (model.equality(grip).obj1id[0], model.equality(grip).obj2id[0])
    )
    k = min(int(np.searchsorted(trajectory.time, release)), len(trajectory.time) - 1)
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
