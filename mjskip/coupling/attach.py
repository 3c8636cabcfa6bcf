"""Water on the bodies of any MuJoCo model: `attach`."""

from __future__ import annotations

import ctypes
import sys
import threading
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from numba import types

from mjskip._compile.jit import native as compile_native
from mjskip._compile.pointers import address_of_cfunc
from mjskip._typing import Array
from mjskip.coupling import _control_kernels as tables
from mjskip.coupling.bodies import body_name, body_stone, find_body, free_bodies
from mjskip.coupling.plugin import plugin_water
from mjskip.errors import DivergedError, MjskipWarning, SceneError
from mjskip.hydro.stone import Stone
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import Wrench, pack, wrench_address, wrench_of
from mjskip.rigid.state import pack_states


@dataclass(frozen=True, eq=False)
class Coupling:
    """Water that acts on bodies of one model while `attach` is open.

    Attributes:
        model: the model; its copies are strangers.
        bodies: ids of the bodies the water acts on.
        stones: what each of them is to the water, in the same order.
        water: the fluid.
        blocks: what the force kernel knows of each; a patch of surface may be put there.
    """

    model: mujoco.MjModel
    bodies: tuple[int, ...]
    stones: tuple[Stone, ...]
    water: Water
    _entry: npt.NDArray[np.int64] = field(repr=False)
    _frames: list[npt.NDArray[np.float64]] = field(repr=False)
    blocks: list[npt.NDArray[np.float64]] = field(repr=False)

    def check(self) -> None:
        """Raise if a force was not finite since `attach`.

        Raises:
            DivergedError: with the first such body and its time.
        """
        body = int(self._entry[tables.FAILED])
        if body >= 0:
            when = float(
                self._entry[tables.FAILURE_TIME : tables.FAILURE_TIME + 1].view(np.float64)[0]
            )
            name = body_name(self.model, body)
            raise DivergedError(
                f"the water's force on body {name!r} is not finite at t = {when:.6g} s: use a smaller "
                "time step or a slower throw",
                body=name,
                time=when,
            )

    def replace_loads(self, function: int, context: Array) -> None:
        """Let a C function void(context, model, data) set the wrenches of all bodies in `xfrc_applied` instead.

        Args:
            function: its address.
            context: handed to it; must stay alive.
        """
        self._entry[tables.CONTEXT] = context.ctypes.data
        self._entry[tables.INSTEAD] = function

    def wrench(self, data: mujoco.MjData, body: int | str) -> Wrench:
        """Wrench of water and air on an attached body, by name or id, in the pose and motion of `data`.

        Raises:
            SceneError: the water does not act on such a body.
        """
        body = find_body(self.model, body) if isinstance(body, str) else body
        if body not in self.bodies:
            has = ", ".join(f"{body_name(self.model, b)!r} ({b})" for b in self.bodies)
            raise SceneError(f"body {body!r} is not attached: the water acts on {has}")
        velocity = np.empty(6)
        mujoco.mj_objectVelocity(self.model, data, mujoco.mjtObj.mjOBJ_BODY, body, velocity, 0)
        rotation = data.xmat[body].reshape(1, 3, 3)
        states = pack_states(
            data.xipos[body][None], rotation, velocity[None, 3:], velocity[None, :3]
        )
        return wrench_of(self.blocks[self.bodies.index(body)], states)


def attach(
    model: mujoco.MjModel,
    data: mujoco.MjData | None = None,
    *,
    water: Water | None = None,
    bodies: Sequence[str] | None = None,
    geoms: Sequence[str] | None = None,
    native: bool = True,
) -> AbstractContextManager[Coupling]:
    """Let still water (z = 0) and air act on bodies of a model for as long as the context is open.

    The forces are worked out inside MuJoCo at every evaluation, RK4's sub-stages included, and assigned
    to `xfrc_applied` of the attached bodies, for every MjData that is stepped with this very model:
    also in `mujoco.rollout` and, after `batch.set_models(model)`, in `mujoco.batch.Batch`. What a user
    (or a viewer's mouse) puts there for an attached body is overwritten; other bodies keep theirs.

    Args:
        model: compiled model. Its mass, inertia and geoms are read once, here.
        data: its `xfrc_applied` of the attached bodies is put back at the end; may be None.
        water: the fluid; `Water()` if omitted.
        bodies: names of the bodies; all bodies with a free joint if None.
        geoms: names of the geoms that water touches; all geoms of the bodies if None.
        native: False installs a callback in plain Python, for teaching and tests: far slower, and no model can
            be compiled, nor threads be used, while it is there.

    Returns:
        A context that enters with the coupling, whose `check()` raises if a force was not finite. Leaving the
        context does too.

    Raises:
        SceneError: no such body, a geom that is no solid, a model that silences callbacks, or one that is
            attached already.
        MeshError: a mesh geom is not closed.
        DivergedError: on leaving, if a force was not finite.
    """
    return _Attachment(_attached_water(model, data, water or Water(), bodies, geoms, native))


class _Attachment(AbstractContextManager[Coupling]):
    """Water that acts once it is entered, and says so if it never was."""

    def __init__(self, water: AbstractContextManager[Coupling]) -> None:
        self._water, self._entered = water, False

    def __enter__(self) -> Coupling:
        self._entered = True
        return self._water.__enter__()

    def __exit__(self, *error: Any) -> bool | None:
        return self._water.__exit__(*error)

    def __del__(self) -> None:
        if not self._entered and not sys.is_finalizing():
            warnings.warn(
                "attach() without `with` does nothing: write `with attach(model, data):` around the steps",
                MjskipWarning,
                stacklevel=2,
            )


@contextmanager
def _attached_water(
    model: mujoco.MjModel,
    data: mujoco.MjData | None,
    water: Water,
    bodies: Sequence[str] | None,
    geoms: Sequence[str] | None,
    native: bool,
) -> Iterator[Coupling]:
    """What `attach` does."""
    coupling = _couple(model, water, bodies, geoms)
    before = None if data is None else data.xfrc_applied[list(coupling.bodies)].copy()
    remove = _install_native(coupling) if native else _install_python(coupling)
    try:
        yield coupling
    finally:
        remove()
        if data is not None:
            data.xfrc_applied[list(coupling.bodies)] = before
    coupling.check()


def _couple(
    model: mujoco.MjModel, water: Water, bodies: Sequence[str] | None, geoms: Sequence[str] | None
) -> Coupling:
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_ACTUATION:
        raise SceneError(
            'this model says <flag actuation="disable"/>, which silences callbacks: remove it so that '
            "water can act"
        )
    ids = free_bodies(model) if bodies is None else [find_body(model, name) for name in bodies]
    if not ids:
        raise SceneError(
            "this model has no free body: give the stone a <freejoint/>, or name bodies="
        )
    for body in ids:
        if plugin_water(model, body) is not None:
            raise SceneError(
                f"body {body_name(model, body)!r} has its water from plugin mjskip.water: name others with "
                "bodies=, or take the plugin out of the model"
            )
    if geoms is not None:
        has = [model.geom(g).name for g in range(model.ngeom) if model.geom_bodyid[g] in ids]
        for geom in geoms:
            if geom not in has:
                raise SceneError(
                    f"no geom {geom!r} on these bodies: their geoms are {', '.join(has)}"
                )
    stones = [body_stone(model, body, geoms=geoms) for body in ids]
    gravity = float(-model.opt.gravity[2])
    blocks = [pack(stone, water, gravity=gravity) for stone in stones]
    frames = [np.array([*model.body_ipos[body], 1.0, 0.0, 0.0, 0.0]) for body in ids]
    words = [model.nbody, len(ids), -1, 0, 0, 0]
    for body, frame, block in zip(ids, frames, blocks, strict=True):
        words += [body, frame.ctypes.data, block.ctypes.data]
    return Coupling(
        model=model,
        bodies=tuple(ids),
        stones=tuple(stones),
        water=water,
        _entry=np.array(words, dtype=np.int64),
        _frames=frames,
        blocks=blocks,
    )


_lock = threading.RLock()
_attached: dict[int, Coupling] = {}
_in_python: set[int] = set()
_old_maps: deque[Any] = deque(maxlen=1000)
"""Maps that a callback in another thread may still be reading; it does so for microseconds."""


@cache
def compile_callback() -> Any:
    """The compiled callback and its address (first use compiles, about ten seconds, then cached)."""
    tables.root[tables.WRENCH] = wrench_address()
    function = compile_native(types.void(types.int64, types.int64))(tables.control)
    return function, address_of_cfunc(function)


def _install_native(coupling: Coupling) -> Any:
    slot = ctypes.c_void_p.in_dll(tables.library, "mjcb_control")
    with _lock:
        _, address = compile_callback()
        _register(coupling)
        if slot.value != address:  # chain to whoever was here; a nested attach finds itself
            tables.root[tables.PREVIOUS] = slot.value or 0
            slot.value = address

    def remove() -> None:
        with _lock:
            del _attached[coupling.model._address]
            _publish()
            if not _attached and slot.value == address:
                slot.value = int(tables.root[tables.PREVIOUS]) or None
                tables.root[tables.PREVIOUS] = 0

    return remove


def _register(coupling: Coupling) -> None:
    address = coupling.model._address
    _refuse_attached(address)
    _attached[address] = coupling
    _publish()


def _refuse_attached(address: int) -> None:
    if address in _attached or address in _in_python:
        raise SceneError("this model is attached already: one attach() can name several bodies")


def _publish() -> None:
    """Make the map of attached models anew and let the callback see it."""
    slots = max(4 * len(_attached), 1)
    fresh = np.zeros(1 + 2 * slots, dtype=np.int64)
    fresh[tables.SLOTS] = slots
    for address, coupling in _attached.items():
        k = (address >> 4) % slots
        while fresh[tables.PAIRS + 2 * k]:
            k = (k + 1) % slots
        fresh[tables.PAIRS + 2 * k : tables.PAIRS + 2 * k + 2] = (
            address,
            coupling._entry.ctypes.data,
        )
    arrays = [(c._entry, c._frames, c.blocks) for c in _attached.values()]
    _old_maps.append((fresh, arrays))  # not the models: they may be large
    tables.root[tables.MAP] = fresh.ctypes.data


def _install_python(coupling: Coupling) -> Any:
    slot = ctypes.c_void_p.in_dll(tables.library, "mjcb_control")
    address, name = slot.value, mujoco.get_mjcb_control()
    model_address = coupling.model._address
    chained: Any = None

    def callback(model: mujoco.MjModel, data: mujoco.MjData) -> None:
        if chained is not None:
            chained(model, data)
        if model._address != model_address:
            return
        for body in coupling.bodies:
            found = coupling.wrench(data, body)
            load = np.hstack([found.force + found.air_force, found.torque + found.air_torque])
            if not np.isfinite(load).all():
                load[:] = 0.0
                if coupling._entry[tables.FAILED] < 0:
                    when = coupling._entry[tables.FAILURE_TIME : tables.FAILURE_TIME + 1]
                    when.view(np.float64)[0] = data.time
                    coupling._entry[tables.FAILED] = body
            data.xfrc_applied[body] = load

    with _lock:
        _refuse_attached(model_address)
        mujoco.set_mjcb_control(callback)
        _in_python.add(model_address)
    if address == slot.value:  # the bindings' own entry, which leads to a Python function
        chained = name
    elif address:
        native = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(address)

        def chained(model: mujoco.MjModel, data: mujoco.MjData) -> None:
            native(model._address, data._address)

    def remove() -> None:
        with _lock:
            _in_python.discard(model_address)
            mujoco.set_mjcb_control(name)
            slot.value = address  # of a C function that the bindings know nothing of

    return remove
