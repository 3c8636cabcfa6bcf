"""Bodies that radiate inside MuJoCo, compiled to C by numba: what `attach` and the plugin call for them.

Bodies of one plugin instance, or of one `attach`, share one surface. The amplitudes of its waves are the plugin's state in
MjData, so that copies, rollouts and batches go on from it bit for bit; `attach` has no place there and keeps them in
this process, by the address of the data. What bodies and sea are made of lives in *entries* of this process, found
by a hash that the state holds too; a hash that nobody knows here is asked for in Python, which prepares it.

    root      addresses of the force kernel, of the builder, of the table; offsets of gravity and time step in mjModel, and
              of members of mjModel and mjData
    table     number of slots, then pairs (hash, address of an entry)
    entry     addresses of the surface's block and ring starts; bodies; doubles of scratch; states of attached data
              (a table: data, address of its state); then for every body: id, addresses of its block and of its ring
              numbers, place in the state, address of its record for drag (`_record_kernels`)

MuJoCo calls `advance` once after each step, when poses are stale. So it only notes that a step is due: the surface is
stepped at the next evaluation, with the poses and velocities that the step led to. Added mass is added to MuJoCo's
own mass matrix, which is factored again: constraints, actuators and integrators then know of it.
"""

import ctypes
import math
from typing import Any

import numba
import numpy as np
from llvmlite import binding
from numba import types

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import (
    as_doubles,
    as_words,
    call_address,
    stack_doubles,
    symbol,
)
from mjskip.coupling._record_kernels import CENTRE, NEEDED_STEP, wet_load
from mjskip.coupling._record_kernels import SCRATCH as RECORD_SCRATCH
from mjskip.coupling._struct_layout import library
from mjskip.coupling._table_kernels import (
    PAIRS,
    SLOTS,
    add_generalised_force,
    doubles,
    ints,
    last_dof,
    look_up,
    mj_warning,
    mju_error,
)
from mjskip.hydro import _afloat_kernels as afloat

WRENCH, BUILDER, TABLE, GRAVITY, TIMESTEP, MEMBERS = 0, 1, 2, 3, 4, 5
INSTANCE, DATA, REQUESTED_ENTRY, ANSWER, KEY, MESSAGE, REQUEST = 0, 1, 2, 3, 4, 5, 6
"""A request: the entry of a plugin's instance for the state at an address (0: as bodies float by themselves), or with one
of the numbers below as instance."""
NEW_STATE, PREPARE_AGAIN, WARNING = -1, -2, -3
"""The state of attached data; the entry of attached bodies for a state; to say that a body is where the theory ends."""
SURFACE_BLOCK, SURFACE_WORDS, COUNT, SCRATCH, STATES, STATE_SIZE, WARNED, ENTRY = range(8)
BODY, BLOCK, WORDS, SLOT, RECORD, ROW = 0, 1, 2, 3, 4, 5

MODEL_MEMBERS = (
    "body_rootid", "body_parentid", "body_dofnum", "body_dofadr", "dof_parentid",
    "M_rownnz", "M_rowadr", "M_colind", "plugin_stateadr", "body_invweight0",
)  # fmt: skip
(
    BODY_ROOTID, BODY_PARENTID, BODY_DOFNUM, BODY_DOFADR, DOF_PARENTID,
    M_ROWNNZ, M_ROWADR, M_COLIND, PLUGIN_STATEADR, BODY_INVWEIGHT0,
) = range(MEMBERS, MEMBERS + len(MODEL_MEMBERS))  # fmt: skip
DATA_MEMBERS = (
    "xpos", "xmat", "cvel", "cdof", "subtree_com", "qfrc_passive", "qvel", "M", "plugin_state", "time",
)  # fmt: skip
XPOS, XMAT, CVEL, CDOF, SUBTREE_COM, QFRC_PASSIVE, QVEL, M, PLUGIN_STATE, TIME = range(
    MEMBERS + len(MODEL_MEMBERS), MEMBERS + len(MODEL_MEMBERS) + len(DATA_MEMBERS)
)

DRAFT_SHARE, STEEP = 0.25, 0.15
"""A hull is prepared again when its mean height has changed by this share of its draft, or its mean roll or pitch by this
angle [rad]."""
DRAFT_STEP, ANGLE_STEP = 0.05, 0.02
"""Poses that hulls are prepared for are multiples of these (shares of the draft, rad)."""
MEMORY = 20.0
"""Time over which a mean pose is taken, in sqrt(length / 2 g)."""
CAPSIZE, PLANING, SLAMMING = 0.8, 0.5, 1.0
"""Linear theory ends about here: cosine of the heel, speed over sqrt(g length), rate of fall over sqrt(g draft)."""
MAX_DOFS = 64
"""Degrees of freedom between a floating body and the world that know of its added mass."""

WARN_BADQACC = 5
WARNED_BODY = 1_000_000  # added to the body's id, where MuJoCo's own warning has a dof

root = np.zeros(MEMBERS + len(MODEL_MEMBERS) + len(DATA_MEMBERS), dtype=np.int64)
_root = symbol("mjskip_sea_root", root.ctypes.data)

binding.add_symbol("mj_factorM", ctypes.cast(library.mj_factorM, ctypes.c_void_p).value)
mj_factor_m = types.ExternalFunction("mj_factorM", types.void(types.int64, types.int64))

# a body's part of the state, before its readings
LAST_DIAGONAL = 0  # of its first dof in M, after the added mass was added
LAST_VELOCITY = 1  # of its last six dofs (6)
ACCELERATION = 7  # of them over the last step (6)
LOAD = 13  # force and torque on it at the last evaluation (6)
MOVED = 19  # 1 once its last velocity is known
MEAN = (
    20  # its height, roll and pitch from the pose that its hull is prepared for, over some time (3)
)
OFFSET = 23  # that pose from the one in which it floats by itself: height [m], roll, pitch (3)
WEIGHT = 26  # how much of it radiated at the last evaluation
WEIGHT_BEFORE = 27  # and a step before
OWN = 28


@kernel
def _request_python(table: Any, model: int, instance: int, request: int) -> Any:
    """Ask Python what a request is about."""
    words = as_words(request)
    words[INSTANCE], words[ANSWER], words[KEY], words[MESSAGE] = instance, 0, 0, 0
    call_address(table[BUILDER], model, request, 0)
    if words[MESSAGE] != 0:
        mju_error(words[MESSAGE])  # does not return
    return words[ANSWER]


@kernel
def _pose(table: Any, model: int, data: int, body: int, record: Any, state: Any) -> None:
    """State (18) of a body about its record's centre of mass, world."""
    place, rotation = doubles(table, data, XPOS), doubles(table, data, XMAT)
    moving, origin = doubles(table, data, CVEL), doubles(table, data, SUBTREE_COM)
    tree = ints(table, model, BODY_ROOTID)[body]
    for i in range(9):
        state[3 + i] = rotation[9 * body + i]
    cx, cy, cz = record[CENTRE], record[CENTRE + 1], record[CENTRE + 2]
    for i in range(3):
        state[i] = place[3 * body + i] + (
            state[3 + 3 * i] * cx + state[4 + 3 * i] * cy + state[5 + 3 * i] * cz
        )
    wx, wy, wz = moving[6 * body], moving[6 * body + 1], moving[6 * body + 2]
    rx, ry, rz = (
        state[0] - origin[3 * tree],
        state[1] - origin[3 * tree + 1],
        state[2] - origin[3 * tree + 2],
    )
    state[12] = moving[6 * body + 3] + (wy * rz - wz * ry)
    state[13] = moving[6 * body + 4] + (wz * rx - wx * rz)
    state[14] = moving[6 * body + 5] + (wx * ry - wy * rx)
    state[15], state[16], state[17] = wx, wy, wz


@kernel
def _last_dof(table: Any, model: int, body: int) -> int:
    """The last degree of freedom that moves a body, -1 if there is none."""
    count, parent = ints(table, model, BODY_DOFNUM), ints(table, model, BODY_PARENTID)
    return last_dof(count, parent, ints(table, model, BODY_DOFADR), body)


@kernel
def _push(table: Any, model: int, data: int, body: int, pose: Any, load: Any) -> None:
    """qfrc_passive += J'w: force and torque (6) about the body's centre of mass, on every dof that moves it."""
    fx, fy, fz = load[0], load[1], load[2]
    tree = 3 * ints(table, model, BODY_ROOTID)[body]
    origin = doubles(table, data, SUBTREE_COM)  # about which MuJoCo keeps the motion of a tree
    rx, ry, rz = pose[0] - origin[tree], pose[1] - origin[tree + 1], pose[2] - origin[tree + 2]
    tx = load[3] + (ry * fz - rz * fy)
    ty = load[4] + (rz * fx - rx * fz)
    tz = load[5] + (rx * fy - ry * fx)
    dof = _last_dof(table, model, body)
    above, axis = ints(table, model, DOF_PARENTID), doubles(table, data, CDOF)
    out = doubles(table, data, QFRC_PASSIVE)
    add_generalised_force(dof, above, axis, out, fx, fy, fz, tx, ty, tz)


@kernel
def _add_mass(
    table: Any, model: int, data: int, body: int, block: Any, yaw: float, weight: float, pose: Any, own: Any, columns: Any
) -> bool:  # fmt: skip
    """M += J'AJ over the dofs that move a body; whether M was changed.

    MuJoCo keeps a lone centred body's M as a diagonal: what has no place there acts as a force with the acceleration of
    the last step. M may be what an earlier call left (mj_forwardSkip): then its first diagonal is what that call noted.
    """
    last = _last_dof(table, model, body)
    if last < 0 or weight == 0.0:
        own[LAST_DIAGONAL] = 0.0
        return False
    above, axis = ints(table, model, DOF_PARENTID), doubles(table, data, CDOF)
    origin = doubles(table, data, SUBTREE_COM)
    tree = 3 * ints(table, model, BODY_ROOTID)[body]
    rx, ry, rz = pose[0] - origin[tree], pose[1] - origin[tree + 1], pose[2] - origin[tree + 2]
    c, s = math.cos(yaw), math.sin(yaw)
    # Jacobian's columns in the level frame, and A times them
    count, dof = 0, last
    while dof >= 0 and count < MAX_DOFS:
        k, at = 6 * dof, 12 * count
        wx, wy, wz = axis[k], axis[k + 1], axis[k + 2]
        vx = axis[k + 3] + wy * rz - wz * ry
        vy = axis[k + 4] + wz * rx - wx * rz
        columns[at], columns[at + 1] = c * vx + s * vy, c * vy - s * vx
        columns[at + 2] = axis[k + 5] + wx * ry - wy * rx
        columns[at + 3], columns[at + 4], columns[at + 5] = c * wx + s * wy, c * wy - s * wx, wz
        for i in range(6):
            total = 0.0
            for j in range(6):
                total += block[afloat.ADDED + 6 * i + j] * columns[at + j]
            columns[at + 6 + i] = weight * weight * total
        count += 1
        dof = above[dof]
    full, number, start = (
        doubles(table, data, M),
        ints(table, model, M_ROWNNZ),
        ints(table, model, M_ROWADR),
    )
    place, force = ints(table, model, M_COLIND), doubles(table, data, QFRC_PASSIVE)
    diagonal = start[last] + number[last] - 1
    already = full[diagonal] == own[LAST_DIAGONAL]
    row, i = 0, last
    while i >= 0 and row < count:
        other, j = row, i
        while j >= 0 and other < count:
            value = 0.0
            for n in range(6):
                value += columns[12 * row + n] * columns[12 * other + 6 + n]
            found = False
            for n in range(start[i], start[i] + number[i]):
                if place[n] == j:
                    found = True
                    if not already:
                        full[n] += value
            if not found and last - j < 6:
                force[i] -= value * own[ACCELERATION + 5 - (last - j)]
                force[j] -= value * own[ACCELERATION + 5 - (last - i)]
            other += 1
            j = above[j]
        row += 1
        i = above[i]
    own[LAST_DIAGONAL] = full[diagonal]
    return not already


@kernel
def _note_acceleration(table: Any, model: int, data: int, body: int, own: Any, step: float) -> None:
    """Acceleration of a body's last six dofs over a step, for the terms that M has no place for."""
    last, speed = _last_dof(table, model, body), doubles(table, data, QVEL)
    for n in range(min(6, last + 1)):
        now = speed[last - n]
        if own[MOVED] != 0.0:
            own[ACCELERATION + 5 - n] = (now - own[LAST_VELOCITY + 5 - n]) / step
        own[LAST_VELOCITY + 5 - n] = now
    own[MOVED] = 1.0


@kernel
def _note_pose(block: Any, pose: Any, own: Any, step: float, gravity: float) -> bool:
    """Follow a body's mean pose; whether it has left the one that its hull is prepared for. Then it has another."""
    roll, pitch, _ = afloat.tilt(block, pose)
    draft = block[afloat.DRAFT]
    share = min(step / (MEMORY * math.sqrt(0.5 * block[afloat.LENGTH] / gravity)), 1.0)
    own[MEAN] += share * (pose[2] - block[afloat.REST_HEIGHT] - own[MEAN])
    own[MEAN + 1] += share * (roll - own[MEAN + 1])
    own[MEAN + 2] += share * (pitch - own[MEAN + 2])
    if (
        abs(own[MEAN]) < DRAFT_SHARE * draft
        and abs(own[MEAN + 1]) < STEEP
        and abs(own[MEAN + 2]) < STEEP
    ):
        return False
    for i in range(3):
        unit = DRAFT_STEP * draft if i == 0 else ANGLE_STEP
        own[OFFSET + i] += unit * math.floor(own[MEAN + i] / unit + 0.5)
        own[MEAN + i] = 0.0
    return True


@kernel
def _forget_readings(entry: Any, at: int) -> None:
    """Of hulls that were prepared again: their patterns are others."""
    state = as_doubles(at)
    for n in range(entry[COUNT]):
        start = entry[ENTRY + ROW * n + SLOT] + OWN
        end = entry[STATE_SIZE] if n + 1 == entry[COUNT] else entry[ENTRY + ROW * (n + 1) + SLOT]
        for i in range(start, end):
            state[i] = 0.0


@kernel
def _step(table: Any, model: int, data: int, entry: Any, at: int, scratch: int) -> bool:
    """Make up for a step of the surface, with the poses and velocities that it led to.

    Returns:
        Whether a hull is to be prepared again.
    """
    surface = numba.carray(as_doubles(entry[SURFACE_BLOCK]), 1 << 40)
    state = numba.carray(as_doubles(at), 1 << 40)
    waves = int(surface[afloat.WAVES])
    first = numba.carray(as_words(entry[SURFACE_WORDS]), int(surface[afloat.RINGS]) + 1)
    added = numba.carray(as_doubles(scratch), 2 * waves)
    room = numba.carray(as_doubles(scratch + 8 * (2 * waves + 18)), 1 << 40)
    pose = numba.carray(as_doubles(scratch + 8 * 2 * waves), 18)
    now = as_doubles(data + table[TIME])[0]
    step = now - state[afloat.TIME]
    if abs(step - surface[afloat.TIMESTEP]) < 1e-9 * surface[afloat.TIMESTEP] + 1e-15 * abs(now):
        step = surface[afloat.TIMESTEP]
    added[:] = 0.0
    x = y = 0.0
    again = False
    for n in range(entry[COUNT]):
        row = ENTRY + ROW * n
        block = numba.carray(as_doubles(entry[row + BLOCK]), 1 << 40)
        rings = int(block[afloat.RINGS_OF])
        parts = numba.carray(as_words(entry[row + WORDS]), 3 * rings).reshape((3, rings))
        _pose(table, model, data, entry[row + BODY], as_doubles(entry[row + RECORD]), pose)
        x += pose[0] / entry[COUNT]
        y += pose[1] / entry[COUNT]
        own = state[entry[row + SLOT] : entry[row + SLOT] + OWN]
        _note_acceleration(table, model, data, entry[row + BODY], own, step)
        if own[WEIGHT] > 0.0:
            again |= _note_pose(block, pose, own, step, surface[afloat.GRAVITY])
        own[WEIGHT_BEFORE] = own[WEIGHT]
        if own[WEIGHT] > 0.0:
            afloat.push_waves(
                surface, block, state, entry[row + SLOT] + OWN, pose, own[WEIGHT], parts, first, room, added
            )  # fmt: skip
    afloat.step_waves(surface, state, x, y, step, room, added)
    state[afloat.TIME], state[afloat.PENDING] = now, 0.0
    return again


@kernel
def _state(table: Any, model: int, data: int, instance: int) -> Any:
    """Address of an instance's state."""
    at = 8 * ints(table, model, PLUGIN_STATEADR)[instance]
    return as_words(data + table[PLUGIN_STATE])[0] + at


@kernel
def _entry_of(table: Any, model: int, data: int, instance: int, at: int) -> Any:
    """Address of the entry of an instance with this state."""
    header = as_doubles(at)
    address = (
        look_up(table[TABLE], int(header[afloat.FRESH]), 0) if header[afloat.FRESH] != 0.0 else 0
    )
    if address == 0:
        request = stack_doubles(REQUEST)
        as_words(request)[DATA] = at
        address = _request_python(table, model, instance, request)
        if header[afloat.FRESH] == 0.0:
            header[afloat.TIME] = as_doubles(data + table[TIME])[0]
            header[afloat.PENDING] = 0.0
        header[afloat.FRESH] = float(as_words(request)[KEY])
    return address


def advance(model: int, data: int, instance: int) -> None:
    """A step was taken."""
    state = as_doubles(_state(as_words(_root()), model, data, instance))
    state[afloat.PENDING] = 1.0


def act(model: int, data: int, instance: int) -> None:
    """Force of the water on every body of an instance, its added mass, and steps of the surface that are due."""
    table = as_words(_root())
    at = _state(table, model, data, instance)
    entry = as_words(_entry_of(table, model, data, instance, at))
    scratch = stack_doubles(entry[SCRATCH])
    if as_doubles(at)[afloat.PENDING] != 0.0 and _step(table, model, data, entry, at, scratch):
        request = stack_doubles(REQUEST)
        as_words(request)[DATA] = at
        entry = as_words(_request_python(table, model, instance, request))
        as_doubles(at)[afloat.FRESH] = float(as_words(request)[KEY])
        _forget_readings(entry, at)
        scratch = stack_doubles(entry[SCRATCH])
    _act(table, model, data, entry, at, scratch)


@kernel
def _request_again(table: Any, model: int, address: int, at: int) -> Any:
    """The entry of attached bodies for the poses that a state holds; it is noted there."""
    request = stack_doubles(REQUEST)
    words = as_words(request)
    words[DATA], words[REQUESTED_ENTRY] = at, address
    found = _request_python(table, model, PREPARE_AGAIN, request)
    as_doubles(at)[afloat.FRESH] = float(words[KEY])
    return found


@kernel
def _request_warning(
    table: Any, model: int, entry: Any, surface: Any, block: Any, pose: Any, body: int
) -> None:
    """Say once of an entry that a body is where linear theory ends."""
    _, _, cosine = afloat.tilt(block, pose)
    u, v = pose[12] - surface[afloat.CURRENT_X], pose[13] - surface[afloat.CURRENT_Y]
    speed = math.sqrt((u * u + v * v) / (surface[afloat.GRAVITY] * block[afloat.LENGTH]))
    fall = -pose[14] / math.sqrt(surface[afloat.GRAVITY] * block[afloat.DRAFT])
    near = pose[2] < block[afloat.REST_HEIGHT] + block[afloat.DRAFT]
    what, value = 0, 0.0
    if cosine < CAPSIZE:
        what, value = 1, cosine
    elif near and speed > PLANING:
        what, value = 2, speed
    elif near and fall > SLAMMING:
        what, value = 3, fall
    if what == 0:
        return
    entry[WARNED] = 1
    request = stack_doubles(REQUEST)
    words = as_words(request)
    words[DATA], words[REQUESTED_ENTRY] = body, what + 10 * int(1000.0 * value)
    _request_python(table, model, WARNING, request)


def act_attached(model: int, data: int, address: int) -> None:
    """The same for bodies of an entry that were attached; a step is due when the time is one step later.

    Time that jumps, as a reset does or a state that was set, is calm water again.
    """
    table = as_words(_root())
    entry = as_words(address)
    states = as_words(entry[STATES])
    slots = states[SLOTS]
    k = (data >> 4) & (slots - 1)
    while states[PAIRS + 2 * k] != 0 and states[PAIRS + 2 * k] != data:
        k = (k + 1) & (slots - 1)
    at = states[PAIRS + 2 * k + 1]
    if states[PAIRS + 2 * k] != data:
        request = stack_doubles(REQUEST)
        as_words(request)[DATA], as_words(request)[REQUESTED_ENTRY] = data, address
        at = _request_python(table, model, NEW_STATE, request)
    header = as_doubles(at)
    now, step = as_doubles(data + table[TIME])[0], as_doubles(model + table[TIMESTEP])[0]
    late = now - header[afloat.TIME]
    if header[afloat.FRESH] == 0.0 or late < 0.0 or late > 1.5 * step:
        for i in range(entry[STATE_SIZE]):
            header[i] = 0.0
        header[afloat.FRESH], header[afloat.TIME] = 1.0, now
    if header[afloat.FRESH] != 1.0:  # prepared again since it was attached
        other = look_up(table[TABLE], int(header[afloat.FRESH]), 0)
        if other == 0:
            other = _request_again(table, model, address, at)
        entry = as_words(other)
    scratch = stack_doubles(entry[SCRATCH])
    if (1.0 - 1e-6) * step <= now - header[afloat.TIME] and _step(
        table, model, data, entry, at, scratch
    ):
        entry = as_words(_request_again(table, model, address, at))
        _forget_readings(entry, at)
        scratch = stack_doubles(entry[SCRATCH])
    _act(table, model, data, entry, at, scratch)


def sense(model: int, data: int, out: int) -> None:
    """Force and torque (6) that acted last on a body; a request of `_plugin_kernels` lies behind `out` (12)."""
    table = as_words(_root())
    request, wrench = as_words(out + 8 * 12), as_doubles(out)
    body, instance = request[1], request[2]
    at = _state(table, model, data, instance)
    entry = as_words(_entry_of(table, model, data, instance, at))
    for n in range(entry[COUNT]):
        row = ENTRY + ROW * n
        if entry[row + BODY] == body:
            for i in range(6):
                wrench[i] = as_doubles(at)[entry[row + SLOT] + LOAD + i]
                wrench[6 + i] = 0.0


@kernel
def _act(table: Any, model: int, data: int, entry: Any, at: int, scratch: int) -> None:
    """Forces and added masses of all bodies."""
    surface = numba.carray(as_doubles(entry[SURFACE_BLOCK]), 1 << 40)
    state = numba.carray(as_doubles(at), 1 << 40)
    first = numba.carray(as_words(entry[SURFACE_WORDS]), int(surface[afloat.RINGS]) + 1)
    pose = numba.carray(as_doubles(scratch), 18)
    through = numba.carray(as_doubles(scratch + 8 * 18), 18)
    drag = numba.carray(as_doubles(scratch + 8 * 36), 12)
    load = numba.carray(as_doubles(scratch + 8 * 48), 6)
    water = numba.carray(as_doubles(scratch + 8 * 54), 4)
    columns = numba.carray(as_doubles(scratch + 8 * 58), 12 * MAX_DOFS)
    spare = scratch + 8 * (58 + 12 * MAX_DOFS)
    room = numba.carray(as_doubles(spare + 8 * RECORD_SCRATCH), 1 << 40)
    now = as_doubles(data + table[TIME])[0]
    keep = now == state[afloat.TIME]
    weights = doubles(table, model, BODY_INVWEIGHT0)
    changed = False
    for n in range(entry[COUNT]):
        row = ENTRY + ROW * n
        body, slot, known = entry[row + BODY], entry[row + SLOT], as_doubles(entry[row + RECORD])
        block = numba.carray(as_doubles(entry[row + BLOCK]), 1 << 40)
        rings = int(block[afloat.RINGS_OF])
        parts = numba.carray(as_words(entry[row + WORDS]), 3 * rings).reshape((3, rings))
        own = state[slot : slot + OWN]
        begins = own[MOVED] == 0.0
        if begins:
            _note_acceleration(table, model, data, body, own, 1.0)
        _pose(table, model, data, body, known, pose)
        if entry[WARNED] == 0:
            _request_warning(table, model, entry, surface, block, pose, body)
        load[:] = 0.0
        weight = afloat.body_force(
            surface, block, state, slot + OWN, pose, now, keep, parts, first, room, load
        )
        if keep:
            own[WEIGHT] = weight
        if begins:
            own[WEIGHT_BEFORE] = weight
        rate = (weight * weight - own[WEIGHT_BEFORE] * own[WEIGHT_BEFORE]) / as_doubles(
            model + table[TIMESTEP]
        )[0]
        if rate > 0.0:
            afloat.add_impact(surface, block, pose, rate, load)
        # drag, against the water that moves around the body's middle
        afloat.water_at(surface, pose[0], pose[1], pose[2], now, room, water)
        through[:] = pose
        through[2] -= water[0]
        for i in range(3):
            through[12 + i] -= water[1 + i]
        needed = wet_load(
            table[WRENCH], entry[row + RECORD], scratch + 8 * 18, scratch + 8 * 36, spare,
            as_doubles(model + table[TIMESTEP])[0], -as_doubles(model + table[GRAVITY])[2],
            weights[2 * body], weights[2 * body + 1],
        )  # fmt: skip
        known[NEEDED_STEP] = min(known[NEEDED_STEP], needed)
        total = 0.0
        for i in range(6):
            load[i] += drag[i] + drag[6 + i]
            total += load[i]
        if not np.isfinite(total):
            mj_warning(data, WARN_BADQACC, WARNED_BODY + body)
            continue
        own[LOAD : LOAD + 6] = load
        _push(table, model, data, body, pose, load)
        yaw = afloat.heading(block, pose)
        changed |= _add_mass(table, model, data, body, block, yaw, weight, pose, own, columns)
    if changed:
        mj_factor_m(model, data)
