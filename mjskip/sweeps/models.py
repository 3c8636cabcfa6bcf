"""Sweeps of models in which nothing is thrown: what floats, robots, whatever has a sensor.

    data = mjskip.sweep_model("boat", {"sea_period": [1.5, 2, 3], "sea_height": [0.1]}, results=["pitch", "heave"])

Every point of the grid is a run of the model from its start, with some parameters changed; the results are taken over
its last part.
"""

from __future__ import annotations

import hashlib
import io
import math
import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from importlib.metadata import version
from itertools import count as count_up
from itertools import product
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from mjskip._typing import Array, PathLike, Progress
from mjskip.checks import check_names, check_positive, fault
from mjskip.coupling.bodies import body_name, find_body, free_bodies
from mjskip.coupling.loading import check_replicated_plugins
from mjskip.coupling.plugin import register_plugin
from mjskip.coupling.plugin_keys import NAME, plugin_bodies
from mjskip.coupling.water_surface import add_water
from mjskip.errors import DivergedError, MjskipError, MjskipWarning, SceneError
from mjskip.hydro.hydrostatics import trim_and_heel
from mjskip.hydro.seas import SEA_UNITS, sea_text
from mjskip.hydro.water import Water
from mjskip.rigid.attitude import matrices, quaternions
from mjskip.sweeps.design import NAMED, WATER, Design
from mjskip.sweeps.sweep import ask
from mjskip.throws.scene import find_scene

if TYPE_CHECKING:
    import xarray as xr

SEA = {f"sea_{key}": SEA_UNITS[key] for key in SEA_UNITS}
POSE = {"x": "m", "y": "m", "z": "m", "roll": "rad", "pitch": "rad", "yaw": "rad"}
"""Where the body begins: place of its frame; angles by which it is turned from how the model has it, about the axes of the
world, roll first."""
BODY = {"mass": "kg"}
CONTROL = "ctrl_"
KEYFRAME = "keyframe"

STATES: dict[str, tuple[str, str]] = {
    "draft": ("m", "mean depth of the lowest wet point below z = 0"),
    "trim": ("rad", "mean angle of the body's x axis above the horizontal"),
    "heel": ("rad", "mean angle about the body's x axis"),
    "heave": ("m", "half of the range of the height of the centre of mass"),
    "pitch": ("rad", "half of the range of the trim"),
    "roll": ("rad", "half of the range of the heel"),
    "trim_max": ("rad", "greatest size of the trim"),
    "heel_max": ("rad", "greatest size of the heel"),
    "heave_period": ("s", "mean time from one rise through the mean height to the next"),
    "speed": ("m s-1", "mean horizontal speed of the centre of mass"),
    "drift": ("m", "horizontal way of the centre of mass from the start to the end"),
}
"""What is known of a body that floats, over the last part of a run."""
PARTS = {"mean": "mean", "min": "least", "max": "greatest"}
WORDS = {
    "reason": "why there is no result",
    "status": "ok, refused (its parameters make no model), diverged or failed",
}
INTERVAL = 0.02
"""Time from one look to the next [s]."""
CHUNK = 8
"""Runs that are done, written and forgotten together."""


def parameters_of(model: mujoco.MjModel) -> tuple[dict[str, str], dict[str, tuple[str, ...]]]:
    """What can be varied in a model: SI units by name, and words of those that take words."""
    controls = {f"{CONTROL}{model.actuator(k).name}": "" for k in range(model.nu)}
    keys = tuple(model.key(k).name for k in range(model.nkey) if model.key(k).name)
    named: dict[str, tuple[str, ...]] = {**NAMED, **({KEYFRAME: keys} if keys else {})}
    body = {**POSE, **BODY} if free_bodies(model) else {}
    units = {**WATER, **SEA, **body, **controls, **dict.fromkeys(named, "")}
    return units, named


def open_model(path: PathLike) -> tuple[mujoco.MjSpec, mujoco.MjModel]:
    """The model of a file, or of a shipped scene by its name, as it can be altered and as it is compiled.

    A model without the plugin's water gets `Water.floating()`.

    Raises:
        SceneError: the file is missing or does not compile.
    """
    file = find_scene(path)
    check_replicated_plugins(file)
    register_plugin()
    try:
        spec = mujoco.MjSpec.from_file(str(file))
        if not any(one.plugin_name == NAME for one in spec.plugins):
            add_water(spec, Water.floating())
        return spec, spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"{file} does not compile as MJCF: {reason}") from error


# Over 80 lines: the docstring explains every option.
def sweep_model(
    model: PathLike,
    vary: Mapping[str, Sequence[Any] | Array] | None = None,
    *,
    samples: Mapping[str, Array] | None = None,
    scatter: Mapping[str, Array] | None = None,
    given: Mapping[str, Any] | None = None,
    results: Sequence[str] | None = None,
    body: str | None = None,
    duration: float = 20.0,
    settle: float | None = None,
    timestep: float | None = None,
    path: PathLike | None = None,
    chunk: int = CHUNK,
    threads: int | None = None,
    scheduler: str | None = None,
    progress: Progress | None = None,
) -> xr.Dataset:
    """Run a model over a grid of parameters and say what became of its bodies and sensors.

    Parameters are the water's (water_density, viscosity, law, ...), the sea's (sea_ before the keys of `Sea.from_text`,
    angles in radians; bodies then radiate), where and how the body begins (x, y, z, roll, pitch, yaw, keyframe), its mass
    (its inertia grows with it) and controls (ctrl_ before the name of an actuator).

    Args:
        model: an MJCF file, or the name of a shipped scene.
        vary: values by parameter; each parameter becomes a dimension.
        samples: values by parameter, all along one dimension "sample".
        scatter: additions by parameter along a dimension "member".
        given: single values by parameter, for all points.
        results: names of sensors, of which mean, least and greatest value are kept, and of `STATES`; all of `STATES` if
            None.
        body: the body that floats, and whose pose and mass are varied; the first free body if None.
        duration: of a run [s].
        settle: time from the start that does not count [s]; half of the duration if None.
        timestep: [s]; the model's if None.
        path: Zarr store; in memory only if None. A store that is there is gone on with.
        chunk: runs that are done and written together.
        threads: on this machine; as many as there are processors if None.
        scheduler: address of a Dask scheduler whose workers do the runs.
        progress: called with the runs done and to do.

    Returns:
        The Dataset: results over the named dimensions with units, `status` and `reason`; its attribute `request` is the
        provenance as JSON.

    Raises:
        ValueError: an argument is not allowed.
        MjskipError: the model does not compile, the store was made by another request, or the scheduler is lost.
    """
    check_positive(duration=duration)
    settle = 0.5 * duration if settle is None else settle
    if not 0.0 <= settle < duration:
        raise fault(
            "settle", settle, f"give a time from 0 to less than the duration, {duration:g} s"
        )
    if timestep is not None:
        check_positive(timestep=timestep)
    spec, compiled = open_model(model)
    units, named = parameters_of(compiled)
    design = Design(
        axes=vary or {}, samples=samples or {}, scatter=scatter or {}, parameters=units, named=named
    )
    fixed = Design(
        axes={name: [value] for name, value in (given or {}).items()}, parameters=units, named=named
    )
    twice = set(fixed.axes) & set(design.varied)
    if twice:
        raise ValueError(f"{min(twice)} is both given and varied: give it once")
    chosen = _chosen_body(compiled, body)
    sensors = _sensors(compiled)
    names = check_names("results", results if results is not None else (STATES if chosen else ()))
    known = {**(STATES if chosen else {}), **sensors}
    if not names:
        listed = ", ".join(sensors) or "which it has none of either"
        raise ValueError(f"{model} has no free body: name sensors as results, {listed}")
    for name in names:
        if name not in known:
            raise ValueError(f"no result {name!r}: choose from {', '.join(known)}")
    archive = io.BytesIO()
    spec.to_zip(archive)
    job = ModelJob(
        name=find_scene(model).name,
        archive=archive.getvalue(),
        xml=spec.to_xml(),
        body=chosen,
        design=design,
        given=fixed.point(dict.fromkeys(fixed.sizes, 0), {}) if fixed.axes else {},
        names=tuple(names),
        sizes={name: sensors[name] for name in names if name not in STATES or not chosen},
        duration=duration,
        settle=settle,
        timestep=float(compiled.opt.timestep) if timestep is None else timestep,
    )
    return ask(job, path=path, chunk=chunk, threads=threads, scheduler=scheduler, progress=progress)


def _chosen_body(model: mujoco.MjModel, name: str | None) -> str:
    """The free body that is asked about, "" if there is none."""
    names = [body_name(model, b) for b in free_bodies(model)]
    if name is None:
        return names[0] if names else ""
    if name not in names:
        raise SceneError(
            f"the model has no free body {name!r}: it has {', '.join(names) or 'none'}"
        )
    return name


def _sensors(model: mujoco.MjModel) -> dict[str, int]:
    """How many numbers each sensor shows, by its name."""
    return {
        model.sensor(k).name: int(model.sensor_dim[k])
        for k in range(model.nsensor)
        if model.sensor(k).name
    }


@dataclass(frozen=True, kw_only=True, eq=False)
class ModelJob:
    """A sweep of a model, whole: what workers are given.

    Attributes:
        name: of the file.
        archive: the model as `MjSpec.to_zip` writes it, with its assets.
        xml: the model, for its mark.
        body: that floats, "" if none.
        design: what is varied.
        given: parameters that are not, and are not as in the model.
        names: of the results that were asked for.
        sizes: how many numbers each sensor among them shows.
        duration, settle: of a run, and what of it does not count [s].
        timestep: [s].
    """

    name: str
    archive: bytes
    xml: str
    body: str
    design: Design
    given: Mapping[str, Any]
    names: tuple[str, ...]
    sizes: Mapping[str, int]
    duration: float
    settle: float
    timestep: float

    @property
    def results(self) -> Mapping[str, tuple[str, str]]:
        """Unit and meaning by name."""
        found: dict[str, tuple[str, str]] = {}
        for name in self.names:
            if name not in self.sizes:
                found[name] = STATES[name]
                continue
            for column, text in _columns(name, self.sizes[name]):
                found |= {
                    f"{column}_{part}": ("", f"{how} of {text}") for part, how in PARTS.items()
                }
        return found

    @property
    def words(self) -> Mapping[str, str]:
        """Words of a run."""
        return WORDS

    @property
    def title(self) -> str:
        """Of the file."""
        return f"sweep of {self.name}, SI units, angles in radians"

    def request(self) -> dict[str, Any]:
        """All that the results depend on, as JSON would have it."""
        return {
            "version": version("mjskip"),
            "model": f"{self.name} (sha256 {hashlib.sha256(self.xml.encode()).hexdigest()[:16]})",
            "body": self.body,
            "given": dict(self.given),
            "results": list(self.names),
            "duration": self.duration,
            "settle": self.settle,
            "timestep": self.timestep,
            "design": self.design.summary(),
        }

    def run(
        self,
        index: tuple[slice, ...],
        *,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> dict[str, np.ndarray[Any, Any]]:
        """The runs of one block of the grid: an array of the block's shape for every result."""
        register_plugin()
        shape = tuple(part.stop - part.start for part in index)
        sizes = list(self.design.sizes)
        spec = mujoco.MjSpec.from_zip(io.BytesIO(self.archive))
        base = _base(spec.compile(), self.body) if self.design.scatter else {}
        base |= {name: value for name, value in self.given.items() if name in self.design.scatter}
        points = [
            {**self.given, **self.design.point(dict(zip(sizes, place, strict=True)), base)}
            for place in product(*(range(part.start, part.stop) for part in index))
        ]
        found: dict[str, Any] = {name: np.full(len(points), np.nan) for name in self.results}
        found |= {name: np.full(len(points), "", dtype=object) for name in WORDS}

        done = count_up(1)

        def one(k: int) -> None:
            do(k)
            if progress:
                progress(next(done))

        def do(k: int) -> None:
            try:
                model = self._altered(points[k])
            except (ValueError, MjskipError) as error:
                found["status"][k], found["reason"][k] = "refused", _line(error)
                return
            try:
                for name, value in self._outcome(model, points[k]).items():
                    found[name][k] = value
                found["status"][k] = "ok"
            except DivergedError as error:
                found["status"][k], found["reason"][k] = "diverged", _line(error)
            except (ValueError, MjskipError, mujoco.FatalError) as error:
                found["status"][k], found["reason"][k] = "failed", _line(error)

        with warnings.catch_warnings(), ThreadPoolExecutor(threads or os.cpu_count()) as pool:
            warnings.simplefilter("ignore", MjskipWarning)  # doubts about single points
            list(pool.map(one, range(len(points))))
        return {name: values.reshape(shape) for name, values in found.items()}

    def _altered(self, point: Mapping[str, Any]) -> mujoco.MjModel:
        """The model of a point: its water, sea and mass."""
        spec = mujoco.MjSpec.from_zip(io.BytesIO(self.archive))
        spec.option.timestep = self.timestep
        if "mass" in point:
            _set_mass(spec, self.body, point["mass"])
        water = {
            name.removeprefix("water_"): point[name] for name in (*WATER, *NAMED) if name in point
        }
        sea = {name.removeprefix("sea_"): point[name] for name in SEA if name in point}
        for plugin in spec.plugins:
            if plugin.plugin_name == NAME:
                config = dict(plugin.config) | {key: _text(value) for key, value in water.items()}
                if sea:
                    config |= {"radiation": "true", "sea": sea_text(sea, config.get("sea", ""))}
                plugin.config = config
        return spec.compile()

    def _outcome(self, model: mujoco.MjModel, point: Mapping[str, Any]) -> dict[str, float]:
        """Run it and say what became of it."""
        data = mujoco.MjData(model)
        if KEYFRAME in point:
            mujoco.mj_resetDataKeyframe(model, data, model.key(point[KEYFRAME]).id)
        if self.body:
            _place(model, data, find_body(model, self.body), point)
        for name, value in point.items():
            if name.startswith(CONTROL):
                data.ctrl[model.actuator(name.removeprefix(CONTROL)).id] = value
        mujoco.mj_forward(model, data)
        watched = _Watched(model, self.body, self.sizes)
        watched.look(data)
        every = max(1, round(INTERVAL / self.timestep))
        for _ in range(math.ceil(self.duration / (every * self.timestep) - 1e-9)):
            before = data.time
            mujoco.mj_step(model, data, every)
            if data.time < before + 0.5 * every * self.timestep or not np.isfinite(data.qpos).all():
                raise DivergedError(
                    f"not finite after t = {before:.6g} s: use a smaller time step", time=before
                )
            watched.look(data)
        found = watched.outcome(self.settle)
        return {name: found[name] for name in self.results}


class _Watched:
    """What is seen of a run."""

    def __init__(self, model: mujoco.MjModel, body: str, sizes: Mapping[str, int]) -> None:
        self._sensors = {name: model.sensor(name) for name in sizes}
        self._root = find_body(model, body) if body else 0
        self._hulls = [
            (wet.body, inertia.centre, built.hull.vertices)
            for wet, inertia, built, _ in (plugin_bodies(model) if body else [])
            if built.hull is not None and model.body_rootid[wet.body] == self._root
        ]
        self._rows: list[list[float]] = []
        self._shown: dict[str, list[Array]] = {name: [] for name in sizes}

    def look(self, data: mujoco.MjData) -> None:
        """Note what is now."""
        for name, sensor in self._sensors.items():
            first = int(sensor.adr[0])
            self._shown[name].append(data.sensordata[first : first + int(sensor.dim[0])].copy())
        if not self._root:
            self._rows.append([data.time])
            return
        lowest = math.inf
        for body, centre, vertices in self._hulls:
            turn = data.xmat[body].reshape(3, 3)
            lowest = min(lowest, data.xpos[body, 2] + float(((vertices + centre) @ turn[2]).min()))
        trim, heel = trim_and_heel(data.xmat[self._root].reshape(3, 3))
        self._rows.append([data.time, *data.subtree_com[self._root], lowest, trim, heel])

    def outcome(self, settle: float) -> dict[str, float]:
        """Results of what was seen after a time."""
        rows = np.array(self._rows)
        counts = rows[:, 0] >= settle - 1e-9
        found: dict[str, float] = {}
        for name, values in self._shown.items():
            shown = np.array(values)[counts]
            for k, (column, _) in enumerate(_columns(name, shown.shape[1])):
                for part, how in (("mean", np.mean), ("min", np.min), ("max", np.max)):
                    found[f"{column}_{part}"] = float(how(shown[:, k]))
        if self._root:
            found |= _floating(rows, counts)
        return found


def _floating(rows: Array, counts: Any) -> dict[str, float]:
    """`STATES` of rows of time, centre of mass (3), height of the lowest wet point, trim and heel."""
    time, _, _, height, lowest, trim, heel = rows[counts].T
    way = np.linalg.norm(np.diff(rows[counts, 1:3], axis=0), axis=1).sum()
    return {
        "draft": float(-lowest.mean()),
        "trim": float(trim.mean()),
        "heel": float(heel.mean()),
        "heave": float(0.5 * np.ptp(height)),
        "pitch": float(0.5 * np.ptp(trim)),
        "roll": float(0.5 * np.ptp(heel)),
        "trim_max": float(np.abs(trim).max()),
        "heel_max": float(np.abs(heel).max()),
        "heave_period": _period(time, height - height.mean()),
        "speed": float(way / (time[-1] - time[0])) if len(time) > 1 else math.nan,
        "drift": float(np.linalg.norm(rows[-1, 1:3] - rows[0, 1:3])),
    }


def _period(time: Array, about: Array) -> float:
    """Mean time between rises through zero, interpolated; not a number if there are fewer than two."""
    rises = np.flatnonzero((about[:-1] < 0.0) & (about[1:] >= 0.0))
    if len(rises) < 2:
        return math.nan
    moments = time[rises] - about[rises] * (time[rises + 1] - time[rises]) / (
        about[rises + 1] - about[rises]
    )
    return float((moments[-1] - moments[0]) / (len(rises) - 1))


def _columns(name: str, size: int) -> list[tuple[str, str]]:
    """Name and meaning of the numbers of a sensor."""
    if size == 1:
        return [(name, f"sensor {name}")]
    return [(f"{name}_{k}", f"number {k} of sensor {name}") for k in range(size)]


def _base(model: mujoco.MjModel, body: str) -> dict[str, float]:
    """Parameters as the model has them, for what is scattered about them."""
    base = {**dict.fromkeys(SEA, 0.0), **dict.fromkeys(POSE, 0.0)}
    base |= {f"{CONTROL}{model.actuator(k).name}": 0.0 for k in range(model.nu)}
    base |= {
        f"water_{f.name}" if f.name == "density" else f.name: getattr(Water(), f.name)
        for f in fields(Water)
    }
    if body:
        number = find_body(model, body)
        base |= dict(zip(("x", "y", "z"), map(float, model.body_pos[number]), strict=True))
        base["mass"] = float(model.body_mass[number])
    return base


def _set_mass(spec: mujoco.MjSpec, name: str, mass: float) -> None:
    """Give a body another mass; its centre stays, its inertia grows with it."""
    check_positive(mass=mass)
    model = spec.compile()
    number, body = find_body(model, name), spec.body(name)
    if body is None:
        raise ValueError(f"mass is varied and {name} has no name in the model: give it one")
    factor = mass / float(model.body_mass[number])
    body.ipos, body.iquat = model.body_ipos[number], model.body_iquat[number]
    body.inertia = factor * model.body_inertia[number]
    body.mass, body.explicitinertial = mass, True


def _place(
    model: mujoco.MjModel, data: mujoco.MjData, body: int, point: Mapping[str, float]
) -> None:
    """Put a free body where a point has it."""
    first = int(model.jnt_qposadr[model.body_jntadr[body]])
    for k, name in enumerate(("x", "y", "z")):
        if name in point:
            data.qpos[first + k] = point[name]
    if point.keys() & {"roll", "pitch", "yaw"}:
        turn = np.eye(3)
        for axis, name in enumerate(("roll", "pitch", "yaw")):
            half = 0.5 * point.get(name, 0.0)
            quaternion = np.array([math.cos(half), 0.0, 0.0, 0.0])
            quaternion[1 + axis] = math.sin(half)
            turn = matrices(quaternion) @ turn
        q = data.qpos[first + 3 : first + 7]
        q[:] = quaternions((turn @ matrices(q))[None])[0]


def _text(value: Any) -> str:
    """A value of the water as the plugin reads it."""
    words = {"on": "true", "off": "false"}
    return words.get(value, value) if isinstance(value, str) else repr(float(value))


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
