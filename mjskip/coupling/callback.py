"""The place of the water's callback in MuJoCo, and the models that it knows."""

from __future__ import annotations

import ctypes
import threading
import weakref
from collections import deque
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
from numba import types

from mjskip._compile.jit import native as compile_native
from mjskip._compile.pointers import address_of_cfunc
from mjskip._typing import Array
from mjskip.coupling import _control_kernels as tables
from mjskip.coupling import _record_kernels as loads
from mjskip.coupling._struct_layout import check, library, members
from mjskip.coupling.sea import SeaSurface, compiled
from mjskip.coupling.wet import Inertia
from mjskip.errors import SceneError
from mjskip.hydro._block import WEIGHT_DENSITY
from mjskip.hydro.wrench import wrench_address

if TYPE_CHECKING:
    from mjskip.coupling.attach import Coupling


class Entry:
    """What compiled code knows of an attached model, and what it says has happened.

    Attributes:
        words: see `_control_kernels`.
        records: of every wet body; kept alive here, as all that the words point to.
        blocks: what the records point to.
        offsets: from MuJoCo's centre of mass of a body to the record's (3,), body axes; None if they are one.
        replaced: whether another callback took the water's place.
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        bodies: tuple[int, ...],
        records: list[Array],
        blocks: list[Array],
        inertias: list[Inertia],
        surface: SeaSurface | None = None,
    ) -> None:
        """Of a model; it is not kept alive. Bodies of the surface radiate."""
        self.records, self.blocks, self.replaced = records, blocks, False
        self.offsets: list[Array | None] = []
        for body, inertia in zip(bodies, inertias, strict=True):
            offset = np.asarray(inertia.centre - model.body_ipos[body], np.float64)
            self.offsets.append(offset if offset.any() else None)
        gravity, timestep, disabled = _option_addresses(model)
        words = np.zeros(tables.RECORDS + tables.ROW * len(bodies), np.int64)
        words[tables.ATTACHED] = len(bodies)
        words[tables.GRAVITY], words[tables.TIMESTEP] = gravity, timestep
        words[tables.DISABLED] = disabled
        words[tables.INVERSE_WEIGHTS] = model.body_invweight0.ctypes.data
        words[tables.SIGNATURE : tables.SIGNATURE + 1].view(np.uint64)[0] = model.signature
        self.names = np.frombuffer(model.names, np.uint8).copy()
        words[tables.BUFFER_SIZE], words[tables.NAMES_SIZE] = model.nbuffer, self.names.size
        words[tables.NAMES] = self.names.ctypes.data
        for k, body in enumerate(bodies):
            at, away = tables.RECORDS + tables.ROW * k, self.offsets[k]
            words[at], words[at + 1] = body, model.body_rootid[body]
            words[at + 2] = records[k].ctypes.data
            words[at + 3] = 0 if away is None else away.ctypes.data
        self.surface = surface
        if surface is not None:
            words[tables.SEA] = surface.entry.ctypes.data
            words[tables.SEA_ACT] = compiled()["act_attached"]
            radiating = [one.body for one in surface.bodies]
            for k, body in enumerate(bodies):
                if body in radiating:
                    words[tables.RECORDS + tables.ROW * k + 2] = 0
        self.words = words
        self._gravity = (ctypes.c_double).from_address(gravity)
        self._disabled = (ctypes.c_int).from_address(disabled)
        self.forget()

    def replace_loads(self, function: int, context: Array) -> None:
        """Let a C function void(context, model, data) set the wrenches instead; 0 ends that."""
        self._context = context  # kept alive
        self.words[tables.CONTEXT] = context.ctypes.data
        self.words[tables.INSTEAD] = function

    def forget(self) -> None:
        """Begin anew: nothing has happened."""
        self.replaced = False
        self.words[tables.COPY_CALLS] = 0
        self.words[tables.FAILED] = self.words[tables.LIMITED] = -1
        self._double(tables.NEEDED_STEP)[0] = np.inf

    def _double(self, at: int) -> Array:
        return self.words[at : at + 1].view(np.float64)

    @property
    def failed(self) -> tuple[int, float] | None:
        """First body whose force was not finite, and when."""
        body = int(self.words[tables.FAILED])
        return None if body < 0 else (body, float(self._double(tables.FAILURE_TIME)[0]))

    def fail(self, body: int, when: float) -> None:
        """Say that a force was not finite."""
        if self.failed is None:
            self._double(tables.FAILURE_TIME)[0] = when
            self.words[tables.FAILED] = body

    @property
    def limited(self) -> tuple[int, float, float] | None:
        """Body whose drag was limited most, when, and the time step it needs."""
        body = int(self.words[tables.LIMITED])
        if body < 0:
            return None
        when, needed = self._double(tables.LIMIT_TIME), self._double(tables.NEEDED_STEP)
        return body, float(when[0]), float(needed[0])

    def limit(self, body: int, when: float, needed: float) -> None:
        """Say that a body's drag was limited."""
        if needed < self._double(tables.NEEDED_STEP)[0]:
            self._double(tables.LIMIT_TIME)[0] = when
            self._double(tables.NEEDED_STEP)[0] = needed
            self.words[tables.LIMITED] = body

    @property
    def copy_was_stepped(self) -> bool:
        """Whether a model of the same signature was stepped without water, and this one not any more."""
        return bool(self.words[tables.COPY_CALLS] > COMPILERS_CALLS)

    @property
    def gravity(self) -> float:
        """Of the model, downwards, now [m/s^2]; 0 where it is disabled."""
        return 0.0 if self._disabled.value & tables.NO_GRAVITY else -self._gravity.value

    def follow_gravity(self, record: Array, block: Array) -> None:
        """Let a block have the gravity that its model has now."""
        if record[loads.BEARING] != 0.0:
            block[WEIGHT_DENSITY] = record[loads.BEARING] * self.gravity


def _option_addresses(model: mujoco.MjModel) -> tuple[int, int, int]:
    """Where a model has its gravity along z, its time step, and the flags of what is disabled."""
    option = members("mjOption")
    first = model.opt.gravity.ctypes.data - option["gravity"].offset
    names = ("gravity", "timestep", "disableflags")
    gravity, timestep, disabled = (first + option[name].offset for name in names)
    return gravity + 16, timestep, disabled


def _fill_root() -> None:
    """Tell compiled code where MuJoCo keeps what it needs.

    Raises:
        MjskipError: that is elsewhere than MuJoCo says.
    """
    check(tables.DATA_MEMBERS)
    data = members("mjData")
    for k, name in enumerate(tables.DATA_MEMBERS):
        tables.root[tables.MEMBERS + k] = data[name].offset
    model = members("mjModel")
    tables.root[tables.SIGNATURE_AT] = model["signature"].offset
    tables.root[tables.BUFFER_SIZE_AT] = model["nbuffer"].offset
    tables.root[tables.NAMES_SIZE_AT] = model["nnames"].offset
    tables.root[tables.NAMES_AT] = model["names"].offset
    tables.root[tables.WRENCH] = wrench_address()


COMPILERS_CALLS = 8
"""MuJoCo steps a model that it compiles once; four calls with RK4."""

_lock = threading.RLock()
_attached: dict[int, tuple[Entry, weakref.ref[Coupling]]] = {}
"""Attached models by address. Neither coupling nor model is kept alive by it."""
_in_python: dict[int, tuple[Any, Coupling]] = {}
"""Models that a Python callback knows, with it; the latest last."""
_old_maps: deque[Any] = deque(maxlen=1000)
"""Maps that a callback in another thread may still be reading; it does so for microseconds."""
_slot = ctypes.c_void_p.in_dll(library, "mjcb_control")


@cache
def compile_callback() -> Any:
    """The compiled callback and its address (first use compiles, about ten seconds, then cached)."""
    _fill_root()
    function = compile_native(types.void(types.int64, types.int64))(tables.control)
    return function, address_of_cfunc(function)


def is_acting(coupling: Coupling) -> bool:
    """Whether MuJoCo still calls the water's callback for a coupling."""
    if _in_python:
        # the bindings' own entry leads to a Python function; ours lead to what was there before
        latest, _ = next(reversed(_in_python.values()))
        return mujoco.get_mjcb_control() is latest
    return bool(_slot.value == compile_callback()[1])


def install_native(coupling: Coupling, entry: Entry) -> Callable[[], bool]:
    """Let the compiled callback know a model; what is returned ends that, and says whether it was acting."""
    model = coupling.model
    key = model._address
    with _lock:
        _, address = compile_callback()
        _refuse_attached(key)
        _attached[key] = entry, weakref.ref(coupling)
        forget = weakref.finalize(model, _forget, key, entry)
        forget.atexit = False
        _publish()
        if _slot.value != address:  # chain to whoever was here; a nested attach finds itself
            tables.root[tables.PREVIOUS] = _slot.value or 0
            _slot.value = address

    def remove() -> bool:
        with _lock:
            acting = is_acting(coupling)
            forget.detach()
            _forget(key, entry)
            return acting

    return remove


def _forget(key: int, entry: Entry) -> None:
    """A model is attached no more, or is no more."""
    with _lock:
        if key in _attached and _attached[key][0] is entry:
            del _attached[key]
            _publish()
            _restore_callback()


def _restore_callback() -> None:
    """Put back the callback that was here before, if no model is attached any more."""
    if not _attached and tables.root[tables.WRENCH] and _slot.value == compile_callback()[1]:
        _slot.value = int(tables.root[tables.PREVIOUS]) or None
        tables.root[tables.PREVIOUS] = 0


def _refuse_attached(address: int) -> None:
    taken = address in _in_python
    if address in _attached:
        coupling = _attached[address][1]()
        taken |= coupling is not None and coupling.is_open
    if taken:
        raise SceneError("this model is attached already: one attach() can name several bodies")


def _publish() -> None:
    """Make the map of attached models anew and let the callback see it."""
    slots = max(4 * len(_attached), 1)
    fresh = np.zeros(1 + 2 * slots, dtype=np.int64)
    fresh[tables.SLOTS] = slots
    for address, (entry, _) in _attached.items():
        k = (address >> 4) % slots
        while fresh[tables.PAIRS + 2 * k]:
            k = (k + 1) % slots
        fresh[tables.PAIRS + 2 * k : tables.PAIRS + 2 * k + 2] = (address, entry.words.ctypes.data)
    _old_maps.append((fresh, [entry for entry, _ in _attached.values()]))  # not the models
    tables.root[tables.MAP] = fresh.ctypes.data


def install_python(coupling: Coupling, entry: Entry) -> Callable[[], bool]:
    """The same by a callback in plain Python."""
    address, name = _slot.value, mujoco.get_mjcb_control()
    key = coupling.model._address
    chained: Any = None
    out, scratch = np.empty(loads.WRENCH), np.empty(loads.SCRATCH)

    def callback(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if chained is not None:
            chained(model, data)
        if model._address != key:
            return
        for k, body in enumerate(coupling.bodies):
            state = np.ascontiguousarray(coupling.state(data, k))
            needed = loads.wet_load(
                wrench_address(),
                coupling.records[k].ctypes.data,
                state.ctypes.data,
                out.ctypes.data,
                scratch.ctypes.data,
                float(model.opt.timestep),
                entry.gravity,
                *(float(w) for w in model.body_invweight0[body]),
            )
            entry.limit(body, data.time, needed)
            load = out[:6] + out[6:]
            if not np.isfinite(load).all():
                load[:] = 0.0
                entry.fail(body, data.time)
            offset = entry.offsets[k]
            if offset is not None:
                load[3:] += np.cross(data.xmat[body].reshape(3, 3) @ offset, load[:3])
            data.xfrc_applied[body] = load

    with _lock:
        _refuse_attached(key)
        mujoco.set_mjcb_control(callback)
        _in_python[key] = callback, coupling
    if address == _slot.value:  # the bindings' own entry, which leads to a Python function
        chained = name
    elif address:
        native = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(address)

        def chained(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            native(model._address, data._address)

    def remove() -> bool:
        with _lock:
            acting = is_acting(coupling)
            _in_python.pop(key, None)
            if acting:
                mujoco.set_mjcb_control(name)
                _slot.value = address  # of a C function that the bindings know nothing of
                _restore_callback()
        return acting

    return remove
