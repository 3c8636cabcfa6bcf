"""MuJoCo's control callback, compiled to C by numba: the water's force at every evaluation.

Only functions of MuJoCo's public C API are called, looked up by name when the code is linked. All it
knows is in tables of 64-bit words in this process, reached by name too, so that the compiled code can
be kept on disk:

    root      address of the force kernel, of the callback that was here before (0: none), of the map,
              offset of the signature in a model (0: not known), a quaternion 1 0 0 0
    map       number of slots, then pairs (address of a model, address of its entry), open addressing
    entry     bodies of the model, attached bodies; address of the model's downward gravity, time step and
              inverse weights; its signature; what happened: calls for models of the same signature that are
              not attached since the last one for this model, failed body (-1: none) and time, body whose step was too large (-1: none), time and the step that it needs (doubles' bits);
              then for every attached body: id, address of its record (`_record_kernels`), of its offset
    offset    doubles: from MuJoCo's centre of mass of the body to the record's (3), body axes

The callback keeps no clock and no state: MuJoCo calls it at every sub-stage of RK4, from any thread. The
map is never changed in place: a new one is made and its address stored in the root.
"""

import ctypes
from typing import Any

import numpy as np
from llvmlite import binding
from numba import types

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, as_words, call_address, stack_doubles, symbol
from mjskip.coupling._record_kernels import CENTRE, SCRATCH, wet_load
from mjskip.coupling._struct_layout import library

WRENCH, PREVIOUS, MAP, SIGNATURE_AT, IDENTITY = 0, 1, 2, 3, 4
SLOTS, PAIRS = 0, 1
NBODY, ATTACHED, GRAVITY, TIMESTEP, INVERSE_WEIGHTS, SIGNATURE = 0, 1, 2, 3, 4, 5
COPY_CALLS, FAILED, FAILURE_TIME, LIMITED, LIMIT_TIME, NEEDED_STEP = 6, 7, 8, 9, 10, 11
RECORDS = 12
ROW = 3

empty_map = np.array([1, 0, 0], dtype=np.int64)
upright = np.array([1.0, 0.0, 0.0, 0.0])
root = np.array([0, 0, empty_map.ctypes.data, 0, upright.ctypes.data], dtype=np.int64)
_root = symbol("mjskip_control_root", root.ctypes.data)

i4, i8, u1 = types.int32, types.int64, types.uint8


def _api(name: str, *signature: types.Type) -> types.ExternalFunction:
    """A void function of MuJoCo's C API; pointers are passed as int64."""
    binding.add_symbol(name, ctypes.cast(getattr(library, name), ctypes.c_void_p).value)
    return types.ExternalFunction(name, types.void(*signature))


mj_getState = _api("mj_getState", i8, i8, i8, i4)
mj_setState = _api("mj_setState", i8, i8, i8, i4)
mj_local2Global = _api("mj_local2Global", i8, i8, i8, i8, i8, i4, u1)
mj_objectVelocity = _api("mj_objectVelocity", i8, i8, i4, i4, i8, i4)
mj_warning = _api("mj_warning", i8, i4, i4)

# MuJoCo's constants, part of its binary interface
OBJ_BODY = 1
STATE_TIME = 1
STATE_XFRC_APPLIED = 256
WARN_BADQACC = 5
WARNED_BODY = 1_000_000  # added to the body's id, where MuJoCo's own warning has a dof


@kernel
def _note_copy(table: Any, models: Any, model: int) -> None:
    """A model that is not attached: say so to the entry of one that it may be a copy of."""
    at = table[SIGNATURE_AT]
    if at == 0:
        return
    signature = as_words(model + at)[0]
    for k in range(models[SLOTS]):
        if (
            models[PAIRS + 2 * k] != 0
            and as_words(models[PAIRS + 2 * k + 1])[SIGNATURE] == signature
        ):
            as_words(models[PAIRS + 2 * k + 1])[COPY_CALLS] += 1
            return


@kernel
def _move(pose: Any, wrench: Any, away: Any, moving: Any) -> None:
    """Velocity of the centre of mass of welded bodies, from that of the body's own."""
    rx = pose[3] * away[0] + pose[4] * away[1] + pose[5] * away[2]
    ry = pose[6] * away[0] + pose[7] * away[1] + pose[8] * away[2]
    rz = pose[9] * away[0] + pose[10] * away[1] + pose[11] * away[2]
    wrench[0], wrench[1], wrench[2] = rx, ry, rz
    pose[12] += moving[1] * rz - moving[2] * ry
    pose[13] += moving[2] * rx - moving[0] * rz
    pose[14] += moving[0] * ry - moving[1] * rx


def control(model: int, data: int) -> None:
    """mjcb_control: assign the wrench of water and air to xfrc_applied of every attached body."""
    table = as_words(_root())
    if table[PREVIOUS] != 0:
        call_address(table[PREVIOUS], model, data, 0)  # C ignores the third argument
    models = as_words(table[MAP])
    slots = models[SLOTS]
    k = (model >> 4) % slots
    while models[PAIRS + 2 * k] != model:
        if models[PAIRS + 2 * k] == 0:
            _note_copy(table, models, model)
            return
        k = (k + 1) % slots
    place = models[PAIRS + 2 * k + 1]
    entry, needed_step = as_words(place), as_doubles(place + 8 * NEEDED_STEP)
    entry[COPY_CALLS] = 0
    size = 6 * entry[NBODY]
    xfrc = stack_doubles(size + 6 + 18 + 12 + 4 + SCRATCH)
    velocity = xfrc + 8 * size
    state = velocity + 8 * 6
    load = state + 8 * 18
    lever = load + 8 * 12
    scratch = lever + 8 * 4
    applied, moving, pose = as_doubles(xfrc), as_doubles(velocity), as_doubles(state)
    wrench, arm = as_doubles(load), as_doubles(lever)
    gravity = -as_doubles(entry[GRAVITY])[0]
    timestep = as_doubles(entry[TIMESTEP])[0]
    weights = as_doubles(entry[INVERSE_WEIGHTS])
    mj_getState(model, data, xfrc, STATE_XFRC_APPLIED)
    for n in range(entry[ATTACHED]):
        row = RECORDS + ROW * n
        body, record, offset = entry[row], entry[row + 1], entry[row + 2]
        mj_local2Global(data, state, state + 8 * 3, record + 8 * CENTRE, table[IDENTITY], body, 0)
        mj_objectVelocity(model, data, OBJ_BODY, body, velocity, 0)
        for i in range(3):  # MuJoCo puts the angular velocity first
            pose[12 + i] = moving[3 + i]
            pose[15 + i] = moving[i]
        if offset != 0:
            _move(pose, arm, as_doubles(offset), moving)
        needed = wet_load(
            table[WRENCH], record, state, load, scratch,
            timestep, gravity, weights[2 * body], weights[2 * body + 1],
        )  # fmt: skip
        if needed < needed_step[0]:
            needed_step[0] = needed
            mj_getState(model, data, velocity, STATE_TIME)
            entry[LIMIT_TIME] = as_words(velocity)[0]
            entry[LIMITED] = body
        total = 0.0
        for i in range(12):
            total += wrench[i]
        if not np.isfinite(total):
            mj_warning(data, WARN_BADQACC, WARNED_BODY + body)
            if entry[FAILED] < 0:
                mj_getState(model, data, velocity, STATE_TIME)
                entry[FAILURE_TIME] = as_words(velocity)[0]
                entry[FAILED] = body
            for i in range(12):
                wrench[i] = 0.0
        for i in range(6):
            applied[6 * body + i] = wrench[i] + wrench[6 + i]
        if offset != 0:  # MuJoCo applies it at the body's own centre of mass
            at = 6 * body
            applied[at + 3] += arm[1] * applied[at + 2] - arm[2] * applied[at + 1]
            applied[at + 4] += arm[2] * applied[at] - arm[0] * applied[at + 2]
            applied[at + 5] += arm[0] * applied[at + 1] - arm[1] * applied[at]
    mj_setState(model, data, xfrc, STATE_XFRC_APPLIED)
