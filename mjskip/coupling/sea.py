"""MuJoCo engine plugin `mjskip.sea`: bodies afloat that radiate, diffract and rock in a sea.

    <extension>
      <plugin plugin="mjskip.sea">
        <instance name="sea"> <config key="sea" value="hs=0.3 tp=3"/> </instance>
      </plugin>
    </extension>
    ...
    <body name="boat"> <freejoint/> <plugin instance="sea"/> ... </body>

All bodies that carry an instance share its surface and feel each other's waves. Keys are those of `Water` that
concern drag (density, air_density, gate, law, skin_friction, viscosity), and

    sea     waves and current: see `Sea.from_text`; calm deep water if not given
"""

from __future__ import annotations

import ctypes
import hashlib
import threading
import warnings
from collections import deque
from dataclasses import dataclass, fields
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import address_of_cfunc
from mjskip.coupling import _sea_kernels as kernels
from mjskip.coupling import _struct_layout as _layout
from mjskip.coupling._struct_layout import library
from mjskip.coupling.bodies import body_name, body_stone
from mjskip.coupling.plugin import _Plugin
from mjskip.errors import MjskipError, MjskipWarning, SceneError
from mjskip.hydro import _afloat_kernels as afloat_kernels
from mjskip.hydro.afloat import Afloat, RestPose, prepare, rest_pose, state_slots
from mjskip.hydro.radiation import RadiationTable
from mjskip.hydro.seas import Sea
from mjskip.hydro.stone import Stone
from mjskip.hydro.surface_modes import SurfaceModes
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_address
from mjskip.rigid.attitude import matrices

Array = npt.NDArray[np.float64]

NAME = "mjskip.sea"
WATER_KEYS = tuple(f.name for f in fields(Water) if f.name != "buoyancy")
KEYS = (*WATER_KEYS, "sea")
SWITCHES = {field.name for field in fields(Water) if field.type in (bool, "bool")}
NUMBERS = {field.name for field in fields(Water) if field.type in (float, "float")}
FLOATING = {"gate": "local", "skin_friction": True}
"""Defaults for what floats, where `Water` has the paper's."""

_lock = threading.RLock()


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaSurface:
    """What an instance was prepared for.

    Attributes:
        sea: waves and current.
        water: the fluid.
        modes: of the surface.
        bodies: ids.
        stones: what each is to the water.
        rests: how each floats.
        tables: each against the modes.
        surface: packed, and `packed`, one for every body.
        slots: places of the bodies' readings in the state, and its size.
        entry: what compiled code knows.
        drags: blocks for the force kernel.
    """

    sea: Sea
    water: Water
    modes: SurfaceModes
    bodies: list[int]
    stones: list[Stone]
    rests: list[RestPose]
    tables: list[RadiationTable]
    surface: Afloat
    packed: list[Afloat]
    slots: list[int]
    entry: npt.NDArray[np.int64]
    drags: list[Array]


def register_sea() -> None:
    """Tell MuJoCo of the plugin `mjskip.sea`, for the life of the process; again does nothing.

    Raises:
        MjskipError: this version of MuJoCo keeps its data elsewhere than it says.
    """
    with _lock:
        if _slot() < 0:
            _layout.check(name for name in kernels.DATA_MEMBERS if name != "time")
            _fill_root()
            plugin = _describe()
            library.mjp_registerPlugin(ctypes.byref(plugin))


def _slot() -> int:
    slot = ctypes.c_int(-1)
    library.mjp_getPlugin.restype = ctypes.c_void_p
    found = library.mjp_getPlugin(NAME.encode(), ctypes.byref(slot))
    return slot.value if found else -1


def _describe() -> _Plugin:
    i4, i8, nothing = types.int32, types.int64, types.void
    functions = {
        "nstate": native(i4(i8, i4))(kernels.nstate),
        "nsensordata": native(i4(i8, i4, i4))(kernels.nsensordata),
        "init": native(i4(i8, i8, i4))(kernels.init),
        "reset": native(nothing(i8, i8, i8, i4))(kernels.reset),
        "compute": native(nothing(i8, i8, i4, i4))(kernels.compute),
        "advance": native(nothing(i8, i8, i4))(kernels.advance),
    }
    plugin = _Plugin(
        name=NAME.encode(),
        nattribute=len(KEYS),
        attributes=(ctypes.c_char_p * len(KEYS))(*(key.encode() for key in KEYS)),
        capabilityflags=kernels.PASSIVE,
        needstage=int(mujoco.mjtStage.mjSTAGE_VEL),
        **{name: address_of_cfunc(function) for name, function in functions.items()},
    )
    _keep_for_ever((plugin, functions))
    return plugin


def _fill_root() -> None:
    builder = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(_answer)
    _keep_for_ever((builder, kernels.root, _answer))
    root = kernels.root
    root[kernels.WRENCH] = wrench_address()
    root[kernels.BUILDER] = ctypes.cast(builder, ctypes.c_void_p).value or 0
    root[kernels.TABLE] = _entries.table.ctypes.data
    model, data = _layout.members("mjModel"), _layout.members("mjData")
    root[kernels.MEMBERS :] = [
        *(model[name].offset for name in kernels.MODEL_MEMBERS),
        *(data[name].offset for name in kernels.DATA_MEMBERS),
    ]


def _keep_for_ever(objects: Any) -> None:
    """MuJoCo keeps their addresses until the process ends, even if this module is loaded anew."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(objects))


class _Entries:
    """Every surface that was prepared, by the hash of what it was made of; compiled code reads the table."""

    def __init__(self) -> None:
        self.made: dict[int, SeaSurface] = {}
        self._retired: list[Any] = []
        self._set_slots(256)

    def add(self, key: int, made: SeaSurface) -> None:
        """Remember a surface."""
        if 2 * len(self.made) >= self.table[kernels.SLOTS]:
            self._retired.append(self.table)
            self._set_slots(2 * int(self.table[kernels.SLOTS]))
        self.made[key] = made
        self._put(key, made)

    def _set_slots(self, slots: int) -> None:
        self.table = np.zeros(kernels.PAIRS + 2 * slots, dtype=np.int64)
        self.table[kernels.SLOTS] = slots
        for key, made in self.made.items():
            self._put(key, made)
        kernels.root[kernels.TABLE] = self.table.ctypes.data

    def _put(self, key: int, made: SeaSurface) -> None:
        mask = int(self.table[kernels.SLOTS]) - 1
        k = key & mask
        while self.table[kernels.PAIRS + 2 * k]:
            k = (k + 1) & mask
        self.table[kernels.PAIRS + 2 * k + 1] = made.entry.ctypes.data
        self.table[kernels.PAIRS + 2 * k] = key


_entries = _Entries()
_messages: deque[Any] = deque(maxlen=100)


def _answer(model: int, address: int, _unused: int) -> None:
    """Answer a request of compiled code."""
    request = (ctypes.c_int64 * kernels.REQUEST).from_address(address)
    try:
        view = _layout.ModelView(model)
        with _lock:
            key, made = _surface_of(view, request[kernels.INSTANCE])
        request[kernels.KEY] = key
        request[kernels.SIZE] = made.slots[-1]
        request[kernels.ANSWER] = made.entry.ctypes.data
    except Exception as error:  # nothing may pass through the C code that called
        text = " ".join(str(error).split()) or type(error).__name__
        message = ctypes.create_string_buffer(text.replace("%", "%%").encode())
        _messages.append(message)
        request[kernels.MESSAGE] = ctypes.addressof(message)


def sea_surface(model: mujoco.MjModel, instance: int | None = None) -> SeaSurface:
    """What an instance of the plugin in a compiled model was prepared for; its first by default.

    Raises:
        SceneError: the model has none.
    """
    register_sea()
    if instance is None:
        mine = [i for i in range(model.nplugin) if model.plugin[i] == _slot()]
        if not mine:
            raise SceneError(f"this model has no instance of plugin {NAME}")
        instance = mine[0]
    return _surface_of(_layout.ModelView(model._address), instance)[1]


def _surface_of(view: _layout.ModelView, instance: int) -> tuple[int, SeaSurface]:
    """The surface of an instance, prepared now if need be, and its hash."""
    told = view.plugin_instance(instance)
    bodies = [b for b in range(1, int(view.nbody)) if view.body_plugin[b] == instance]
    if not bodies:
        raise SceneError(f"plugin {NAME}: no body carries this instance")
    timestep = _option(view, "timestep")
    key = _content(view, bodies, told.texts, timestep)
    if key not in _entries.made:
        water, sea = _configured(told, float(-view.gravity[2]))
        _entries.add(key, _prepared(view, bodies, water, sea, timestep))
    return key, _entries.made[key]


def _option(view: _layout.ModelView, name: str) -> float:
    offset = _layout.members("mjModel")["opt"].offset + _layout.members("mjOption")[name].offset
    return ctypes.c_double.from_address(view._address + offset).value


def _content(view: Any, bodies: list[int], texts: list[str], timestep: float) -> int:
    """Hash of all that a surface is made from: 52 bits, so that a double holds it."""
    digest = hashlib.sha256(repr((texts[: len(KEYS)], timestep, bodies)).encode())
    digest.update(view.gravity.tobytes())
    for body in bodies:
        for name in ("pos", "quat", "ipos", "iquat", "inertia", "mass"):
            digest.update(getattr(view, f"body_{name}")[body].tobytes())
        digest.update(np.float64(_carried_mass(view, body)).tobytes())
        first = view.body_geomadr[body]
        for geom in range(first, first + view.body_geomnum[body]):
            for name in ("type", "size", "pos", "quat"):
                digest.update(getattr(view, f"geom_{name}")[geom].tobytes())
            mesh = view.geom_dataid[geom]
            if mesh >= 0:
                a, n = view.mesh_vertadr[mesh], view.mesh_vertnum[mesh]
                digest.update(view.mesh_vert[a : a + n].tobytes())
                a, n = view.mesh_faceadr[mesh], view.mesh_facenum[mesh]
                digest.update(view.mesh_face[a : a + n].tobytes())
    return int.from_bytes(digest.digest()[:8], "big") >> 12 | 1


def _carried_mass(view: Any, body: int) -> float:
    """Mass of a body and of all below it [kg]: MuJoCo's own sum comes after the plugin is asked for its size."""
    inside = {body}
    for other in range(body + 1, int(view.nbody)):
        if int(view.body_parentid[other]) in inside:
            inside.add(other)
    return float(sum(view.body_mass[b] for b in inside))


def _configured(told: Any, gravity: float) -> tuple[Water, Sea]:
    """Water and sea that an instance's keys say.

    Raises:
        ValueError: a value is not allowed; names the instance, the key and the value.
    """
    given = {key: text for key, text in zip(KEYS, told.texts, strict=False) if text}
    who = f"plugin {NAME}" + (f", instance {told.name!r}" if told.name else "")
    try:
        own = {key: _value(key, text) for key, text in given.items() if key in WATER_KEYS}
        return (
            Water(**{**FLOATING, **own}),
            Sea.from_text(given.get("sea", ""), gravity=gravity),
        )
    except ValueError as error:
        raise ValueError(f"{who}: {error}") from error


def _value(key: str, text: str) -> Any:
    if key in SWITCHES:
        if text not in ("true", "false"):
            raise ValueError(f"{key} is {text!r}: give true or false")
        return text == "true"
    if key in NUMBERS:
        try:
            return float(text)
        except ValueError:
            raise ValueError(f"{key} is {text!r}: give a number") from None
    return text


def _prepared(view: Any, bodies: list[int], water: Water, sea: Sea, timestep: float) -> SeaSurface:
    """Hulls, tables and the entry of bodies that float together."""
    stones, rests, places = [], [], []
    for body in bodies:
        stone = body_stone(view, body)
        turn = matrices(np.array(view.body_quat[body]))
        place = np.array(view.body_pos[body]) + turn @ np.array(view.body_ipos[body])
        found = rest_pose(
            stone.triangles,
            mass=_carried_mass(view, body),
            density=water.density,
            rotation=turn,
        )
        if found is None:
            warnings.warn(
                f"body {body_name(view, body)!r} weighs more than the water it displaces: its added mass is that of "
                "where the model has it",
                MjskipWarning,
                stacklevel=2,
            )
            found = RestPose.of(turn, float(place[2]))
        stones.append(stone)
        rests.append(found)
        places.append(place[:2])
    modes, surface, packed, tables = prepare(
        [stone.triangles for stone in stones],
        rests,
        np.array(places),
        sea,
        density=water.density,
        timestep=timestep,
    )
    drags = [pack(stone, water, gravity=sea.gravity) for stone in stones]
    slots = [afloat_kernels.STATE + 2 * modes.size]
    for one, size in zip(packed, np.diff(state_slots(packed, modes.size)), strict=True):
        slots.append(slots[-1] + kernels.OWN + int(size))
    room = max(afloat_kernels.scratch_size(surface.block, one.block) for one in packed)
    entry = np.zeros(kernels.ENTRY + kernels.ROW * len(bodies), dtype=np.int64)
    entry[kernels.SURFACE_BLOCK] = surface.block.ctypes.data
    entry[kernels.SURFACE_WORDS] = surface.words.ctypes.data
    entry[kernels.COUNT] = len(bodies)
    entry[kernels.SCRATCH] = room + 2 * modes.size + 100 + 12 * kernels.MOST_DOFS
    for n, body in enumerate(bodies):
        row = kernels.ENTRY + kernels.ROW * n
        entry[row : row + kernels.ROW] = (
            body,
            packed[n].block.ctypes.data,
            packed[n].words.ctypes.data,
            slots[n],
            drags[n].ctypes.data,
        )
    return SeaSurface(
        sea=sea,
        water=water,
        modes=modes,
        bodies=bodies,
        stones=stones,
        rests=rests,
        tables=tables,
        surface=surface,
        packed=packed,
        slots=slots,
        entry=entry,
        drags=drags,
    )


__all__ = ["MjskipError", "SeaSurface", "register_sea", "sea_surface"]
