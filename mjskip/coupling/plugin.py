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
from mjskip.coupling.bodies import body_geoms, body_name, geom_name, pose_in
from mjskip.coupling.moving_water import moving_functions
from mjskip.coupling.plugin_keys import (
    KEYS,
    NAME,
    PluginSettings,
    instance_settings,
    plugin_slot,
    plugin_wet_body,
    wetted_bodies,
)
from mjskip.coupling.plugin_table import Kept, Records
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
from mjskip.coupling.selection import can_move, members_of
from mjskip.coupling.wet import hull_of, inertia_of
from mjskip.errors import MjskipError, MjskipWarning, SceneError
from mjskip.hydro.wrench import immersion_address, pack, wrench_address

_lock = threading.RLock()


def register_plugin() -> None:
    """Tell MuJoCo of the plugin `mjskip.water`, for the life of the process; again does nothing.

    Needed before a model that uses it is compiled; `load_scene` does it for scenes. The first call on a
    machine compiles for some ten seconds.

    Raises:
        MjskipError: this version of MuJoCo keeps its data elsewhere than it says; `attach` still works.
    """
    with _lock:
        if plugin_slot() < 0:
            _layout.check(kernels.DATA_MEMBERS)
            _fill_root()
            plugin = _describe()
            kernels.root[kernels.SLOT] = library.mjp_registerPlugin(ctypes.byref(plugin))


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
    root[kernels.DISABLED] = _layout.option_offset("disableflags")
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


_records = Records()
_messages: deque[Any] = deque(maxlen=100)
"""Texts of errors, which compiled code in another thread is about to hand to MuJoCo."""
_warned: deque[str] = deque(maxlen=1000)
"""Warnings that were given: once in a process."""


def _answer(model: int, address: int, _unused: int) -> None:
    """Answer a request of compiled code; see `_plugin_kernels`."""
    request = (ctypes.c_int64 * kernels.REQUEST).from_address(address)
    what, body, instance, key = request[0], request[1], request[2], request[3]
    try:
        view = _layout.ModelView(model)
        if what == kernels.TOO_LARGE_STEP:
            _warn_of_step(view, body, key)
            return
        settings = instance_settings(view, instance)
        if settings.water.radiation:
            _link_sea()
        if what == kernels.CONFIGURATION:
            _warn_of_mjx()
            _check_sensors(view, instance, settings)
            _check_acts(view, instance, settings)
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
    wet = plugin_wet_body(view, body, settings)
    if not wet.geoms:
        return _records.add(key, kernels.DRY)
    inertia = inertia_of(view, body, wet.members)
    built = hull_of(view, wet, settings.options, inertia)
    if isinstance(known, Kept) and known.built is not None and known.built() is built:
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
    return _records.add(key, Kept(record=record, blocks=blocks, built=weakref.ref(built)))


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
        return _records.add(key, Kept(record=record))
    return known if isinstance(known, int) else int(known.record.ctypes.data)


def _sea_of(view: Any, instance: int) -> tuple[int, SeaSurface]:
    """The surface of an instance whose bodies radiate, and its hash."""
    settings = instance_settings(view, instance)
    options = finer(settings.options)
    found = []
    for body in range(1, int(view.nbody)):
        if int(view.body_plugin[body]) != instance:
            continue
        wet = plugin_wet_body(view, body, settings)
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
    slot = plugin_slot()
    view = _layout.ModelView(model._address)
    for number in range(model.nplugin) if instance is None else (instance,):
        if int(model.plugin[number]) == slot and instance_settings(view, number).water.radiation:
            return _sea_of(view, number)[1]
    raise SceneError(f'no instance of plugin {NAME} in this model has radiation="true"')


def _carried_mass(view: Any, body: int) -> float:
    """Mass of a body and of all below it [kg]: MuJoCo's own sum comes after the plugin is asked for its size."""
    inside = {body}
    for other in range(body + 1, int(view.nbody)):
        if int(view.body_parentid[other]) in inside:
            inside.add(other)
    return float(sum(view.body_mass[b] for b in inside))


def _warn_of_instance(view: Any, instance: int, settings: PluginSettings) -> None:
    """Say once what is doubtful about an instance; raise if it wets nothing."""
    wet = []
    reasons: list[str] = []
    for body in wetted_bodies(view, instance, settings):
        found = plugin_wet_body(view, body, settings)
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
    for text in physical_warnings(
        view, settings.water, wet, medium=view.medium, gravity=view.gravity
    ):
        if text not in _warned:
            _warned.append(text)
            warnings.warn(text, MjskipWarning, stacklevel=2)


MJX = (
    f"MJX is loaded, which drops plugin {NAME} without a word, so that what should float falls there: before every mjx.step "
    "work out mjskip.jax.wrench and put it into xfrc_applied, see docs/routes.md; in MuJoCo itself the water acts"
)


def _warn_of_mjx() -> None:
    """Warn once that MJX knows no plugins, to those who load a model with this one after MJX.

    `mjx.put_model` reads the compiled model's arrays and calls nothing of MuJoCo's, so no warning can be given there.
    """
    if "mujoco.mjx" in sys.modules and MJX not in _warned:
        _warned.append(MJX)
        warnings.warn(MJX, MjskipWarning, stacklevel=2)


def _warn_of_step(view: Any, body: int, key: int) -> None:
    kept = _records.made.get(key)
    if isinstance(kept, Kept):
        timestep = float(
            _layout._array(view._address + _layout.option_offset("timestep"), "mjtNum", (1,))[0]
        )
        needed = float(kept.record[loads.NEEDED_STEP])
        warnings.warn(
            too_large_step(body_name(view, body), timestep, needed), MjskipWarning, stacklevel=2
        )


PASSIVE = int(mujoco.mjtDisableBit.mjDSBL_SPRING) | int(mujoco.mjtDisableBit.mjDSBL_DAMPER)


def _check_acts(view: _layout.ModelView, instance: int, settings: PluginSettings) -> None:
    """Refuse an instance whose force nothing would feel."""
    carriers = np.flatnonzero(np.asarray(view.body_plugin) == instance)
    wetted = list(wetted_bodies(view, instance, settings))
    if len(carriers) and not any(can_move(view, body) for body in wetted):
        name = body_name(view, int(carriers[0])) if carriers[0] else "world"
        raise SceneError(
            f"plugin {NAME}: body {name!r} carries it, which does not move: put it into a body with a joint at or above "
            "it, as the root of what is to be wet"
        )
    if view.disabled & PASSIVE == PASSIVE:
        raise SceneError(
            f'plugin {NAME}: <flag spring="disable" damper="disable"/> silences every passive force, and the water\'s too: '
            "enable one of them, or use mjskip.attach(model, data)"
        )


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
