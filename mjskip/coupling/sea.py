"""Bodies that radiate inside MuJoCo: hulls and sea prepared for `_sea_kernels`, for `attach` and for the plugin."""

from __future__ import annotations

import ctypes
import hashlib
import math
import threading
import warnings
from collections import OrderedDict, deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import mujoco
import numpy as np
import numpy.typing as npt
from numba import types

from mjskip._compile.jit import native
from mjskip._compile.pointers import address_of_cfunc
from mjskip._typing import Array, Complex, Integers
from mjskip.coupling import _sea_kernels as kernels
from mjskip.coupling import _struct_layout as layout
from mjskip.coupling._table_kernels import PAIRS, SLOTS
from mjskip.coupling.bodies import body_name
from mjskip.coupling.records import make_record
from mjskip.coupling.wet import HullOptions, Inertia
from mjskip.errors import MeshError, MjskipWarning
from mjskip.hydro import _afloat_kernels as afloat_kernels
from mjskip.hydro.afloat import RestPose, prepare
from mjskip.hydro.hull import Hull
from mjskip.hydro.hydrostatics import SinksError, float_at_rest
from mjskip.hydro.radiation import RadiationTable
from mjskip.hydro.seas import Sea
from mjskip.hydro.surface_modes import SurfaceModes
from mjskip.hydro.water import Water
from mjskip.hydro.wrench import pack, wrench_address

_lock = threading.RLock()

NEUTRAL = 0.02
"""Share of a body's displacement within which its weight leaves it where it is put."""
RESOLUTION = 48
"""Segments around a round geom that radiates, at least: its waterplane changes with draft."""


MAX_WAVES, MAX_READINGS = 1200, 300
"""Plane waves of a surface, and readings of each body, at most: a model's meshes are not known yet when MuJoCo wants to
know the size of the state. Bodies far apart share the waves: then the shortest are left out."""


def most_state(bodies: int) -> int:
    """Numbers of a state, at most."""
    return afloat_kernels.STATE + 2 * MAX_WAVES + bodies * (kernels.OWN + MAX_READINGS)


def finer(options: HullOptions) -> HullOptions:
    """How geoms become hulls that radiate."""
    return replace(options, resolution=max(options.resolution, RESOLUTION))


@dataclass(frozen=True, kw_only=True, eq=False)
class FloatingHull:
    """A body that radiates.

    Attributes:
        body: its id.
        name: of it.
        hull: about its centre of mass, axes of the body.
        inertia: of it and of what is welded to it.
        carried: mass of its whole tree [kg].
        rotation: of the body as the model has it, to world (3, 3).
        place: of its centre of mass as the model has it, world (3,) [m].
    """

    body: int
    name: str
    hull: Hull
    inertia: Inertia
    carried: float
    rotation: Array
    place: Array


def smooth_step(share: Array) -> Array:
    """From 0 to 1 with level ends, of shares from 0 to 1."""
    return np.asarray(share * share * (3.0 - 2.0 * share))


@dataclass(frozen=True, kw_only=True, eq=False)
class SeaSurface:
    """A surface with its bodies, prepared.

    Attributes:
        sea: waves and current.
        water: the fluid.
        modes: of the surface.
        bodies: that float in it.
        rests: how each floats.
        tables: each against the modes.
        entry: what compiled code knows; `kept` is what it points to.
        state_size: numbers of the surface's state.
        timestep: of the simulation [s].
    """

    sea: Sea
    water: Water
    modes: SurfaceModes
    bodies: tuple[FloatingHull, ...]
    rests: tuple[RestPose, ...]
    tables: tuple[RadiationTable, ...]
    entry: Integers
    state_size: int
    timestep: float
    kept: tuple[Any, ...] = field(repr=False)
    states: dict[int, Array] = field(default_factory=dict, repr=False)

    def amplitudes(self, state: Array) -> Complex:
        """Amplitudes of the modes in a state of this surface."""
        start, size = afloat_kernels.STATE, self.modes.size
        return np.asarray(state[start : start + size] + 1j * state[start + size : start + 2 * size])

    def state_of(self, data: mujoco.MjData) -> Array:
        """State of this surface in attached data; calm if it was not stepped yet."""
        return self.states.get(data._address, np.zeros(self.state_size))

    def load_on(self, body: int, state: Array) -> Array | None:
        """Force and torque (6) on a body at the last evaluation, world; None if it does not radiate."""
        for n, one in enumerate(self.bodies):
            if one.body == body:
                slot = int(self.entry[kernels.ENTRY + kernels.ROW * n + kernels.SLOT])
                return np.array(state[slot + kernels.LOAD : slot + kernels.LOAD + 6])
        return None

    def elevation(self, state: Array, points: npt.ArrayLike) -> Array:
        """Height of the surface at points (n, 2): the sea, and what the bodies made within their reach [m].

        The bodies' waves fade towards twice the reach, beyond which the modes say nothing of them.
        """
        xy = np.atleast_2d(np.asarray(points, dtype=np.float64))[:, :2]
        relative = xy - self._origin(state)
        fade = self._fade(relative)
        near = fade > 0.0
        heights = self.sea.elevation(xy, float(state[afloat_kernels.TIME]))
        heights[near] += fade[near] * self.modes.elevation(self.amplitudes(state), relative[near])
        return heights

    def grid_elevation(self, state: Array, x: Array, y: Array) -> Array:
        """The same at the points of a grid with axes x (nx,) and y (ny,) [m], quickly: (nx, ny) [m]."""
        heights = self.sea.grid_elevation(x, y, float(state[afloat_kernels.TIME]))
        east, north = (at - o for at, o in zip((x, y), self._origin(state), strict=True))
        fade = self._fade(np.stack(np.meshgrid(east, north, indexing="ij"), axis=-1))
        (i,), (j,) = (np.nonzero(fade.any(axis=axis)) for axis in (1, 0))
        if len(i):
            part = np.ix_(i, j)
            made = self.modes.grid_elevation(self.amplitudes(state), east[i], north[j])
            heights[part] += fade[part] * made
        return heights

    def _origin(self, state: Array) -> Array:
        """About which the modes are written (2,) [m]."""
        return state[[afloat_kernels.ORIGIN_X, afloat_kernels.ORIGIN_Y]]

    def _fade(self, relative: Array) -> Array:
        """Share of the bodies' waves that is shown at places (..., 2) relative to the origin [m]."""
        away = np.linalg.norm(relative, axis=-1) / self.modes.reach
        share = np.clip((FADE_RANGE - away) / (FADE_RANGE - 1.0), 0.0, 1.0)
        return smooth_step(share)


FADE_RANGE = 2.0
"""Where waves of bodies have faded from the picture, in reaches."""


@cache
def compiled() -> dict[str, int]:
    """Addresses of the compiled functions (first use compiles), and the tables filled that they need."""
    builder = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * 3)(_answer)
    i8 = types.int64
    names = ("act", "advance", "sense", "act_attached")
    functions = {name: native(types.void(i8, i8, i8))(getattr(kernels, name)) for name in names}
    ctypes.pythonapi.Py_IncRef(ctypes.py_object((builder, functions, kernels.root, _answer)))
    layout.check(name for name in kernels.DATA_MEMBERS if name != "time")
    root = kernels.root
    root[kernels.WRENCH] = wrench_address()
    root[kernels.BUILDER] = ctypes.cast(builder, ctypes.c_void_p).value or 0
    root[kernels.TABLE] = _entries.table.ctypes.data
    root[kernels.GRAVITY] = layout.option_offset("gravity")
    root[kernels.TIMESTEP] = layout.option_offset("timestep")
    model, data = layout.members("mjModel"), layout.members("mjData")
    root[kernels.MEMBERS :] = [
        *(model[name].offset for name in kernels.MODEL_MEMBERS),
        *(data[name].offset for name in kernels.DATA_MEMBERS),
    ]
    return {name: address_of_cfunc(function) for name, function in functions.items()}


class _Entries:
    """Surfaces by the hash of what they were made of. Compiled code reads the table; what it may still read is kept."""

    KEPT = 32

    def __init__(self) -> None:
        self.made: OrderedDict[int, SeaSurface] = OrderedDict()
        self.table: Integers = np.zeros(0, dtype=np.int64)
        self._retired: deque[Any] = deque(maxlen=4 * self.KEPT)
        self._publish()

    def add(self, key: int, made: SeaSurface) -> None:
        """Remember a surface; the oldest go."""
        self.made[key] = made
        while len(self.made) > self.KEPT:
            self._retired.append(self.made.popitem(last=False))
        self._publish()

    def _publish(self) -> None:
        slots = 4 * self.KEPT
        fresh = np.zeros(PAIRS + 2 * slots, dtype=np.int64)
        fresh[SLOTS] = slots
        for key, made in self.made.items():
            k = key & (slots - 1)
            while fresh[PAIRS + 2 * k]:
                k = (k + 1) & (slots - 1)
            fresh[PAIRS + 2 * k : PAIRS + 2 * k + 2] = key, made.entry.ctypes.data
        self._retired.append(self.table)
        self.table = fresh
        kernels.root[kernels.TABLE] = fresh.ctypes.data


_entries = _Entries()
_attached: dict[int, SeaSurface] = {}
"""Surfaces of attached models, by the address of their entry."""
_messages: deque[Any] = deque(maxlen=100)
ask_plugin: list[Any] = []
"""The plugin's own way from a model and an instance to a surface: (key, surface)."""


def _answer(model: int, address: int, _unused: int) -> None:
    """Answer a request of compiled code; see `_sea_kernels`."""
    request = (ctypes.c_int64 * kernels.REQUEST).from_address(address)
    try:
        with _lock:
            asked, data = request[kernels.INSTANCE], request[kernels.DATA]
            if asked >= 0:
                key, made = ask_plugin[0](layout.ModelView(model), asked)
                if data:
                    key, made = _prepare_anew(key, made, data)
                request[kernels.KEY], request[kernels.ANSWER] = key, made.entry.ctypes.data
            elif asked == kernels.PREPARE_AGAIN:
                made = _attached[request[kernels.REQUESTED_ENTRY]]
                key, made = _prepare_anew(request[kernels.REQUESTED_ENTRY], made, data)
                request[kernels.KEY], request[kernels.ANSWER] = key, made.entry.ctypes.data
            elif asked == kernels.NEW_STATE:
                made = _attached[request[kernels.REQUESTED_ENTRY]]
                request[kernels.ANSWER] = _new_state(made, data)
            else:
                _warn_of_radiation(layout.ModelView(model), data, request[kernels.REQUESTED_ENTRY])
    except Exception as error:  # nothing may pass through the C code that called
        text = " ".join(str(error).split()) or type(error).__name__
        message = ctypes.create_string_buffer(text.replace("%", "%%").encode())
        _messages.append(message)
        request[kernels.MESSAGE] = ctypes.addressof(message)


def _prepare_anew(key: int, made: SeaSurface, address: int) -> tuple[int, SeaSurface]:
    """The surface for the poses that a state holds, and its hash; the same if the hulls are as they were."""
    count = len(made.bodies)
    offsets = np.zeros((count, 3))
    for n in range(count):
        slot = int(made.entry[kernels.ENTRY + kernels.ROW * n + kernels.SLOT]) + kernels.OFFSET
        offsets[n] = list((ctypes.c_double * 3).from_address(address + 8 * slot))
    if not offsets.any():
        return key, made
    digest = hashlib.sha256(repr(key).encode() + np.round(offsets, 9).tobytes())
    other = int.from_bytes(digest.digest()[:8], "big") >> 12 | 1
    if other not in _entries.made:
        try:
            again = prepared(
                made.bodies,
                made.water,
                made.sea,
                timestep=made.timestep,
                modes=made.modes,
                rests=[rest.moved(*o) for rest, o in zip(made.rests, offsets, strict=True)],
            )
        except MeshError:  # nothing of a hull is wet in its mean pose
            again = made
        _entries.add(other, again)
    return other, _entries.made[other]


WARNINGS = {
    1: "its vertical is {0:.0f} degrees from that in which it floats",
    2: "it moves through the water at {1:.2g} sqrt(g length): it planes",
    3: "it falls into the water at {1:.2g} sqrt(g draft): it slams",
}


def _warn_of_radiation(view: Any, body: int, code: int) -> None:
    """Warn that linear theory ends."""
    what, value = code % 10, (code // 10) / 1000.0
    angle = math.degrees(math.acos(min(max(value, -1.0), 1.0)))
    warnings.warn(
        f"body {body_name(view, body)!r} is where the theory of radiation ends: {WARNINGS[what].format(angle, value)}; added "
        "mass and waves are those of small motions about its pose at rest, see docs/afloat.md",
        MjskipWarning,
        stacklevel=2,
    )


def _new_state(made: SeaSurface, data: int) -> int:
    """Room for the state of attached data, and a table that shows it."""
    if data not in made.states:
        made.states[data] = np.zeros(made.state_size)
        slots = 64
        while slots < 2 * len(made.states):
            slots *= 2
        table = np.zeros(PAIRS + 2 * slots, dtype=np.int64)
        table[SLOTS] = slots
        for owner, state in made.states.items():
            k = (owner >> 4) & (slots - 1)
            while table[PAIRS + 2 * k]:
                k = (k + 1) & (slots - 1)
            table[PAIRS + 2 * k : PAIRS + 2 * k + 2] = owner, state.ctypes.data
        _tables.append(table)
        made.entry[kernels.STATES] = table.ctypes.data
    return int(made.states[data].ctypes.data)


_tables: deque[Any] = deque(maxlen=10000)
"""Tables that a callback in another thread may still be reading."""


def attach_surface(
    bodies: Sequence[FloatingHull], water: Water, sea: Sea, *, timestep: float
) -> SeaSurface:
    """A surface for attached bodies, between `register_surface` and `detach_surface`."""
    compiled()
    return prepared(bodies, water, sea, timestep=timestep)


def register_surface(made: SeaSurface) -> None:
    """Let compiled code ask for states of a surface, calm ones."""
    made.states.clear()
    empty = np.zeros(PAIRS + 4, dtype=np.int64)
    empty[SLOTS] = 2
    _tables.append(empty)
    made.entry[kernels.STATES] = empty.ctypes.data
    with _lock:
        _attached[made.entry.ctypes.data] = made


def detach_surface(made: SeaSurface) -> None:
    """No longer."""
    with _lock:
        _attached.pop(made.entry.ctypes.data, None)


def surface_of(
    bodies: Sequence[FloatingHull], water: Water, sea: Sea, text: str, *, timestep: float
) -> tuple[int, SeaSurface]:
    """The surface of a plugin's instance, prepared now if need be, and its hash; `text` says the sea."""
    digest = hashlib.sha256(repr((water, text, timestep, sea.gravity)).encode())
    for one in bodies:
        digest.update(repr((one.body, one.carried, one.inertia.mass)).encode())
        for part in (one.inertia.centre, one.inertia.tensor, one.rotation, one.place):
            digest.update(np.ascontiguousarray(part).tobytes())
        digest.update(one.hull.vertices.tobytes() + one.hull.faces.tobytes())
    key = int.from_bytes(digest.digest()[:8], "big") >> 12 | 1  # a double holds it
    with _lock:
        if key not in _entries.made:
            compiled()
            _entries.add(key, prepared(bodies, water, sea, timestep=timestep))
        return key, _entries.made[key]


def prepared(
    bodies: Sequence[FloatingHull],
    water: Water,
    sea: Sea,
    *,
    timestep: float,
    rests: Sequence[RestPose] | None = None,
    modes: SurfaceModes | None = None,
) -> SeaSurface:
    """Tables and entry of bodies that float together; by themselves, or in other poses with the modes of before."""
    rests = tuple(rests or (_rest_of(one, water) for one in bodies))
    places = np.array([one.place[:2] for one in bodies])
    modes, surface, packed, tables = prepare(
        [one.hull.triangles for one in bodies],
        rests,
        places,
        sea,
        density=water.density,
        timestep=timestep,
        most_waves=MAX_WAVES,
        most_readings=MAX_READINGS,
        modes=modes,
    )
    dragged = replace(water, buoyancy=False, radiation=False)
    blocks = [pack(one.hull, dragged, gravity=sea.gravity) for one in bodies]
    records = [
        make_record(one.hull, dragged, one.inertia, block)
        for one, block in zip(bodies, blocks, strict=True)
    ]
    room_each = kernels.OWN + MAX_READINGS
    start = afloat_kernels.STATE + 2 * modes.size
    slots = [start + room_each * n for n in range(len(bodies) + 1)]
    room = max(afloat_kernels.scratch_size(surface.block, one.block) for one in packed)
    entry = np.zeros(kernels.ENTRY + kernels.ROW * len(bodies), dtype=np.int64)
    entry[kernels.SURFACE_BLOCK] = surface.block.ctypes.data
    entry[kernels.SURFACE_WORDS] = surface.words.ctypes.data
    entry[kernels.COUNT], entry[kernels.STATE_SIZE] = len(bodies), slots[-1]
    entry[kernels.SCRATCH] = room + 2 * modes.size + 200 + 12 * kernels.MAX_DOFS
    for n, one in enumerate(bodies):
        row = kernels.ENTRY + kernels.ROW * n
        entry[row : row + kernels.ROW] = (
            one.body,
            packed[n].block.ctypes.data,
            packed[n].words.ctypes.data,
            slots[n],
            records[n].ctypes.data,
        )
    return SeaSurface(
        sea=sea,
        water=water,
        modes=modes,
        bodies=tuple(bodies),
        rests=rests,
        tables=tuple(tables),
        entry=entry,
        state_size=slots[-1],
        timestep=timestep,
        kept=(surface, packed, blocks, records),
    )


def _rest_of(one: FloatingHull, water: Water) -> RestPose:
    """How a body floats; where the model has it if it sinks, or is as heavy as its water."""
    top = float((one.hull.vertices @ one.rotation.T)[:, 2].max())
    bottom = float((one.hull.vertices @ one.rotation.T)[:, 2].min())
    here = RestPose.of(one.rotation, float(one.place[2]))
    if one.place[2] + bottom >= 0.0:  # in the air: as it is once it has sunk
        here = RestPose.of(one.rotation, 2.0 * bottom - top)
    if abs(one.carried / (water.density * one.hull.volume) - 1.0) < NEUTRAL:
        return here
    try:
        found = float_at_rest(
            one.hull.triangles, mass=one.carried, density=water.density, rotation=one.rotation
        )
    except SinksError:
        warnings.warn(
            f"body {one.name!r} weighs {one.carried:.4g} kg, and the water it displaces when it is sunk "
            f"{water.density * one.hull.volume:.4g} kg: it sinks, and has the added mass of where the model has it",
            MjskipWarning,
            stacklevel=2,
        )
        return here
    return RestPose.of(found.rotation, found.centre_of_mass)


def plugin_state(model: mujoco.MjModel, data: mujoco.MjData, instance: int) -> Array:
    """State of an instance of the plugin (a view)."""
    start = int(model.plugin_stateadr[instance])
    return np.asarray(data.plugin_state[start : start + int(model.plugin_statenum[instance])])
