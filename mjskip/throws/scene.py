"""Scenes: an MJCF model and the water, lake and throw settings it carries in <custom>.

A setting is a <numeric> or <text> named `mjskip.<setting>`, in SI units and radians, as MuJoCo's own
`filament.*` settings are. A throw setting with a body's name behind it (`mjskip.spin.still`) is for that
body alone. `mjskip.control.<actuator>` and `mjskip.release.<equality>` move a robot: see `mjskip.throws.arm`.
Bodies that carry the engine plugin `mjskip.water` have their water from it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from mjskip._typing import PathLike
from mjskip.checks import check_path, check_type
from mjskip.coupling.bodies import body_name, find_body, free_bodies
from mjskip.coupling.loading import load_model
from mjskip.coupling.plugin_keys import NAME, plugin_settings, plugin_water
from mjskip.coupling.terrain import ModelTerrain
from mjskip.coupling.wet import THROWN_OPTIONS, body_stone
from mjskip.errors import SceneError
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import SWITCHES as WATER_SWITCHES
from mjskip.hydro.water import Water
from mjskip.throws.arm import Arm
from mjskip.throws.throw import PARAMETERS, Throw
from mjskip.waves import HeightField

PREFIX = "mjskip."
WATER = {field.name for field in fields(Water)}
FIELD = {"shape", "spacing", "wave_speed", "damping", "stencil", "boundary", "centre"}
THROW = set(PARAMETERS)
TEXTS = {"gate", "law", "stencil", "boundary"}
SWITCHES = {*WATER_SWITCHES, "obstacles", "afloat"}
SLEEP_AMPLITUDE = 1e-5
"""Waves that are lower are let go [m]."""
PAIRS = {"shape", "centre"}
OBSTACLES = "obstacles"
"""Switch: fixed geoms that pierce the surface are land in the scene's `HeightField`."""
AFLOAT = "afloat"
"""Switch: nothing is thrown; bodies begin where the scene has them, and may stay in the water."""
CONTROL, RELEASE = "control.", "release."


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Scene:
    """A compiled model with its settings.

    Attributes:
        path: the MJCF file.
        model: as compiled; not to be altered.
        body: name of the stone that is asked about.
        water: the fluid about the chosen body.
        grid: arguments of the scene's `HeightField`.
        obstacles: whether fixed geoms that pierce the surface are land in it.
        throws: the throw of every free body, by name.
        own: names of the throw settings that the scene gives to single bodies, by body.
        plugged: the water of every body that has it from the engine plugin, by name; of all or none.
        arm: what the scene's robot does.
        held: bodies that the robot throws, so that their `throws` mean nothing.
        afloat: whether nothing is thrown: bodies begin where the scene has them, and all that moves is wet.
    """

    path: Path
    model: mujoco.MjModel
    body: str
    water: Water
    grid: Mapping[str, Any]
    obstacles: bool
    throws: Mapping[str, Throw]
    own: Mapping[str, frozenset[str]]
    plugged: Mapping[str, Water]
    arm: Arm
    held: frozenset[str]
    afloat: bool = False

    def __repr__(self) -> str:
        return f"Scene({self.path.name}, body={self.body!r}, {len(self.throws)} free bodies)"

    @property
    def throw(self) -> Throw:
        """The throw of the chosen body."""
        return self.throws[self.body]

    @cached_property
    def stones(self) -> Mapping[str, Stone]:
        """Every free body as a stone, by name."""
        found = {}
        for name in self.throws:
            body = find_body(self.model, name)
            settings = plugin_settings(self.model, body)
            options, geoms = (
                (settings.options, settings.geoms) if settings else (THROWN_OPTIONS, None)
            )
            found[name] = body_stone(self.model, body, options=options, geoms=geoms)
        return found

    @property
    def stone(self) -> Stone:
        """The chosen body as a stone."""
        return self.stones[self.body]

    def water_of(self, body: str) -> Water:
        """The fluid about a body: its plugin's, or the scene's.

        Args:
            body: its name.
        """
        return self.plugged.get(
            check_type("body", body, str, "give the name of a body"), self.water
        )

    def field(self) -> HeightField:
        """Fresh water of this scene: endless if its boundary absorbs, else between its walls or periodic.

        Only what moves is stored. An absorbing field needs no shape: it is endless.
        """
        grid = dict(self.grid)
        mask = ModelTerrain(self.model) if self.obstacles else None
        absorbs = grid.get("boundary") == "absorb"
        if absorbs and grid.get("stencil", "nine_point") == "nine_point":
            kept = ("spacing", "wave_speed", "damping", "centre")
            settings = {name: grid[name] for name in kept if name in grid}
            return HeightField.endless(**settings, terrain_mask=mask)
        asleep = 0.0 if absorbs else SLEEP_AMPLITUDE
        return HeightField(**grid, terrain_mask=mask, sleep_amplitude=asleep)

    def rethrow(self, **changes: float) -> Scene:
        """This scene with other throw settings, SI and radians.

        The chosen body takes them all; the others keep what the scene gives to them alone.

        Args:
            changes: fields of `Throw`.

        Raises:
            ValueError: a value is out of range, or the body is thrown by a robot.
        """
        if changes and self.afloat:
            raise ValueError(
                f"{self.body!r} in {self.path} is afloat and not thrown: leave out {', '.join(changes)}, or give the "
                f'scene <numeric name="{PREFIX}{AFLOAT}" data="0"/> in its <custom>'
            )
        if changes and self.body in self.held:
            raise ValueError(
                f"{self.body!r} is thrown by the arm in {self.path}: change its control signals there, not "
                f"{', '.join(changes)}"
            )
        return replace(
            self,
            throws={
                name: replace(
                    throw,
                    **{
                        key: value
                        for key, value in changes.items()
                        if name == self.body or key not in self.own.get(name, ())
                    },
                )
                for name, throw in self.throws.items()
            },
        )


def shipped_scenes() -> dict[str, Path]:
    """The scenes that come with the package, by name."""
    here = Path(__file__).parents[1]
    for folder in (here / "models", here.parent / "models"):  # installed; a checkout
        found = {path.stem: path for path in sorted(folder.glob("*.xml"))}
        if found:
            return found
    return {}


def load_scene(
    path: PathLike = "lake", *, body: str | None = None, sea: str | None = None
) -> Scene:
    """Load a scene from an MJCF file, or by the name of a shipped one.

    Args:
        path: a file, or a name in `shipped_scenes()`.
        body: name of the stone; the first free body if None.
        sea: waves and current instead of the scene's, about bodies that radiate: see `Sea.from_text`.

    Raises:
        SceneError: the file is missing, does not compile, has no free body, lacks `body`, or has a
            setting that is unknown or out of range.
        MeshError: a stone's mesh is not closed.
    """
    file = find_scene(path)
    if body is not None:
        check_type("body", body, str, "give the name of a free body")
    model = load_model(file, sea=sea)
    names = [body_name(model, b) for b in free_bodies(model)]
    if not names:
        raise SceneError(f"{file} has no free body: give the stone a <freejoint/>")
    if body is not None and body not in names:
        raise SceneError(f"{file} has no free body {body!r}: it has {', '.join(names)}")
    settings = _settings(model, file, names)
    plugged = _plugged(model, file, names)
    if plugged and WATER & settings.keys():
        raise SceneError(
            f"{file}: {PREFIX}{min(WATER & settings.keys())} has no effect on bodies that carry plugin "
            f"{NAME}: give it as a <config> of the plugin"
        )
    chosen = body or names[0]
    try:
        arm = Arm(
            controls=_with_prefix(settings, CONTROL), release_times=_with_prefix(settings, RELEASE)
        )
        scene = Scene(
            path=file,
            model=model,
            body=chosen,
            water=plugged.get(chosen) or Water(**{k: v for k, v in settings.items() if k in WATER}),
            grid={k: v for k, v in settings.items() if k in FIELD},
            obstacles=settings.get(OBSTACLES, False),
            throws={name: Throw(**_one(settings, name)) for name in names},
            own={name: frozenset(k for k in THROW if f"{k}.{name}" in settings) for name in names},
            plugged=plugged,
            arm=arm,
            held=arm.held(model) & set(names),
            afloat=_is_afloat(settings, [*plugged.values()]),
        )
        scene.field()  # refuse bad settings of the water surface here, in a few milliseconds
    except ValueError as error:
        raise SceneError(f"{file}: {error}") from error
    _ = scene.stones  # refuse open meshes here rather than in the middle of a run
    return scene


def _plugged(model: mujoco.MjModel, file: Path, names: list[str]) -> dict[str, Water]:
    """The water of the stones that carry the engine plugin."""
    waters = {name: plugin_water(model, find_body(model, name)) for name in names}
    found = {name: water for name, water in waters.items() if water is not None}
    if found and len(found) < len(names):
        bare = next(name for name in names if name not in found)
        raise SceneError(
            f"{file}: body {bare!r} does not carry plugin {NAME} as other stones do: give it to all free "
            "bodies or to none"
        )
    return found


def _is_afloat(settings: Mapping[str, Any], waters: Sequence[Water]) -> bool:
    """As the scene says; without a word, whether its water bears and it says nothing of a throw."""
    if AFLOAT in settings:
        return bool(settings[AFLOAT])
    said = {name.partition(".")[0] for name in settings}
    bears = bool(waters) and all(water.buoyancy for water in waters)
    return (bears or settings.get("buoyancy", False) is True) and not said & {*THROW, RELEASE[:-1]}


def _with_prefix(settings: Mapping[str, Any], prefix: str) -> dict[str, Any]:
    return {k.removeprefix(prefix): v for k, v in settings.items() if k.startswith(prefix)}


def is_afloat(path: PathLike) -> bool:
    """Whether nothing is thrown in a scene, by what its file says; False if it does not compile."""
    try:
        model = load_model(find_scene(path))
    except SceneError:
        return False
    names = [body_name(model, body) for body in free_bodies(model)]
    try:
        waters = _plugged(model, Path(path), names)
        return _is_afloat(_settings(model, Path(path), names), [*waters.values()])
    except SceneError:
        return False


def find_scene(path: PathLike) -> Path:
    """The file of a scene, or of a shipped one by its name.

    Raises:
        SceneError: there is none.
    """
    file = check_path("scene", path)
    if file.is_file():
        return file
    shipped = shipped_scenes()
    if str(path) in shipped:
        return shipped[str(path)]
    if file.is_dir():
        raise SceneError(f"scene {file} is a folder: give an MJCF file")
    raise SceneError(
        f"no scene {str(path)!r}: give an MJCF file, or one of the shipped scenes: {', '.join(shipped)}"
    )


def _settings(model: mujoco.MjModel, file: Path, bodies: list[str]) -> dict[str, Any]:
    """Every `mjskip.*` setting of a model, checked for name, kind and number of values."""
    single = {f"{key}.{name}" for key in THROW for name in bodies}
    moved = {f"{CONTROL}{model.actuator(k).name}" for k in range(model.nu)}
    moved |= {f"{RELEASE}{model.equality(k).name}" for k in range(model.neq)}
    known = WATER | FIELD | THROW | {OBSTACLES, AFLOAT} | single | moved
    found: dict[str, Any] = {}
    entries: list[tuple[str, Any]] = [
        (model.numeric(k).name, model.numeric(k).data.tolist()) for k in range(model.nnumeric)
    ]
    for k in range(model.ntext):
        first, size = model.text_adr[k], model.text_size[k]
        text = bytes(model.text_data[first : first + size]).rstrip(b"\0").decode()
        entries.append((mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_TEXT, k), text))
    for name, value in entries:
        if not name.startswith(PREFIX):
            if name.lower().startswith(PREFIX.rstrip(".")):
                raise SceneError(
                    f"{file}: setting {name!r} would be ignored: begin it with {PREFIX!r}, as in {PREFIX}speed"
                )
            continue
        key = name.removeprefix(PREFIX)
        if key not in known:
            listed = ", ".join(
                PREFIX + k for k in sorted(WATER | FIELD | THROW | {OBSTACLES, AFLOAT})
            )
            raise SceneError(
                f"{file}: unknown setting {name!r}; known are {listed}, and throw settings with "
                f".<body> behind them (bodies: {', '.join(bodies)})"
                + (
                    f"; of this robot {', '.join(sorted(PREFIX + k for k in moved))}"
                    if moved
                    else ""
                )
            )
        found[key] = _value(key, value, file)
    return found


def _one(settings: Mapping[str, Any], body: str) -> dict[str, Any]:
    """The throw settings of one body: its own before the scene's."""
    common = {key: settings[key] for key in THROW if key in settings}
    return common | {key: settings[f"{key}.{body}"] for key in THROW if f"{key}.{body}" in settings}


def _value(key: str, value: Any, file: Path) -> Any:
    if key in TEXTS:
        if not isinstance(value, str):
            raise SceneError(f"{file}: {PREFIX}{key} is a <numeric>: give it as a <text>")
        return value
    if not isinstance(value, list):
        raise SceneError(f"{file}: {PREFIX}{key} is a <text>: give it as a <numeric>")
    if key.startswith(CONTROL):
        return tuple(value)
    want = 2 if key in PAIRS else 1
    if len(value) != want:
        raise SceneError(f"{file}: {PREFIX}{key} has {len(value)} values: give {want}")
    if key == "shape":
        if any(v != np.floor(v) for v in value):
            raise SceneError(f"{file}: {PREFIX}shape is {value}: give two whole numbers of cells")
        return tuple(int(v) for v in value)
    if key in SWITCHES:
        if value[0] not in (0.0, 1.0):
            raise SceneError(f"{file}: {PREFIX}{key} is {value[0]:g}: give 1 (on) or 0 (off)")
        return bool(value[0])
    return tuple(value) if want == 2 else value[0]
