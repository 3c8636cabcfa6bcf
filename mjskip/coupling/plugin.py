"""MuJoCo engine plugin `mjskip.water`: water and air configured in MJCF.

    <extension>
      <plugin plugin="mjskip.water">
        <instance name="lake"> <config key="density" value="1000"/> </instance>
      </plugin>
    </extension>
    ...
    <body name="stone"> <plugin instance="lake"/> ... </body>
    ...
    <sensor> <plugin name="water" instance="lake"/> </sensor>

An instance wets every body that carries it and all that moves below, with what is welded to them. Keys are the
fields of `Water`, and

    preset      floating: `Water.floating()` for keys that are not given
    geoms       all | collision | group 3 | names; the colliding ones of every body, or all, if not given
    bodies      tree (default) | this: not what moves below
    resolution, max_faces, interior, strict    see `mjskip.attach`
    sea         waves and current about bodies that radiate, as "hs=0.3 tp=3": see `Sea.from_text`
    surface     still (default) | waves (equation 5) | deep (real waves); the keys below are of those that move
    size        width of the square of water that follows the instance's bodies and that waves leave [m]
    spacing     of its cells [m]
    depth, tension      of `deep` [m, N/m]
    wave_speed          of `waves` [m/s]
    damping     mu of equation (5) [1/s]
    load_radius of the bumps that spread the load of a face [m]
    arrows      length of force arrows that every viewer shows [m/N]; none if not given

With the key radiation="true" the bodies that carry the instance radiate and scatter waves on one surface, which is the
plugin's state in MjData.

Water that moves is state of MjData (`plugin_state`): `mj_step` alone moves it. It is not for laws that pull along a
face; its faces are loaded while they advance against the surface, whatever the gate; buoyancy and skin friction are
those of still water.

A sensor with objtype="site" and objname shows level [m] and vertical speed [m/s] of moving water at a site, then
zeros. Another shows force (3) [N] and torque (3) [N m] of water and air, world frame, about the centre of mass, and wetted
area [m^2], of every wet body of the instance in turn.
"""

from __future__ import annotations

import ctypes
import sys
import threading
import warnings
import weakref
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import address_of_cfunc
from mjskip._typing import Array
from mjskip.coupling import _plugin_kernels as kernels
from mjskip.coupling import _record_kernels as loads
from mjskip.coupling import _struct_layout as _layout
from mjskip.coupling._struct_layout import library
from mjskip.coupling.bodies import SOLIDS, body_geoms, body_name, geom_name, kind_name, pose_in
from mjskip.coupling.moving_water import MovingWater, moving_functions
from mjskip.coupling.records import make_record, physical_warnings, too_large_step
from mjskip.coupling.sea import (
    FloatingHull,
    SeaSurface,
    ask_plugin,
    compiled,
    finer,
    most_state,
    surface_of,
)
from mjskip.coupling.selection import GeomRule, WetBody, geom_rule, members_of, wet_body
from mjskip.coupling.wet import BuiltHull, HullOptions, Inertia, hull_of, inertia_of
from mjskip.errors import MjskipError, MjskipWarning, SceneError
from mjskip.hydro.seas import Sea
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import immersion_address, pack, wrench_address
from mjskip.waves.coupling import check_law

NAME = "mjskip.water"
WATER_KEYS = tuple(field.name for field in fields(Water))
HULL_KEYS = tuple(field.name for field in fields(HullOptions))
SURFACE_KEYS = tuple(field.name for field in fields(MovingWater))
KEYS = (*WATER_KEYS, "preset", *HULL_KEYS, *SURFACE_KEYS, "geoms", "sea", "bodies")
"""In the order of MuJoCo's texts; compiled code looks at the last one."""
SWITCHES = {f.name for f in (*fields(Water), *fields(HullOptions)) if f.type in (bool, "bool")}
NUMBERS = {f.name for f in (*fields(Water), *fields(MovingWater)) if f.type in (float, "float")}
COUNTS = {f.name for f in fields(HullOptions) if f.type in (int, "int")}
PRESETS = ("floating",)

_lock = threading.RLock()


def register_plugin() -> None:
    """Tell MuJoCo of the plugin `mjskip.water`, for the life of the process; again does nothing.

    Needed before a model that uses it is compiled; `load_scene` does it for scenes. The first call on a
    machine compiles for some ten seconds.

    Raises:
        MjskipError: this version of MuJoCo keeps its data elsewhere than it says; `attach` still works.
    """
    with _lock:
        if _slot() < 0:
            _layout.check(kernels.DATA_MEMBERS)
            _fill_root()
            plugin = _describe()
            kernels.root[kernels.SLOT] = library.mjp_registerPlugin(ctypes.byref(plugin))


@dataclass(frozen=True, kw_only=True)
class PluginSettings:
    """What the keys of an instance say.

    Attributes:
        water: the fluid.
        options: how hulls are made.
        surface: whether and how it moves.
        geoms: the rule for geoms as `attach` takes it.
        below: whether what moves below the bodies that carry it is wet too.
        sea: waves that come, for bodies that radiate.
        sea_text: what the key said.
    """

    water: Water
    options: HullOptions
    surface: MovingWater
    geoms: str | list[str] | None
    below: bool
    sea: Sea
    sea_text: str


def plugin_settings(model: mujoco.MjModel, body: int) -> PluginSettings | None:
    """What the plugin's keys say about a body of a compiled model; None if it does not wet it."""
    slot, carrier = _slot(), int(body)
    if slot < 0:
        return None
    while carrier > 0:
        instance = int(model.body_plugin[carrier])
        if instance >= 0 and model.plugin[instance] == slot:
            settings = _configured(_layout.ModelView(model._address), instance)
            same = model.body_weldid[carrier] == model.body_weldid[body]
            return settings if settings.below or same else None
        carrier = int(model.body_parentid[carrier])
    return None


def plugin_water(model: mujoco.MjModel, body: int) -> Water | None:
    """The water that the plugin puts on a body of a compiled model; None if it puts none there."""
    settings = plugin_settings(model, body)
    return None if settings is None else settings.water


def plugin_instances(model: mujoco.MjModel) -> list[int]:
    """Numbers of this plugin's instances in a compiled model."""
    slot = _slot()
    return [n for n in range(model.nplugin) if slot >= 0 and model.plugin[n] == slot]


def instance_options(model: mujoco.MjModel, instance: int) -> tuple[MovingWater, Water, float]:
    """The surface and the fluid of an instance of a compiled model, and its gravity downwards [m/s^2]."""
    settings = _configured(_layout.ModelView(model._address), instance)
    return settings.surface, settings.water, float(-model.opt.gravity[2])


def plugin_bodies(
    model: mujoco.MjModel,
) -> list[tuple[WetBody, Inertia, BuiltHull, Water]]:
    """The bodies that the plugin wets in a compiled model, what they are to it, and their fluid."""
    view, slot, found = _layout.ModelView(model._address), _slot(), []
    for instance in range(model.nplugin):
        if slot < 0 or model.plugin[instance] != slot:
            continue
        settings = _configured(view, instance)
        for body in _heads(view, instance, settings):
            wet = _wet(view, body, settings)
            if wet.geoms:
                inertia = inertia_of(view, body, wet.members)
                found.append(
                    (wet, inertia, hull_of(view, wet, settings.options, inertia), settings.water)
                )
    return found


def _slot() -> int:
    """Where MuJoCo has the plugin, -1 if it does not know it."""
    slot = ctypes.c_int(-1)
    library.mjp_getPlugin.restype = ctypes.c_void_p
    found = library.mjp_getPlugin(NAME.encode(), ctypes.byref(slot))
    return slot.value if found else -1


class _Plugin(ctypes.Structure):
    """mjpPlugin of mjplugin.h."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("nattribute", ctypes.c_int),
        ("attributes", ctypes.POINTER(ctypes.c_char_p)),
        ("capabilityflags", ctypes.c_int),
        ("needstage", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("nstate", "nsensordata", "init", "destroy", "copy")),
        *((name, ctypes.c_void_p) for name in ("reset", "compute", "advance", "visualize")),
        *((name, ctypes.c_void_p) for name in ("actuator_act_dot", "sdf_distance", "sdf_gradient")),
        *((name, ctypes.c_void_p) for name in ("sdf_staticdistance", "sdf_attribute", "sdf_aabb")),
    )


def _describe() -> _Plugin:
    """The plugin as MuJoCo wants it, its functions compiled.

    Raises:
        MjskipError: this version of MuJoCo has another mjpPlugin.
    """
    size = ctypes.sizeof(_Plugin)
    untouched = b"\xaa" * 64
    memory = ctypes.create_string_buffer(b"\xaa" * size + untouched, size + len(untouched))
    library.mjp_defaultPlugin(memory)
    if memory.raw != bytes(size) + untouched:
        raise MjskipError(
            f"MuJoCo {mujoco.mj_versionString()} has another mjpPlugin than the one known here, so plugin "
            f"{NAME} cannot run with it: use mjskip.attach(), which does not depend on it"
        )
    i4, i8, nothing = types.int32, types.int64, types.void
    functions = {
        "nstate": native(i4(i8, i4))(kernels.nstate),
        "nsensordata": native(i4(i8, i4, i4))(kernels.nsensordata),
        "init": native(i4(i8, i8, i4))(kernels.init),
        "reset": native(nothing(i8, i8, i8, i4))(kernels.reset),
        "compute": native(nothing(i8, i8, i4, i4))(kernels.compute),
        "advance": native(nothing(i8, i8, i4))(kernels.advance),
        "visualize": native(nothing(i8, i8, i8, i8, i4))(kernels.visualize),
    }
    plugin = _Plugin(
        name=NAME.encode(),
        nattribute=len(KEYS),
        attributes=(ctypes.c_char_p * len(KEYS))(*(key.encode() for key in KEYS)),
        capabilityflags=kernels.PASSIVE | kernels.SENSOR,
        needstage=int(mujoco.mjtStage.mjSTAGE_VEL),
        **{name: address_of_cfunc(function) for name, function in functions.items()},
    )
    _keep_alive((plugin, functions))
    return plugin


def _fill_root() -> None:
    """Tell the compiled code where everything is."""
    builder = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(_answer)
    _keep_alive((builder, kernels.root, _answer))
    root = kernels.root
    root[kernels.WRENCH] = wrench_address()
    root[kernels.IMMERSION] = immersion_address()
    root[kernels.BUILDER] = ctypes.cast(builder, ctypes.c_void_p).value or 0
    root[kernels.TABLE] = _records.table.ctypes.data
    root[kernels.GRAVITY] = _layout.option_offset("gravity")
    root[kernels.TIMESTEP] = _layout.option_offset("timestep")
    root[kernels.RADIATION_KEY] = KEYS.index("radiation")
    root[kernels.INTEGRATOR] = _layout.option_offset("integrator")
    scene = _layout.members("mjvScene")
    root[kernels.SCENE_MAXGEOM] = scene["maxgeom"].offset
    root[kernels.SCENE_NGEOM] = scene["ngeom"].offset
    root[kernels.SCENE_GEOMS] = scene["geoms"].offset
    root[kernels.GEOM_BYTES] = _layout.size_of("mjvGeom")
    model, data = _layout.members("mjModel"), _layout.members("mjData")
    root[kernels.MEMBERS :] = [
        *(model[name].offset for name in kernels.MODEL_MEMBERS),
        *(data[name].offset for name in kernels.DATA_MEMBERS),
    ]


def _keep_alive(objects: Any) -> None:
    """MuJoCo keeps their addresses until the process ends, even if this module is loaded anew."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(objects))


@dataclass(frozen=True, kw_only=True)
class _Kept:
    """A record with what it points to, and the hull it was made of as long as the registry has it."""

    record: Array
    blocks: tuple[Array, ...] = ()
    built: weakref.ref[BuiltHull] | None = None

    @property
    def nbytes(self) -> int:
        return self.record.nbytes + sum(block.nbytes for block in self.blocks)


def _bytes_of(found: _Kept | int) -> int:
    """Memory that a row of the table and its record take, about."""
    return 100 if isinstance(found, int) else 100 + found.nbytes


class _Records:
    """Records by the hash of what they were made from, as long as somebody looks them up.

    Compiled code reads the table at any time, from any thread, and stamps what it looks up with the number of the
    round. A round ends when the records fill the memory set aside, and twice what was in use as the round began:
    what nobody looked up in it is dropped. A thread may still be reading what was dropped, or a table
    that was replaced: both stay until the next round ends.
    """

    KEPT_BYTES = 2**25

    def __init__(self) -> None:
        self.made: dict[int, _Kept | int] = {}
        self._bytes = 0
        self._most = self.KEPT_BYTES
        self._round = 0
        self._retired: list[Any] = []
        self._dropped: list[Any] = []
        self._set_slots({})

    def add(self, key: int, found: _Kept | int) -> int:
        """Remember a record, or kernels.CANNOT or DRY; what the table has for it."""
        if self._bytes > self._most:
            self._end_round()
        elif 2 * len(self.made) >= self.table[kernels.SLOTS]:
            self._retired.append(self.table)
            self._set_slots(self._stamps())
        if key in self.made:
            self._retired.append(self.made[key])
        self.made[key] = found
        self._bytes += _bytes_of(found)
        return self._put(key, found, self._round)

    def _end_round(self) -> None:
        stamps, made = self._stamps(), self.made
        self._dropped = [*self._retired, self.table, made]
        self._retired = []
        self.made = {key: found for key, found in made.items() if stamps[key] == self._round}
        self._bytes = sum(map(_bytes_of, self.made.values()))
        self._most = max(self.KEPT_BYTES, 2 * self._bytes)
        self._round += 1
        self._set_slots(stamps)

    def _stamps(self) -> dict[int, int]:
        """The round in which each record was last looked up, by its hash."""
        rows = self.table[kernels.ROWS :].reshape(-1, kernels.ROW)
        rows = rows[rows[:, 0] != 0]
        return dict(zip(rows[:, 0].tolist(), rows[:, 2].tolist(), strict=True))

    def _set_slots(self, stamps: Mapping[int, int]) -> None:
        """A new table of all records, at most a quarter full."""
        slots = 1024
        while slots <= 4 * len(self.made):
            slots *= 2
        self.table = np.zeros(kernels.ROWS + kernels.ROW * slots, dtype=np.int64)
        self.table[kernels.SLOTS], self.table[kernels.ROUND] = slots, self._round
        for key, found in self.made.items():
            self._put(key, found, stamps[key])
        kernels.root[kernels.TABLE] = self.table.ctypes.data

    def _put(self, key: int, found: _Kept | int, stamp: int) -> int:
        mask = int(self.table[kernels.SLOTS]) - 1
        k = key & mask
        while self.table[kernels.ROWS + kernels.ROW * k] not in (0, key):
            k = (k + 1) & mask
        row = kernels.ROWS + kernels.ROW * k
        value = found if isinstance(found, int) else found.record.ctypes.data
        self.table[row + 1], self.table[row + 2] = value, stamp
        self.table[row] = key
        return value


_records = _Records()
_messages: deque[Any] = deque(maxlen=100)
"""Texts of errors, which compiled code in another thread is about to hand to MuJoCo."""
_told: deque[str] = deque(maxlen=1000)
"""Doubts that were said: once in a process."""


def _answer(model: int, address: int, _unused: int) -> None:
    """Answer a request of compiled code; see `_plugin_kernels`."""
    request = (ctypes.c_int64 * kernels.REQUEST).from_address(address)
    what, body, instance, key = request[0], request[1], request[2], request[3]
    try:
        view = _layout.ModelView(model)
        if what == kernels.TOO_LARGE_STEP:
            _warn_of_step(view, body, key)
            return
        settings = _configured(view, instance)
        if settings.water.radiation:
            _link_sea()
        if what == kernels.CONFIGURATION:
            _warn_of_mjx()
            _check_sensors(view, instance, settings)
        elif what == kernels.WARNINGS:
            _warn_of_instance(view, instance, settings)
        elif what == kernels.STATE_SIZE:
            radiates = settings.water.radiation
            request[kernels.ANSWER] = (
                _sea_size(view, instance) if radiates else settings.surface.state_size
            )
        elif what == kernels.SURFACE:
            with _lock:
                request[kernels.ANSWER] = _find_surface(view, settings, key)
        else:
            with _lock:
                request[kernels.ANSWER] = _find_record(view, body, settings, key, what)
    except Exception as error:  # nothing may pass through the C code that called
        text = " ".join(str(error).split()) or type(error).__name__
        message = ctypes.create_string_buffer(text.replace("%", "%%").encode())
        _messages.append(message)
        request[kernels.MESSAGE] = ctypes.addressof(message)
        with _lock:
            if (
                what in (kernels.HULL, kernels.FRESH_HULL, kernels.SURFACE)
                and key not in _records.made
            ):
                _records.add(key, kernels.CANNOT)


def _find_record(view: Any, body: int, settings: PluginSettings, key: int, what: int) -> int:
    """What the table has for a body, made now if need be."""
    known = _records.made.get(key)
    if known is not None and what == kernels.HULL and known != kernels.CANNOT:
        return known if isinstance(known, int) else int(known.record.ctypes.data)
    wet = _wet(view, body, settings)
    if not wet.geoms:
        return _records.add(key, kernels.DRY)
    inertia = inertia_of(view, body, wet.members)
    built = hull_of(view, wet, settings.options, inertia)
    if isinstance(known, _Kept) and known.built is not None and known.built() is built:
        return int(known.record.ctypes.data)
    if built.hull is None:
        return _records.add(key, kernels.DRY)
    block = pack(built.hull, settings.water, gravity=float(-view.gravity[2]))
    record = make_record(built.hull, settings.water, inertia, block)
    blocks: tuple[Array, ...] = (block,)
    if settings.surface.moves:
        split, block[:] = settings.surface.split(block)
        record = np.append(record, np.array([split.ctypes.data], np.int64).view(np.float64))
        blocks += (split,)
    return _records.add(key, _Kept(record=record, blocks=blocks, built=weakref.ref(built)))


def _find_surface(view: Any, settings: PluginSettings, key: int) -> int:
    """What the table has for an instance's surface, made now if need be."""
    known = _records.made.get(key)
    if known is None:
        if not (settings.surface.moves or settings.surface.arrows):
            return _records.add(key, kernels.DRY)
        where = (kernels.MOVING_COMPUTE, kernels.MOVING_ADVANCE, kernels.MOVING_DRAW)
        kernels.root[list(where)] = moving_functions()
        gravity = float(-view.gravity[2])
        record = settings.surface.record(density=settings.water.density, gravity=gravity)
        return _records.add(key, _Kept(record=record))
    return known if isinstance(known, int) else int(known.record.ctypes.data)


def _sea_of(view: Any, instance: int) -> tuple[int, SeaSurface]:
    """The surface of an instance whose bodies radiate, and its hash."""
    settings = _configured(view, instance)
    options = finer(settings.options)
    found = []
    for body in range(1, int(view.nbody)):
        if int(view.body_plugin[body]) != instance:
            continue
        wet = _wet(view, body, settings)
        inertia = inertia_of(view, body, wet.members)
        built = hull_of(view, wet, options, inertia)
        if built.hull is None:
            raise SceneError(
                f"plugin {NAME}: body {body_name(view, body)!r} has no geom for water to act on"
            )
        position, rotation = pose_in(view, body, 0)
        found.append(
            FloatingHull(
                body=body,
                name=body_name(view, body),
                hull=built.hull,
                inertia=inertia,
                carried=_carried_mass(view, body),
                rotation=rotation,
                place=position + rotation @ inertia.centre,
            )
        )
    if not found:
        raise SceneError(f"plugin {NAME}: no body carries this instance, so nothing radiates")
    timestep = float(
        _layout._array(view._address + _layout.option_offset("timestep"), "mjtNum", (1,))[0]
    )
    return surface_of(found, settings.water, settings.sea, settings.sea_text, timestep=timestep)


ask_plugin[:] = [_sea_of]


def _link_sea() -> None:
    """Let the plugin call what acts on bodies that radiate; compiles it on first use."""
    root, addresses = kernels.root, compiled()
    root[kernels.SEA_ACT], root[kernels.SEA_ADVANCE] = addresses["act"], addresses["advance"]
    root[kernels.SEA_SENSE] = addresses["sense"]


def _sea_size(view: Any, instance: int) -> int:
    """Numbers of an instance's state. MuJoCo asks before it has copied its meshes: then there is room for most."""
    bodies = [b for b in range(1, int(view.nbody)) if int(view.body_plugin[b]) == instance]
    if any(
        int(view.geom_dataid[geom]) >= 0
        for body in bodies
        for member in members_of(view, body)
        for geom in body_geoms(view, member)
    ):
        return most_state(len(bodies))
    return _sea_of(view, instance)[1].state_size


def plugin_surface(model: mujoco.MjModel, instance: int | None = None) -> SeaSurface:
    """The surface on which bodies of a compiled model radiate; the first instance's by default.

    Raises:
        SceneError: no instance of the plugin has the key radiation="true".
    """
    slot = _slot()
    view = _layout.ModelView(model._address)
    for number in range(model.nplugin) if instance is None else (instance,):
        if int(model.plugin[number]) == slot and _configured(view, number).water.radiation:
            return _sea_of(view, number)[1]
    raise SceneError(f'no instance of plugin {NAME} in this model has radiation="true"')


def _carried_mass(view: Any, body: int) -> float:
    """Mass of a body and of all below it [kg]: MuJoCo's own sum comes after the plugin is asked for its size."""
    inside = {body}
    for other in range(body + 1, int(view.nbody)):
        if int(view.body_parentid[other]) in inside:
            inside.add(other)
    return float(sum(view.body_mass[b] for b in inside))


def _wet(view: Any, body: int, settings: PluginSettings) -> WetBody:
    stop = [b for b in range(1, int(view.nbody)) if b != body and _has_plugin(view, b)]
    rule = _chosen(view, settings.geoms, body)
    return wet_body(view, body, rule, stop=stop)


def _has_plugin(view: Any, body: int) -> bool:
    instance = int(view.body_plugin[body])
    return instance >= 0 and int(view.plugin[instance]) == int(kernels.root[kernels.SLOT])


def _geom_rule(text: str) -> str | list[str] | None:
    """The key `geoms` as a rule: keywords, or names with spaces between them."""
    if not text or text in ("all", "collision") or text.split()[0] == "group":
        return text or None
    return text.split()


def _chosen(view: Any, rule: GeomRule, body: int) -> Any:
    """The rule for the geoms of a body; names count on every body of the model."""
    if not isinstance(rule, list):
        return geom_rule(view, rule, [body])
    there = {str(view.geom(g).name): g for g in range(int(view.ngeom))}
    for name in rule:
        if name not in there:
            has = ", ".join(n for n in there if n) or "none has a name"
            raise SceneError(f"geoms is {' '.join(rule)!r}: no geom {name!r}; there are {has}")
        if int(view.geom_type[there[name]]) not in SOLIDS:
            kind = kind_name(view, there[name])
            raise SceneError(f"geoms: {name!r} is a {kind}, which displaces no water")
    wanted = {there[name] for name in rule}
    return lambda geom: geom in wanted


def _heads(view: Any, instance: int, settings: PluginSettings) -> Iterator[int]:
    """The bodies that an instance wets, as compiled code finds them."""
    for body in range(1, int(view.nbody)):
        if int(view.body_plugin[body]) == instance:
            yield body
        elif settings.below and int(view.body_jntnum[body]) > 0:
            carrier = body
            while carrier > 0 and not _has_plugin(view, carrier):
                carrier = int(view.body_parentid[carrier])
            if carrier > 0 and int(view.body_plugin[carrier]) == instance:
                yield body


def _warn_of_instance(view: Any, instance: int, settings: PluginSettings) -> None:
    """Say once what is doubtful about an instance; raise if it wets nothing."""
    wet = []
    reasons: list[str] = []
    for body in _heads(view, instance, settings):
        found = _wet(view, body, settings)
        if found.geoms:
            inertia = inertia_of(view, body, found.members)
            built = hull_of(view, found, settings.options, inertia)
            wet.append((body, found.members, built))
        else:
            whys = ", ".join(f"{geom_name(view, g)} {why}" for g, why in found.left_out.items())
            reasons.append(
                f"body {body_name(view, body)!r} has no geom for water to act on: {whys or 'it has none'}"
            )
    if reasons and not any(built.hull for _, _, built in wet):
        raise SceneError(f"plugin {NAME}: {'; '.join(reasons)}")
    for text in physical_warnings(view, settings.water, wet, medium=view.medium):
        if text not in _told:
            _told.append(text)
            warnings.warn(text, MjskipWarning, stacklevel=2)


MJX = (
    f"MJX is loaded, which drops plugin {NAME} without a word, so that what should float falls there: before every mjx.step "
    "work out mjskip.jax.wrench and put it into xfrc_applied, see docs/routes.md; in MuJoCo itself the water acts"
)


def _warn_of_mjx() -> None:
    """Warn once that MJX knows no plugins, to those who load a model with this one after MJX.

    `mjx.put_model` reads the compiled model's arrays and calls nothing of MuJoCo's, so no warning can be given there.
    """
    if "mujoco.mjx" in sys.modules and MJX not in _told:
        _told.append(MJX)
        warnings.warn(MJX, MjskipWarning, stacklevel=2)


def _warn_of_step(view: Any, body: int, key: int) -> None:
    kept = _records.made.get(key)
    if isinstance(kept, _Kept):
        timestep = float(
            _layout._array(view._address + _layout.option_offset("timestep"), "mjtNum", (1,))[0]
        )
        needed = float(kept.record[loads.NEEDED_STEP])
        warnings.warn(
            too_large_step(body_name(view, body), timestep, needed), MjskipWarning, stacklevel=2
        )


def _configured(view: _layout.ModelView, instance: int) -> PluginSettings:
    """What an instance's keys say; keys that are not there have their defaults.

    Raises:
        ValueError: a value is not allowed; names the instance, the key and the value.
    """
    settings = view.plugin_instance(instance)
    given = {key: text for key, text in zip(KEYS, settings.texts, strict=False) if text}
    who = f"plugin {NAME}" + (f", instance {settings.name!r}" if settings.name else "")
    try:
        for key, allowed in (("preset", PRESETS), ("bodies", ("tree", "this"))):
            if key in given and given[key] not in allowed:
                raise ValueError(f"{key} is {given[key]!r}: use one of {', '.join(allowed)}")
        own = {k: _value(k, t) for k, t in given.items() if k in WATER_KEYS}
        if "sea" in given and not own.get("radiation"):
            raise ValueError(
                f"sea is {given['sea']!r} and radiation is off: waves act on bodies that radiate; give "
                'preset="floating" and radiation="true"'
            )
        hull = {k: _value(k, t) for k, t in given.items() if k in HULL_KEYS}
        moving = MovingWater(**{k: _value(k, t) for k, t in given.items() if k in SURFACE_KEYS})
        water = Water.floating(**own) if "preset" in given else Water(**own)
        gravity = float(-view.gravity[2])
        if (moving.moves or water.radiation) and not gravity > 0.0:
            raise ValueError(
                f"gravity is {-gravity:g} m/s^2 along z: waves need water that is held down; give a negative number, or "
                "still water"
            )
        if moving.moves:
            check_law(water.law)
            if water.radiation:
                raise ValueError(
                    f"surface is {moving.surface!r} and radiation is on: bodies that radiate have a surface of their "
                    "own; give one of the two"
                )
        return PluginSettings(
            water=water,
            options=HullOptions(**hull),
            surface=moving,
            geoms=_geom_rule(given.get("geoms", "")),
            below=given.get("bodies", "tree") == "tree",
            sea=Sea.from_text(given.get("sea", ""), gravity=gravity if gravity > 0.0 else 9.81),
            sea_text=given.get("sea", ""),
        )
    except ValueError as error:
        raise ValueError(f"{who}: {error}") from error
    except ArithmeticError as error:
        text = " ".join(f"{key}={text}" for key, text in given.items())
        raise ValueError(f"{who}: a number is too large or too small ({text})") from error


def _check_sensors(view: _layout.ModelView, instance: int, settings: PluginSettings) -> None:
    """MuJoCo asks for a sensor's size before it says which object the sensor names."""
    kinds = view.sensor_objtype[view.sensor_plugin == instance]
    site = int(mujoco.mjtObj.mjOBJ_SITE)
    if (kinds[kinds != site]).any() or ((kinds == site).any() and not settings.surface.moves):
        raise ValueError(
            f"plugin {NAME}: a sensor shows every body of its instance in turn; leave out objtype and "
            "objname, and give a body an instance of its own for a sensor of its own; over water that moves "
            'objtype="site" shows its level at a site'
        )


def _value(key: str, text: str) -> Any:
    if key in SWITCHES:
        if text not in ("true", "false"):
            raise ValueError(f"{key} is {text!r}: give true or false")
        return text == "true"
    if key in COUNTS:
        if not text.isdigit():
            raise ValueError(f"{key} is {text!r}: give a whole number")
        return int(text)
    if key in NUMBERS:
        try:
            return float(text)
        except ValueError:
            raise ValueError(f"{key} is {text!r}: give a number") from None
    return text
