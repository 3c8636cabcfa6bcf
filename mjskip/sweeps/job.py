"""One chunk of a sweep: from parameters to throws to what they did. It runs here or on a worker."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, Protocol

import numpy as np

from mjskip.checks import check_positive
from mjskip.errors import DivergedError, MjskipError, MjskipWarning
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import SWITCHES, Water
from mjskip.sweeps.batch import AIR_TOLERANCE, Air, throw_all
from mjskip.sweeps.design import NAMED, STONE, THROW, WATER, Design
from mjskip.throws.recording import Limits
from mjskip.throws.scene import Scene, load_scene
from mjskip.throws.simulate import simulate
from mjskip.throws.throw import Throw
from mjskip.throws.trajectory import ENDS, Trajectory

RESULTS: dict[str, tuple[str, str]] = {
    "skips": ("1", "touches followed by at least min_airtime in the air"),
    "touches": ("1", "touches of the water"),
    "time": ("s", "when it ended"),
    "distance": ("m", "along the throw, from release to the end"),
    "drift": ("m", "to the left of the throw, from release to the end"),
    "depth": ("m", "deepest immersion of the lowest point"),
    "first_entry": ("s", "time of the first touch"),
    "first_exit": ("s", "time at which it first left the water"),
    "exit_speed": ("m s-1", "speed as it first left the water"),
    "exit_climb": ("m s-1", "vertical velocity as it first left the water"),
}
"""Numbers of a throw: unit and meaning; NaN where there is nothing to say."""

WORDS: dict[str, str] = {
    "end": f"why it ended: {', '.join(ENDS)}",
    "reason": "why there is no result",
    "status": "ok, refused (its parameters make no throw), diverged or failed",
}
"""Words of a throw. A chunk is finished once its status is written: it comes last."""


class Question(Protocol):
    """What a sweep asks, whole: what stores and workers are given.

    Attributes:
        design: what is varied.
        results: numbers that every point of the grid gives: unit and meaning.
        words: words that it gives; "status" is the last, by which a chunk is known to be finished.
        title: of the file.
    """

    @property
    def design(self) -> Design: ...
    @property
    def results(self) -> Mapping[str, tuple[str, str]]: ...
    @property
    def words(self) -> Mapping[str, str]: ...
    @property
    def title(self) -> str: ...

    def run(
        self,
        index: tuple[slice, ...],
        *,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> dict[str, np.ndarray[Any, Any]]:
        """An array of the block's shape for every result of one block of the grid.

        `progress` is called with what is done of it, where one is done after the other.
        """

    def request(self) -> dict[str, Any]:
        """All that the results depend on, as JSON would have it: two equal ones give equal bytes."""


def run_chunk(
    job: Question,
    index: tuple[slice, ...],
    *,
    threads: int | None = None,
    progress: Callable[[int], None] | None = None,
) -> dict[str, np.ndarray[Any, Any]]:
    """One block of the grid, here or on a worker."""
    return job.run(index, threads=threads, progress=progress)


@dataclass(frozen=True, kw_only=True, eq=False)
class Job:
    """A sweep's question, whole: what workers are given.

    Attributes:
        stone: the body before anything is varied.
        scene: what the MuJoCo engine throws; a scene of the stone alone if None.
        throw: what is not varied.
        water: what is not varied.
        design: what is.
        engine: "reference" or "mujoco".
        integrator: of the engine; the scene's if None.
        timestep: [s].
        limits: what counts as a skip and when a throw is over.
        gravity: [m/s^2].
        air: see `mjskip.sweeps.batch.throw_all`.
    """

    stone: Stone
    scene: Scene | None
    throw: Throw
    water: Water
    design: Design
    engine: str
    integrator: str | None
    timestep: float
    limits: Limits
    gravity: tuple[float, float, float]
    air: Air

    @property
    def base(self) -> dict[str, Any]:
        """Every parameter as it is before anything is varied."""
        return {
            **{name: getattr(self.throw, name) for name in THROW},
            "radius": _reach(self.stone),
            "thickness": self.stone.thickness,
            "mass": self.stone.mass,
            "stone_density": self.stone.mass / self.stone.volume,
            "water_density": self.water.density,
            "air_density": self.water.air_density,
            "viscosity": self.water.viscosity,
        }

    results: ClassVar[Mapping[str, tuple[str, str]]] = RESULTS
    words: ClassVar[Mapping[str, str]] = WORDS
    title: ClassVar[str] = "stone skipping sweep, SI units, angles in radians"

    def run(
        self,
        index: tuple[slice, ...],
        *,
        threads: int | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> dict[str, np.ndarray[Any, Any]]:
        """The throws of one block of the grid: an array of the block's shape for every result."""
        shape = tuple(part.stop - part.start for part in index)
        names = list(self.design.sizes)
        base = self.base
        rows = [
            self.design.point(dict(zip(names, place, strict=True)), base)
            for place in product(*(range(part.start, part.stop) for part in index))
        ]
        found: dict[str, Any] = {name: np.full(len(rows), np.nan) for name in RESULTS}
        found |= {name: np.full(len(rows), "", dtype=object) for name in WORDS}
        stones: dict[tuple[Any, ...], Stone] = {}
        todo: list[tuple[int, Stone, Throw, Water]] = []
        for k, row in enumerate(rows):
            try:
                stone = _stone_of(self.stone, row, stones)
                thrown = replace(self.throw, **{n: row[n] for n in THROW if n in row})
                todo.append((k, stone, thrown, _water_of(self.water, row)))
            except (ValueError, MjskipError) as error:
                found["status"][k], found["reason"][k] = "refused", _line(error)
        if todo and self.engine == "reference":
            _by_reference(self, todo, found, threads)
        elif todo:
            _by_mujoco(self, todo, found, progress)
        return {name: values.reshape(shape) for name, values in found.items()}

    def request(self) -> dict[str, Any]:
        """All that the results depend on, as JSON would have it: two equal ones give equal bytes."""
        stone = self.stone
        mark = hashlib.sha256()
        for array in (stone.vertices, stone.faces, stone.inertia):
            mark.update(np.ascontiguousarray(array).tobytes())
        return {
            "version": version("mjskip"),
            "scene": None if self.scene is None else _named(self.scene.path),
            "stone": {
                "mass": stone.mass,
                "triangles": len(stone.faces),
                "radius": stone.radius,
                "thickness": stone.thickness,
                "sha256": mark.hexdigest()[:16],
            },
            "throw": asdict(self.throw),
            "water": asdict(self.water),
            "engine": self.engine,
            "integrator": self.integrator,
            "timestep": self.timestep,
            "gravity": list(self.gravity),
            "limits": asdict(self.limits),
            "air": self.air if self.engine == "reference" else None,
            "air_tolerance": AIR_TOLERANCE if self.engine == "reference" else None,
            "design": self.design.summary(),
        }


def _named(file: Path) -> str:
    """A file by its name and a mark of its contents."""
    return f"{file.name} (sha256 {hashlib.sha256(file.read_bytes()).hexdigest()[:16]})"


def _by_reference(job: Job, todo: list[Any], found: dict[str, Any], threads: int | None) -> None:
    rows, stones, throws, waters = (list(column) for column in zip(*todo, strict=True))
    integrator: Any = job.integrator
    done = throw_all(
        stones, throws, water=waters, integrator=integrator, timestep=job.timestep, limits=job.limits,
        gravity=job.gravity, air=job.air, threads=threads,
    )  # fmt: skip
    lost = done.end == "diverged"
    for name in RESULTS:
        found[name][rows] = np.where(lost, np.nan, getattr(done, name))
    found["end"][rows] = done.end
    found["status"][rows] = np.where(lost, "diverged", "ok")
    for row, time, gone in zip(rows, done.time, lost, strict=True):
        if gone:
            found["reason"][row] = f"not finite at t = {time:.6g} s: use a smaller time step"


def _by_mujoco(
    job: Job, todo: list[Any], found: dict[str, Any], progress: Callable[[int], None] | None
) -> None:
    integrator = job.integrator or (None if job.scene else "RK4")
    for done, (k, stone, throw, water) in enumerate(todo):
        if progress:
            progress(done)
        try:
            if job.scene is None:
                scene = scene_of(stone, gravity=job.gravity)
            elif stone is not job.stone:
                raise MjskipError(
                    "the mujoco engine throws a scene's own stone: give a Stone instead of a scene, or "
                    "engine='reference', to vary " + ", ".join(STONE)
                )
            else:
                scene = job.scene
            throws = {**scene.throws, scene.body: throw}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", MjskipWarning)  # given once for the sweep
                trajectory = simulate(
                    replace(scene, water=water, throws=throws),
                    engine="mujoco",
                    integrator=integrator,
                    timestep=job.timestep,
                    limits=job.limits,
                )
            for name, value in outcome(trajectory).items():
                found[name][k] = value
            found["status"][k] = "ok"
        except DivergedError as error:
            found["status"][k], found["reason"][k] = "diverged", _line(error)
            found["end"][k] = "diverged"
        except (ValueError, MjskipError) as error:
            found["status"][k], found["reason"][k] = "failed", _line(error)


def outcome(trajectory: Trajectory) -> dict[str, Any]:
    """What a sweep keeps of a trajectory."""
    way = trajectory.position[-1] - trajectory.position[0]
    first = trajectory.contacts[0] if trajectory.contacts else None
    left = first.exit if first else None
    return {
        "skips": trajectory.skips,
        "touches": len(trajectory.contacts),
        "time": trajectory.time[-1],
        "distance": way[0],
        "drift": way[1],
        "depth": max((c.depth for c in trajectory.contacts), default=0.0),
        "first_entry": first.entry.time if first else np.nan,
        "first_exit": left.time if left else np.nan,
        "exit_speed": left.speed if left else np.nan,
        "exit_climb": left.velocity[2] if left else np.nan,
        "end": trajectory.end,
    }


def scene_of(stone: Stone, *, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)) -> Scene:
    """A MuJoCo scene with this stone and nothing else."""

    def text(values: Any) -> str:
        return " ".join(repr(float(v)) for v in np.ravel(values))

    i = stone.inertia
    full = text([i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]])
    faces = " ".join(map(str, stone.faces.ravel()))
    with TemporaryDirectory() as folder:
        file = Path(folder) / "stone.xml"
        file.write_text(
            f"""
            <mujoco model="stone">
              <option gravity="{text(gravity)}"/>
              <asset><mesh name="stone" vertex="{text(stone.vertices)}" face="{faces}"/></asset>
              <worldbody><body name="stone"><freejoint/>
                <inertial pos="0 0 0" mass="{stone.mass!r}" fullinertia="{full}"/>
                <geom type="mesh" mesh="stone"/>
              </body></worldbody>
            </mujoco>""",
            encoding="utf-8",
        )
        return load_scene(file)


def scaled(
    stone: Stone,
    *,
    radius: float | None = None,
    thickness: float | None = None,
    mass: float | None = None,
    stone_density: float | None = None,
) -> Stone:
    """The stone with other dimensions and mass: an affine stretch along and across its disc normal.

    The centre of mass stays the centre of mass and the matrix of second moments is stretched with the mesh,
    whatever the distribution of the mass. The mean density stays unless a mass or a density is given.

    Args:
        stone: the body.
        radius: largest distance from the axis through the centre of mass [m].
        thickness: extent along the disc normal [m].
        mass: [kg].
        stone_density: mean density [kg/m^3], instead of the mass.
    """
    given = {
        "radius": radius, "thickness": thickness, "mass": mass, "stone_density": stone_density,
    }  # fmt: skip
    check_positive(**{name: value for name, value in given.items() if value is not None})
    if mass is not None and stone_density is not None:
        raise ValueError("both mass and stone_density are given: give one of them")
    axis = stone.disc_normal
    along = np.outer(axis, axis)
    wide = 1.0 if radius is None else radius / _reach(stone)
    high = 1.0 if thickness is None else thickness / stone.thickness
    stretch = high * along + wide * (np.eye(3) - along)
    new_mass = stone.mass * wide**2 * high
    if stone_density is not None:
        new_mass = stone_density * stone.volume * wide**2 * high
    if mass is not None:
        new_mass = mass
    second = 0.5 * np.trace(stone.inertia) * np.eye(3) - stone.inertia
    second = stretch @ second @ stretch * (new_mass / stone.mass)
    return Stone.of_parts(
        vertices=stone.vertices @ stretch,
        faces=stone.faces,
        mass=new_mass,
        centre=np.zeros(3),
        inertia=np.trace(second) * np.eye(3) - second,
    )


def _stone_of(stone: Stone, row: Mapping[str, Any], made: dict[tuple[Any, ...], Stone]) -> Stone:
    """The stone of one row; each is made once."""
    given = {name: row[name] for name in STONE if name in row}
    key = tuple(given.values())
    if key not in made:
        made[key] = scaled(stone, **given) if given else stone
    return made[key]


def _water_of(water: Water, row: Mapping[str, Any]) -> Water:
    named = {"water_density": "density"}
    given = {
        named.get(name, name): row[name] == "on" if name in SWITCHES else row[name]
        for name in (*WATER, *NAMED)
        if name in row
    }
    return replace(water, **given) if given else water


def _reach(stone: Stone) -> float:
    along = np.outer(stone.vertices @ stone.disc_normal, stone.disc_normal)
    return float(np.linalg.norm(stone.vertices - along, axis=1).max())


def _line(error: Exception) -> str:
    return " ".join(str(error).split())
