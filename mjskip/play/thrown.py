"""From settings to a run: the stone is made, thrown, and the whole flight is known before it is shown."""

from __future__ import annotations

import contextlib
import ctypes
import tempfile
import threading
import warnings
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import mujoco

from mjskip.errors import MjskipWarning, SceneError
from mjskip.hydro.stone import GRANITE, Stone
from mjskip.play.settings import THROW, Settings
from mjskip.throws.report import COLUMNS, skip_rows
from mjskip.throws.scene import Scene, load_scene, shipped_scenes
from mjskip.throws.simulate import simulate_all
from mjskip.throws.trajectory import Trajectory
from mjskip.waves.recording import SurfaceFrames

MAX_STONES = 100
"""Stones of different size that a playground keeps; then it forgets the oldest."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ThrowResult:
    """A run, from the hand to its end.

    Attributes:
        settings: what was asked for.
        scene: that was thrown in.
        flights: by the names of bodies.
        warnings: warnings of the run, a line each.
        command: the `mjskip run` that makes the same throw.
    """

    settings: Settings
    scene: Scene
    flights: Mapping[str, Trajectory]
    warnings: tuple[str, ...]
    command: str

    @property
    def chosen(self) -> Trajectory:
        """The flight that is asked about."""
        return self.flights[self.scene.body]

    @property
    def skips(self) -> int:
        """Of that flight."""
        return self.chosen.skips


def return_memory() -> None:
    """Give back to the system what threads have freed: the GNU allocator keeps it, some hundred megabytes."""
    with contextlib.suppress(OSError, AttributeError):  # another allocator
        ctypes.CDLL(None).malloc_trim(0)


class Thrower:
    """The stones that can be thrown in one scene. Safe to use from several threads."""

    def __init__(self, scene: Scene) -> None:
        """Look at a scene.

        Raises:
            SceneError: nobody can choose its throws: an arm makes them.
        """
        if scene.body in scene.held:
            raise SceneError(
                f"{scene.body!r} is thrown by the arm in {scene.path}: the playground throws by hand; use "
                "mjskip run or mjskip view for this scene"
            )
        self.scene = scene
        self._folder = tempfile.TemporaryDirectory(prefix="mjskip-play-")
        self._made: dict[str, Scene] = {}
        self._lock = threading.Lock()

    def close(self) -> None:
        """Throw the made stones away."""
        self._folder.cleanup()

    def throw(self, settings: Settings, *, record: SurfaceFrames | None = None) -> ThrowResult:
        """Throw, and wait until the run is known: some 50 ms on still water.

        Args:
            settings: what was asked for.
            record: the moments of the water that are to be shown.

        Raises:
            ValueError: the scene cannot do what the settings ask for.
            MjskipError: the run diverged, or the stone cannot be made.
        """
        with self._lock, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", MjskipWarning)
            scene = self._with_stone(settings)
            throw = settings.throw
            scene = scene.rethrow(**{name: getattr(throw, name) for name in THROW})
            if scene.water.law != settings.law:
                scene = replace(scene, water=replace(scene.water, law=settings.law))
            surface: Any = settings.surface
            flights = simulate_all(scene, surface=surface, record=record)
        return_memory()
        return ThrowResult(
            settings=settings,
            scene=scene,
            flights=flights,
            warnings=tuple(str(w.message) for w in caught if issubclass(w.category, MjskipWarning)),
            command=settings.command(
                self._called(scene), body=scene.body if scene.body != next(iter(flights)) else None
            ),
        )

    def model_file(self, settings: Settings) -> tuple[str, bytes] | None:
        """Name and text of the MJCF that has the made stone; None for the scene's own."""
        if settings.stone == "scene":
            return None
        with self._lock:
            path = self._with_stone(settings).path
            return path.name, path.read_bytes()

    def _called(self, scene: Scene) -> str:
        """The scene as a user would name it: a shipped name, the file given, or the file to download."""
        if scene.path.parent == Path(self._folder.name):
            return scene.path.name
        names = [name for name, path in shipped_scenes().items() if path == scene.path]
        return names[0] if names else str(scene.path)

    def _with_stone(self, settings: Settings) -> Scene:
        if settings.stone == "scene":
            return self.scene
        name = (
            f"{self.scene.path.stem}_{settings.stone}_"
            f"{2.0 * settings.radius:g}x{settings.thickness:g}cm.xml"
        )
        if name not in self._made:
            file = Path(self._folder.name) / name
            file.write_text(with_stone(self.scene, turned(settings)))
            while len(self._made) >= MAX_STONES:
                self._made.pop(next(iter(self._made))).path.unlink()
            self._made[name] = load_scene(file, body=self.scene.body)
        return self._made[name]


def turned(settings: Settings) -> Stone:
    """The stone of granite that the settings ask for."""
    radius, thickness = 0.01 * settings.radius, 0.01 * settings.thickness
    if settings.stone == "pebble":
        return Stone.pebble(radius=radius, thickness=thickness)
    if settings.stone == "disc":
        return Stone.disc(radius, thickness)
    if settings.stone == "lens":
        return Stone.lens(radius, thickness)
    raise ValueError(f"stone is {settings.stone!r}: only a pebble, disc or lens is made to size")


def with_stone(scene: Scene, stone: Stone) -> str:
    """The scene as MJCF with another stone of granite in place of the chosen body's geoms."""
    spec = mujoco.MjSpec.from_file(str(scene.path))
    body = spec.body(scene.body)
    material = next((geom.material for geom in body.geoms if geom.material), "")
    for geom in list(body.geoms):
        spec.delete(geom)
    body.explicitinertial = False
    spec.add_mesh(
        name="mjskip stone",
        uservert=stone.vertices.ravel(),
        userface=stone.faces.ravel(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT,
    )
    body.add_geom(
        name="mjskip stone",
        type=mujoco.mjtGeom.mjGEOM_MESH,
        meshname="mjskip stone",
        density=GRANITE,
        material=material,
    )
    try:
        spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise SceneError(f"{scene.path} takes no other stone: {reason}") from error
    return str(spec.to_xml())


def table(flight: Trajectory) -> list[list[str]]:
    """The touches as text, a row each below one of headings."""
    names = ("distance", "in", "out", "attack", "depth", "contact", "airtime")
    return [["", *(f"{n} {COLUMNS[n][0]}" for n in names)], *skip_rows(flight, names)]
