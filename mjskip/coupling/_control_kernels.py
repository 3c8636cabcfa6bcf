"""MuJoCo's control callback, compiled to C by numba: the water's force at every evaluation.

Only functions of MuJoCo's public C API are called, looked up by name when the code is linked. All it
knows is in tables of 64-bit words in this process, reached by name too, so that the compiled code can
be kept on disk:

    root      address of the wrench kernel, of the callback that was here before (0: none), of the map
    map       number of slots, then pairs (address of a model, address of its entry), open addressing
    entry     bodies of the model, attached bodies, failed body (-1: none), its time (a double's bits),
              a function void(context, model, data) that sets the wrenches instead (0: none), its context,
              then for every attached body: id, address of its frame, address of its block
    frame     doubles: centre of mass in the body (3), quaternion 1 0 0 0

The callback keeps no clock and no state: MuJoCo calls it at every sub-stage of RK4, from any thread. The
map is never changed in place: a new one is made and its address stored in the root.
"""

import ctypes
from pathlib import Path

import mujoco
import numpy as np
from llvmlite import binding
from numba import types

from mjskip._compile.pointers import as_doubles, as_words, call_address, stack_doubles, symbol

WRENCH, PREVIOUS, MAP = 0, 1, 2
SLOTS, PAIRS = 0, 1
NBODY, ATTACHED, FAILED, FAILURE_TIME, INSTEAD, CONTEXT, RECORDS = 0, 1, 2, 3, 4, 5, 6
RECORD = 3

empty_map = np.array([1, 0, 0], dtype=np.int64)
root = np.array([0, 0, empty_map.ctypes.data], dtype=np.int64)
_root = symbol("mjskip_control_root", root.ctypes.data)

library = ctypes.CDLL(str(next(Path(mujoco.__file__).parent.glob("libmujoco.*"))))
"""The shared object that MuJoCo's bindings have already loaded."""

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
            return  # a stranger's model
        k = (k + 1) % slots
    entry = as_words(models[PAIRS + 2 * k + 1])
    if entry[INSTEAD] != 0:
        call_address(entry[INSTEAD], entry[CONTEXT], model, data)
        return
    size = 6 * entry[NBODY]
    xfrc = stack_doubles(size + 36)
    velocity = xfrc + 8 * size
    state = velocity + 8 * 6
    load = state + 8 * 18
    applied, moving, pose, wrench = (
        as_doubles(xfrc),
        as_doubles(velocity),
        as_doubles(state),
        as_doubles(load),
    )
    mj_getState(model, data, xfrc, STATE_XFRC_APPLIED)
    for n in range(entry[ATTACHED]):
        record = RECORDS + RECORD * n
        body, frame, block = entry[record], entry[record + 1], entry[record + 2]
        mj_local2Global(data, state, state + 8 * 3, frame, frame + 8 * 3, body, 0)
        mj_objectVelocity(model, data, OBJ_BODY, body, velocity, 0)
        for i in range(3):  # MuJoCo puts the angular velocity first
            pose[12 + i] = moving[3 + i]
            pose[15 + i] = moving[i]
        call_address(table[WRENCH], block, state, load)
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
    mj_setState(model, data, xfrc, STATE_XFRC_APPLIED)
