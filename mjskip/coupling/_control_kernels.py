"""MuJoCo's control callback, compiled to C by numba: the water's force at every evaluation.

All it knows is in tables of 64-bit words in this process, reached by name, so that the compiled code can be
kept on disk:

    root      address of the force kernel, of the callback that was here before (0: none), of the map,
              offsets of members of mjModel and mjData
    map       number of slots, then pairs (address of a model, address of its entry), open addressing
    entry     attached bodies; address of the model's downward gravity, disabling flags, time step and inverse weights; its
              signature, the size of its buffer and of its names, and the address of a copy of these; what happened:
              calls for models of the same signature, or of the same sizes and names if one has none, that are not
              attached since the last one for this model, failed body (-1: none) and time, body
              whose step was too large (-1: none), time and the step that it needs (doubles' bits);
              a function void(context, model, data) that sets the wrenches instead (0: none), its context;
              address of the entry of bodies that radiate (0: none) and of what acts on them (`_sea_kernels`);
              then for every attached body: id, id of its tree's root, address of its record
              (`_record_kernels`; 0: it radiates), of its offset (0: none)
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
from mjskip._compile.pointers import (
    as_bytes,
    as_doubles,
    as_ints,
    as_words,
    call_address,
    stack_doubles,
    symbol,
)
from mjskip.coupling._record_kernels import SCRATCH, body_state, wet_load
from mjskip.coupling._struct_layout import library

WRENCH, PREVIOUS, MAP, MEMBERS = 0, 1, 2, 3
SLOTS, PAIRS = 0, 1
ATTACHED, GRAVITY, TIMESTEP, INVERSE_WEIGHTS, SIGNATURE = 0, 1, 2, 3, 4
COPY_CALLS, FAILED, FAILURE_TIME, LIMITED, LIMIT_TIME, NEEDED_STEP = 5, 6, 7, 8, 9, 10
INSTEAD, CONTEXT, SEA, SEA_ACT = 11, 12, 13, 14
BUFFER_SIZE, NAMES_SIZE, NAMES, DISABLED = 15, 16, 17, 18
RECORDS = 19
ROW = 4

DATA_MEMBERS = ("xpos", "xmat", "cvel", "subtree_com", "xfrc_applied", "time")
XPOS, XMAT, CVEL, SUBTREE_COM, XFRC_APPLIED, TIME = range(MEMBERS, MEMBERS + len(DATA_MEMBERS))
SIGNATURE_AT = MEMBERS + len(DATA_MEMBERS)
BUFFER_SIZE_AT, NAMES_SIZE_AT, NAMES_AT = SIGNATURE_AT + 1, SIGNATURE_AT + 2, SIGNATURE_AT + 3

empty_map = np.array([1, 0, 0], dtype=np.int64)
root = np.zeros(NAMES_AT + 1, dtype=np.int64)
root[MAP] = empty_map.ctypes.data
_root = symbol("mjskip_control_root", root.ctypes.data)

binding.add_symbol("mj_warning", ctypes.cast(library.mj_warning, ctypes.c_void_p).value)
mj_warning = types.ExternalFunction("mj_warning", types.void(types.int64, types.int32, types.int32))

# MuJoCo's constants, part of its binary interface
WARN_BADQACC = 5
NO_GRAVITY = 1 << 7
WARNED_BODY = 1_000_000  # added to the body's id, where MuJoCo's own warning has a dof


@kernel
def _note_copy(table: Any, models: Any, model: int) -> None:
    """A model that is not attached: say so to the entry of one that it may be a copy of."""
    for k in range(models[SLOTS]):
        if models[PAIRS + 2 * k] != 0:
            entry = as_words(models[PAIRS + 2 * k + 1])
            if _may_be_copy(table, entry, model):
                entry[COPY_CALLS] += 1
                return


@kernel
def _may_be_copy(table: Any, entry: Any, model: int) -> bool:
    """Whether a model has the signature of an attached one; or its sizes and names, where files kept no signature."""
    signature = as_words(model + table[SIGNATURE_AT])[0]
    if signature != 0 and entry[SIGNATURE] != 0:
        same: bool = signature == entry[SIGNATURE]
        return same
    size = entry[NAMES_SIZE]
    if as_words(model + table[BUFFER_SIZE_AT])[0] != entry[BUFFER_SIZE]:
        return False
    if as_words(model + table[NAMES_SIZE_AT])[0] != size:
        return False
    ours, theirs = as_bytes(entry[NAMES]), as_bytes(as_words(model + table[NAMES_AT])[0])
    different = 0
    for i in range(size):
        different |= ours[i] ^ theirs[i]
    return different == 0


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
    if entry[INSTEAD] != 0:
        call_address(entry[INSTEAD], entry[CONTEXT], model, data)
        return
    state = stack_doubles(18 + 12 + SCRATCH)
    load = state + 8 * 18
    scratch = load + 8 * 12
    pose, wrench = as_doubles(state), as_doubles(load)
    gravity = -as_doubles(entry[GRAVITY])[0]
    if as_ints(entry[DISABLED])[0] & NO_GRAVITY != 0:
        gravity = 0.0
    timestep = as_doubles(entry[TIMESTEP])[0]
    weights = as_doubles(entry[INVERSE_WEIGHTS])
    places, axes = as_words(data + table[XPOS])[0], as_words(data + table[XMAT])[0]
    motions, centres = as_words(data + table[CVEL])[0], as_words(data + table[SUBTREE_COM])[0]
    now = as_words(data + table[TIME])[0]
    for n in range(entry[ATTACHED]):
        row = RECORDS + ROW * n
        body, tree, record, offset = entry[row], entry[row + 1], entry[row + 2], entry[row + 3]
        if record == 0:
            continue
        body_state(places, axes, motions, centres + 24 * tree, body, record, state)
        needed = wet_load(
            table[WRENCH], record, state, load, scratch,
            timestep, gravity, weights[2 * body], weights[2 * body + 1],
        )  # fmt: skip
        if needed < needed_step[0]:
            needed_step[0] = needed
            entry[LIMIT_TIME], entry[LIMITED] = now, body
        total = 0.0
        for i in range(12):
            total += wrench[i]
        if not np.isfinite(total):
            mj_warning(data, WARN_BADQACC, WARNED_BODY + body)
            if entry[FAILED] < 0:
                entry[FAILURE_TIME], entry[FAILED] = now, body
            for i in range(12):
                wrench[i] = 0.0
        applied = as_doubles(as_words(data + table[XFRC_APPLIED])[0] + 48 * body)
        for i in range(6):
            applied[i] = wrench[i] + wrench[6 + i]
        if offset != 0:  # MuJoCo applies it at the body's own centre of mass
            away = as_doubles(offset)
            rx = pose[3] * away[0] + pose[4] * away[1] + pose[5] * away[2]
            ry = pose[6] * away[0] + pose[7] * away[1] + pose[8] * away[2]
            rz = pose[9] * away[0] + pose[10] * away[1] + pose[11] * away[2]
            applied[3] += ry * applied[2] - rz * applied[1]
            applied[4] += rz * applied[0] - rx * applied[2]
            applied[5] += rx * applied[1] - ry * applied[0]
    if entry[SEA] != 0:
        call_address(entry[SEA_ACT], model, data, entry[SEA])
