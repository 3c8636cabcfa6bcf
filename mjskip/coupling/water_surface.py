"""Moving water of the plugin from Python: `add_water` puts it into a model, `WaterSurface` reads and disturbs it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import fields
from typing import Any, Protocol

import mujoco
import numpy as np
import numpy.typing as npt

from mjskip._typing import Array
from mjskip.checks import check_names, check_number, check_positive, check_switch, check_type, fault
from mjskip.coupling import _moving_kernels as moving
from mjskip.coupling.moving_water import MovingWater, SurfaceKind
from mjskip.coupling.plugin import plugin_surface, register_plugin
from mjskip.coupling.plugin_keys import NAME, instance_options, plugin_instances
from mjskip.coupling.sea import SeaSurface, plugin_state, smooth_step
from mjskip.errors import SceneError
from mjskip.hydro.seas import Sea
from mjskip.hydro.water import Water
from mjskip.waves import _coupling_kernels as coupling
from mjskip.waves import _window_kernels as window
from mjskip.waves.coupling import LOAD_RADIUS


def add_water(
    spec: mujoco.MjSpec, water: Water | None = None, *, bodies: Iterable[str] | None = None,
    name: str = "water", surface: SurfaceKind = "still", size: float = 0.64, spacing: float = 0.01,
    depth: float = math.inf, wave_speed: float = 1.0, damping: float = 0.0, tension: float = 0.0,
    load_radius: float = LOAD_RADIUS, arrows: float = 0.0, sensor: bool = True, sea: str = "",
) -> None:  # fmt: skip
    """Put water under bodies of a model that is not yet compiled: the plugin mjskip.water, and a sensor.

    Args:
        spec: the model; altered.
        water: the fluid; `Water()` if omitted.
        bodies: names of the bodies; if omitted, those that move and stand directly in the world. What moves
            below a body is wet with it.
        name: of the plugin's instance and of its sensor.
        surface: "still", "waves" (the paper's equation 5) or "deep" (real waves).
        size: width of the square of water that moves and follows the bodies [m].
        spacing: of its cells [m].
        depth: of "deep" [m].
        wave_speed: of "waves" [m/s].
        damping: mu of equation (5) [1/s].
        tension: surface tension of "deep" [N/m].
        load_radius: of the bumps that spread loads [m].
        arrows: length of force arrows in viewers [m/N]; 0 for none.
        sensor: whether to add a sensor of force, torque and wetted area of every body in turn.
        sea: waves and current about bodies that radiate (`Water.radiation`), as "hs=0.3 tp=3".

    Raises:
        ValueError: a value is not allowed.
        SceneError: a body is not there, or nothing moves.
    """
    check_type("spec", spec, mujoco.MjSpec, "give a mujoco.MjSpec")
    water = Water() if water is None else check_type("water", water, Water)
    options = MovingWater(
        surface=surface, size=size, spacing=spacing, depth=depth, wave_speed=wave_speed,
        damping=damping, tension=tension, load_radius=load_radius, arrows=arrows,
    )  # fmt: skip
    check_type("name", name, str, "give a name for the plugin's instance")
    check_switch("sensor", sensor)
    Sea.from_text(sea)
    chosen = _chosen(spec, bodies)
    register_plugin()
    spec.activate_plugin(NAME)
    instance = spec.add_plugin(name=name, plugin_name=NAME, active=True)
    said = {"sea": sea} if sea else {}
    instance.config = _texts(water, Water()) | _texts(options, MovingWater()) | said
    for body in chosen:
        body.plugin.active, body.plugin.plugin_name, body.plugin.name = True, NAME, name
    if sensor:
        added = spec.add_sensor(name=name, type=mujoco.mjtSensor.mjSENS_PLUGIN)
        added.plugin.active, added.plugin.plugin_name, added.plugin.name = True, NAME, name


def _chosen(spec: mujoco.MjSpec, bodies: Iterable[str] | None) -> list[Any]:
    """The bodies of these names, or those that move and stand in the world."""
    there = {body.name: body for body in spec.bodies if body.name != "world"}
    if bodies is None:
        found = [body for body in spec.worldbody.bodies if body.joints or _moves_below(body)]
        if not found:
            raise SceneError("nothing in the model moves: give a body a joint, or name bodies")
        return found
    names = check_names("bodies", bodies)
    for one in names:
        if one not in there:
            raise SceneError(f"no body {one!r}: there are {', '.join(there) or 'none with a name'}")
    return [there[one] for one in names]


def _moves_below(body: Any) -> bool:
    return any(child.joints or _moves_below(child) for child in body.bodies)


def _texts(given: Any, default: Any) -> dict[str, str]:
    """Keys of the plugin for what differs from the default."""
    found = {}
    for field in fields(given):
        value = getattr(given, field.name)
        if value != getattr(default, field.name):
            found[field.name] = str(value).lower() if isinstance(value, bool) else f"{value}"
    return found


class WaterSurface:
    """Moving water of one instance of the plugin in one MjData, to read and to disturb.

    Attributes:
        spacing: of its cells [m].
        level: elevation (n, n) [m], x first: a view of `data.plugin_state`.
        rate: vertical speed (n, n) [m/s], likewise.
    """

    def __init__(
        self, model: mujoco.MjModel, data: mujoco.MjData, *, instance: str = "water"
    ) -> None:
        """Find it.

        Args:
            model: compiled model.
            data: its data, which keeps the surface.
            instance: name of the plugin's instance.

        Raises:
            SceneError: there is no such instance, or its water is still.
        """
        check_type("model", model, mujoco.MjModel, "give a mujoco.MjModel")
        check_type("data", data, mujoco.MjData, "give its mujoco.MjData")
        kind = mujoco.mjtObj.mjOBJ_PLUGIN
        names = [mujoco.mj_id2name(model, kind, i) or "" for i in range(model.nplugin)]
        if instance not in names:
            raise SceneError(
                f"no plugin instance {instance!r}: there are {', '.join(names) or 'none'}"
            )
        index = names.index(instance)
        options, water, gravity = instance_options(model, index)
        if not options.moves:
            raise SceneError(
                f"the water of instance {instance!r} is still: set its key surface to waves or deep"
            )
        record = options.record(density=water.density, gravity=gravity)
        self._water = record[moving.SURFACE :][: int(record[moving.WATER_SIZE])]
        self.spacing, self._cells = options.spacing, options.cells
        self._model, self._radius = model, options.load_radius
        start = int(model.plugin_stateadr[index])
        self._state: Array = data.plugin_state[start : start + options.state_size]
        planes = self._state[window.STATE :][: 3 * self._cells**2]
        self.level, self._potential, self.rate = planes.reshape(3, self._cells, self._cells)

    @property
    def origin(self) -> tuple[float, float]:
        """Place of the first cell, which moves with the bodies [m]."""
        return float(self._state[0] * self.spacing), float(self._state[1] * self.spacing)

    @property
    def left_behind(self) -> tuple[float, float]:
        """Volume [m^3] and energy [J] that the square left behind as it followed its bodies."""
        return float(self._state[window.LEFT_VOLUME]), float(self._state[window.LEFT_ENERGY])

    def elevation(self, x: npt.ArrayLike, y: npt.ArrayLike) -> Array:
        """Elevation at places [m], in the shape of these, bilinear; 0 outside of the square.

        Args:
            x, y: scalars, or arrays of one shape [m].

        Raises:
            ValueError: a place is not a finite number.
        """
        try:
            xs, ys = np.broadcast_arrays(np.asarray(x, np.float64), np.asarray(y, np.float64))
        except (TypeError, ValueError):
            raise fault("x, y", (x, y), "give numbers, or arrays of one shape") from None
        if not (np.isfinite(xs).all() and np.isfinite(ys).all()):
            raise fault("x, y", (x, y), "give finite numbers")
        frame = np.array([*self.origin, self.spacing, 0.0, 0.0])
        level = np.ascontiguousarray(self.level)
        found = [
            coupling.elevation(frame, level, a, b) for a, b in zip(xs.flat, ys.flat, strict=True)
        ]
        return np.array(found).reshape(xs.shape)

    def press(self, x: float, y: float, *, impulse: float, radius: float | None = None) -> None:
        """Give the water at a place a downward impulse at once, as a load that is over.

        Args:
            x, y: its middle [m].
            impulse: [N s]; negative pulls.
            radius: of its bump [m]; the instance's load_radius if omitted, a cell at least.

        Raises:
            ValueError: a value is not finite, or the radius is smaller than a cell or larger than the square.
        """
        radius = self._radius if radius is None else radius
        for name, value in (("x", x), ("y", y), ("impulse", impulse)):
            check_number(name, value)
        check_positive(radius=radius)
        width = self._cells * self.spacing
        if not self.spacing <= radius <= width:
            raise fault(
                "radius", radius, f"give {self.spacing:g} m (a cell) to {width:g} m (the square)"
            )
        side = math.floor(2.0 * radius / self.spacing) + 1
        face, spot = np.zeros((1, coupling.FACE)), np.zeros((1, coupling.SPOT + side * side))
        face[0, coupling.POINT_X], face[0, coupling.POINT_Y] = x, y
        frame = np.array([*self.origin, self.spacing, 0.0, 0.0])
        everywhere = np.ones((self._cells, self._cells), np.uint8)
        coupling.spread_bumps(face, 1, frame, radius, everywhere, side, spot)
        push = np.zeros((self._cells, self._cells))
        coupling.add_spot(spot[0], side, -impulse / (self.spacing**2 * self._water[window.DENSITY]), push)  # fmt: skip
        self._potential += push
        window.apply_operator(self._water, self._potential.copy(), self.rate)
        self._state[window.STATE + 3 * self._cells**2 + moving.DISTURBED] = 1.0

    @property
    def centre(self) -> tuple[float, float]:
        """Middle of the square, which moves with the bodies [m]."""
        x, y = self.origin
        half = 0.5 * (self._cells - 1) * self.spacing
        return x + half, y + half


class PluginSea:
    """The sea of an instance of the plugin about bodies that radiate, in any data of its model.

    Attributes:
        surface: as it was prepared.
    """

    def __init__(self, model: mujoco.MjModel, instance: int) -> None:
        """Of an instance that has the key radiation."""
        self.surface: SeaSurface = plugin_surface(model, instance)
        self._model, self._instance = model, instance

    def elevation(self, data: mujoco.MjData, points: npt.ArrayLike) -> Array:
        """Height of the surface at points (n, 2) [m]: the sea, and the waves that bodies make."""
        return self.surface.elevation(plugin_state(self._model, data, self._instance), points)

    def grid_elevation(self, data: mujoco.MjData, x: Array, y: Array) -> Array:
        """The same at the points of a grid with axes x (nx,) and y (ny,) [m], quickly: (nx, ny) [m]."""
        state = plugin_state(self._model, data, self._instance)
        return self.surface.grid_elevation(state, x, y)


SQUARE, SQUARE_SPACING = 320, 0.1
"""Cells a side, and their size [m], of the square of a sea that pictures show."""

FADE = 0.35
"""Share of its half side, at its edge, over which that square fades into still water."""


class GridElevation(Protocol):
    """A sea that gives its height on a grid: a `Coupling` or a `PluginSea`."""

    def grid_elevation(self, data: mujoco.MjData, x: Array, y: Array) -> Array:
        """Height at the points of a grid with axes x (nx,) and y (ny,) [m]: (nx, ny) [m]."""


def sea_square(sea: GridElevation, data: mujoco.MjData, x: Array, y: Array) -> Array:
    """Height of a sea on a grid with equal steps, axes x (nx,) and y (ny,) [m], still at its edges: (nx, ny) [m]."""
    fade_x, fade_y = (
        smooth_step(np.clip((1.0 - np.abs(np.linspace(-1.0, 1.0, len(axis)))) / FADE, 0.0, 1.0))
        for axis in (x, y)
    )
    return np.asarray(fade_x[:, None] * fade_y * sea.grid_elevation(data, x, y))


def model_surface(model: mujoco.MjModel, data: mujoco.MjData) -> WaterSurface | PluginSea | None:
    """The moving water that a model brings by the plugin, of the first instance that has any; None if it is still."""
    for index in plugin_instances(model):
        options, water, _ = instance_options(model, index)
        if water.radiation:
            return PluginSea(model, index)
        if options.moves:
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_PLUGIN, index)
            return WaterSurface(model, data, instance=name or "")
    return None
