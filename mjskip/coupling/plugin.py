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

Keys are the fields of `Water`. A sensor shows force (3) [N] and torque (3) [N m] of water and air, world
frame, about the centre of mass, and wetted area [m^2], of every body of the instance in turn.
"""

from __future__ import annotations

import ctypes
import threading
from collections import deque
from dataclasses import fields
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import address_of_cfunc
from mjskip.coupling import _plugin_kernels as kernels
from mjskip.coupling import _struct_layout as _layout
from mjskip.coupling._struct_layout import library
from mjskip.coupling.bodies import body_stone
from mjskip.errors import MjskipError
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import immersion_address, pack, wrench_address

NAME = "mjskip.water"
KEYS = tuple(field.name for field in fields(Water))
SWITCHES = {field.name for field in fields(Water) if field.type in (bool, "bool")}
NUMBERS = {field.name for field in fields(Water) if field.type in (float, "float")}

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
            library.mjp_registerPlugin(ctypes.byref(plugin))


def plugin_water(model: mujoco.MjModel, body: int) -> Water | None:
    """The water that the plugin puts on a body of a compiled model; None if it puts none there."""
    instance = int(model.body_plugin[body])
    if instance < 0 or model.plugin[instance] != _slot():
        return None
    return _configured(_layout.ModelView(model._address), instance)


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
    }
    plugin = _Plugin(
        name=NAME.encode(),
        nattribute=len(KEYS),
        attributes=(ctypes.c_char_p * len(KEYS))(*(key.encode() for key in KEYS)),
        capabilityflags=kernels.PASSIVE | kernels.SENSOR,
        needstage=int(mujoco.mjtStage.mjSTAGE_VEL),
        **{name: address_of_cfunc(function) for name, function in functions.items()},
    )
    _keep_for_ever((plugin, functions))
    return plugin


def _fill_root() -> None:
    """Tell the compiled code where everything is."""
    builder = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(_answer)
    _keep_for_ever((builder, kernels.root, _answer))
    root = kernels.root
    root[kernels.WRENCH] = wrench_address()
    root[kernels.IMMERSION] = immersion_address()
    root[kernels.BUILDER] = ctypes.cast(builder, ctypes.c_void_p).value or 0
    root[kernels.TABLE] = _blocks.table.ctypes.data
    root[kernels.GRAVITY] = _layout.gravity_offset()
    model, data = _layout.members("mjModel"), _layout.members("mjData")
    root[kernels.MEMBERS :] = [
        *(model[name].offset for name in kernels.MODEL_MEMBERS),
        *(data[name].offset for name in kernels.DATA_MEMBERS),
    ]


def _keep_for_ever(objects: Any) -> None:
    """MuJoCo keeps their addresses until the process ends, even if this module is loaded anew."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(objects))


class _Blocks:
    """Every block that was built, by the hash of what it was built from.

    Compiled code reads the table at any time, from any thread. Tables that were replaced are kept, and
    blocks that were dropped too, until as many again are dropped.
    """

    KEPT_BYTES = 2**28

    def __init__(self) -> None:
        self.built: dict[int, npt.NDArray[np.float64] | None] = {}
        self._bytes = 0
        self._retired: list[Any] = []
        self._dropped: list[Any] = []
        self._set_slots(1024)

    def add(self, key: int, block: npt.NDArray[np.float64] | None) -> None:
        """Remember a block; None if there cannot be one."""
        if self._bytes > self.KEPT_BYTES:
            self._dropped = [*self._retired, self.table, self.built]
            self.built, self._bytes, self._retired = {}, 0, []
            self._set_slots(1024)
        elif 2 * len(self.built) >= self.table[kernels.SLOTS]:
            self._retired.append(self.table)
            self._set_slots(2 * int(self.table[kernels.SLOTS]))
        self.built[key] = block
        self._bytes += 0 if block is None else block.nbytes
        self._put(key, block)

    def _set_slots(self, slots: int) -> None:
        self.table = np.zeros(kernels.PAIRS + 2 * slots, dtype=np.int64)
        self.table[kernels.SLOTS] = slots
        for key, block in self.built.items():
            self._put(key, block)
        kernels.root[kernels.TABLE] = self.table.ctypes.data

    def _put(self, key: int, block: npt.NDArray[np.float64] | None) -> None:
        mask = int(self.table[kernels.SLOTS]) - 1
        k = key & mask
        while self.table[kernels.PAIRS + 2 * k]:
            k = (k + 1) & mask
        self.table[kernels.PAIRS + 2 * k + 1] = 0 if block is None else block.ctypes.data
        self.table[kernels.PAIRS + 2 * k] = key


_blocks = _Blocks()
_messages: deque[Any] = deque(maxlen=100)
"""Texts of errors, which compiled code in another thread is about to hand to MuJoCo."""


def _answer(model: int, address: int, _unused: int) -> None:
    """Answer a request of compiled code: build the block of a body, or check a configuration."""
    request = (ctypes.c_int64 * kernels.REQUEST).from_address(address)
    body, key = request[kernels.BODY], request[kernels.KEY]
    try:
        view = _layout.ModelView(model)
        water = _configured(view, request[kernels.INSTANCE])
        _check_sensors(view, request[kernels.INSTANCE])
        if body >= 0:
            with _lock:
                if _blocks.built.get(key) is None:
                    stone, gravity = body_stone(view, body), float(-view.gravity[2])
                    _blocks.add(key, pack(stone, water, gravity=gravity))
                block = _blocks.built[key]
                request[kernels.BLOCK] = 0 if block is None else block.ctypes.data
    except Exception as error:  # nothing may pass through the C code that called
        text = " ".join(str(error).split()) or type(error).__name__
        message = ctypes.create_string_buffer(text.replace("%", "%%").encode())
        _messages.append(message)
        request[kernels.MESSAGE] = ctypes.addressof(message)
        with _lock:
            if body >= 0 and key not in _blocks.built:
                _blocks.add(key, None)


def _configured(view: _layout.ModelView, instance: int) -> Water:
    """The water that an instance's keys say; keys that are not there have `Water`'s defaults.

    Raises:
        ValueError: a value is not allowed; names the instance, the key and the value.
    """
    told = view.plugin_instance(instance)
    given = {key: text for key, text in zip(KEYS, told.texts, strict=False) if text}
    who = f"plugin {NAME}" + (f", instance {told.name!r}" if told.name else "")
    try:
        return Water(**{key: _value(key, text) for key, text in given.items()})
    except ValueError as error:
        raise ValueError(f"{who}: {error}") from error


def _check_sensors(view: _layout.ModelView, instance: int) -> None:
    """MuJoCo asks for a sensor's size before it says which object the sensor names."""
    if view.sensor_objtype[view.sensor_plugin == instance].any():
        raise ValueError(
            f"plugin {NAME}: a sensor shows every body of its instance in turn; leave out objtype and "
            "objname, and give a body an instance of its own for a sensor of its own"
        )


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
