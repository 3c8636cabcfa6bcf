"""Engine plugin mjskip.water, compiled to C by numba: force on bodies, and sensors.

The plugin keeps nothing in MjData. At every call a body's content (its geoms, its inertial frame, the
text of its configuration) is hashed, and the hash finds the *block* that the force kernel knows the
body by in a table of this process. So it does not matter which model, copy of a model or data comes, from
which thread, or whether a model lives where another was freed. A content that is new is handed to
Python, which builds its block; that happens when MjData is made, or when somebody alters a model.

    root      addresses of the force and immersion kernels, of the builder and of the table; offset of
              the gravity in mjModel; offsets of the members of mjModel and mjData below
    table     number of slots, then pairs (hash, address of the block; 0: it cannot be built)
    request   body (-1: look at the configuration only), instance, hash; answer: block, error message

A table is only ever added to, value before key, or replaced by another whose address is put in the root.
"""

import ctypes
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import types

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import (
    as_doubles,
    as_words,
    call_address,
    intrinsic,
    stack_doubles,
    symbol,
)
from mjskip.coupling._struct_layout import library

WRENCH, IMMERSION, BUILDER, TABLE, GRAVITY, MEMBERS = 0, 1, 2, 3, 4, 5
SLOTS, PAIRS = 0, 1
BODY, INSTANCE, KEY, BLOCK, MESSAGE, REQUEST = 0, 1, 2, 3, 4, 5

MODEL_MEMBERS = (
    "nbody", "nsensor", "nplugin", "npluginattr",
    "body_plugin", "body_rootid", "body_parentid", "body_dofnum", "body_dofadr", "dof_parentid",
    "body_ipos", "body_iquat", "body_inertia", "body_geomadr", "body_geomnum",
    "geom_type", "geom_dataid", "geom_size", "geom_pos", "geom_quat",
    "mesh_vertadr", "mesh_vertnum", "mesh_vert", "mesh_faceadr", "mesh_facenum", "mesh_face",
    "plugin_attr", "plugin_attradr",
    "sensor_plugin", "sensor_adr",
)  # fmt: skip
(
    NBODY, NSENSOR, NPLUGIN, NPLUGINATTR,
    BODY_PLUGIN, BODY_ROOTID, BODY_PARENTID, BODY_DOFNUM, BODY_DOFADR, DOF_PARENTID,
    BODY_IPOS, BODY_IQUAT, BODY_INERTIA, BODY_GEOMADR, BODY_GEOMNUM,
    GEOM_TYPE, GEOM_DATAID, GEOM_SIZE, GEOM_POS, GEOM_QUAT,
    MESH_VERTADR, MESH_VERTNUM, MESH_VERT, MESH_FACEADR, MESH_FACENUM, MESH_FACE,
    PLUGIN_ATTR, PLUGIN_ATTRADR,
    SENSOR_PLUGIN, SENSOR_ADR,
) = range(MEMBERS, MEMBERS + len(MODEL_MEMBERS))  # fmt: skip
DATA_MEMBERS = (
    "xipos", "xmat", "cvel", "cdof", "subtree_com", "qfrc_passive", "body_awake", "sensordata",
)  # fmt: skip
XIPOS, XMAT, CVEL, CDOF, SUBTREE_COM, QFRC_PASSIVE, BODY_AWAKE, SENSORDATA = range(
    MEMBERS + len(MODEL_MEMBERS), MEMBERS + len(MODEL_MEMBERS) + len(DATA_MEMBERS)
)

READING = 7
"""Numbers of a sensor for one body: force (3) and torque (3) of water and air, wetted area."""

# MuJoCo's constants, part of its binary interface
SENSOR, PASSIVE = 2, 4  # capabilities
GEOM_MESH = 7
ASLEEP = 0
WARN_BADQACC = 5
WARNED_BODY = 1_000_000  # added to the body's id, where MuJoCo's own warning has a dof

root = np.zeros(MEMBERS + len(MODEL_MEMBERS) + len(DATA_MEMBERS), dtype=np.int64)
_root = symbol("mjskip_plugin_root", root.ctypes.data)

for _name in ("mju_error", "mj_warning"):
    binding.add_symbol(_name, ctypes.cast(getattr(library, _name), ctypes.c_void_p).value)
mju_error = types.ExternalFunction("mju_error", types.void(types.int64))
mj_warning = types.ExternalFunction("mj_warning", types.void(types.int64, types.int32, types.int32))

STEP = -7046029254386353131  # 2^64 over the golden ratio, as a signed word
HALF = 0xFFFFFFFF


@intrinsic
def as_ints(typingctx: Any, address: Any) -> Any:
    """Address of 32-bit integers as a pointer that indexes like a C array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(32).as_pointer())

    return types.CPointer(types.int32)(types.int64), codegen


@intrinsic
def word_at(typingctx: Any, address: Any, index: Any) -> Any:
    """The word at an index from an address, aligned or not."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = builder.inttoptr(args[0], ir.IntType(64).as_pointer())
        return builder.load(builder.gep(pointer, [args[1]]), align=1)

    return types.int64(types.int64, types.int64), codegen


@intrinsic
def byte_at(typingctx: Any, address: Any) -> Any:
    """The byte at an address, 0 to 255."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        pointer = builder.inttoptr(args[0], ir.IntType(8).as_pointer())
        return builder.zext(builder.load(pointer), ir.IntType(64))

    return types.int64(types.int64), codegen


@kernel
def _size(table: Any, owner: int, member: int) -> Any:
    """A member that is a size."""
    return as_words(owner + table[member])[0]


@kernel
def _ints(table: Any, owner: int, member: int) -> Any:
    """A member that points to 32-bit integers."""
    return as_ints(as_words(owner + table[member])[0])


@kernel
def _doubles(table: Any, owner: int, member: int) -> Any:
    """A member that points to doubles."""
    return as_doubles(as_words(owner + table[member])[0])


@kernel
def _mix(key: int, word: int) -> int:
    key = (key ^ word) * STEP
    return key ^ (key >> 29)


@kernel
def _hash(address: int, size: int, key: int) -> int:
    """Hash of `size` bytes, after what was hashed to `key`.

    As in XXH3: every word, under a secret that depends on its place, gives the product of its halves;
    products do not wait for each other. The plain sum guards against halves that are zero.
    """
    words = size >> 3
    products = plain = 0
    for i in range(words):
        word = word_at(address, i)
        hidden = word ^ (key + i * STEP)
        products += (hidden & HALF) * (hidden >> 32 & HALF)
        plain += word
    tail, i = size, 8 * words
    while i < size:  # the rest of a text
        tail = (tail << 8) | byte_at(address + i)
        i += 1
    return _mix(_mix(key + plain, products), tail)


@kernel
def _hash_items(
    table: Any, model: int, member: int, first: int, bytes_each: int, count: int, key: int
) -> int:
    """Hash of some items of an array."""
    return _hash(as_words(model + table[member])[0] + first * bytes_each, count * bytes_each, key)


@kernel
def _content(table: Any, model: int, body: int, instance: int) -> int:
    """Hash of all that a body's block is made from; never 0."""
    starts = _ints(table, model, PLUGIN_ATTRADR)
    begin = starts[instance]
    last = instance + 1 == _size(table, model, NPLUGIN)
    end = _size(table, model, NPLUGINATTR) if last else starts[instance + 1]
    key = _hash_items(table, model, PLUGIN_ATTR, begin, 1, end - begin, 1)
    key = _hash(model + table[GRAVITY], 24, key)
    key = _hash_items(table, model, BODY_IPOS, body, 24, 1, key)
    key = _hash_items(table, model, BODY_IQUAT, body, 32, 1, key)
    key = _hash_items(table, model, BODY_INERTIA, body, 24, 1, key)
    first = _ints(table, model, BODY_GEOMADR)[body]
    for geom in range(first, first + _ints(table, model, BODY_GEOMNUM)[body]):
        kind = _ints(table, model, GEOM_TYPE)[geom]
        key = _hash_items(table, model, GEOM_SIZE, geom, 24, 1, key ^ kind)
        key = _hash_items(table, model, GEOM_POS, geom, 24, 1, key)
        key = _hash_items(table, model, GEOM_QUAT, geom, 32, 1, key)
        if kind == GEOM_MESH:
            mesh = _ints(table, model, GEOM_DATAID)[geom]
            at, count = (
                _ints(table, model, MESH_VERTADR)[mesh],
                _ints(table, model, MESH_VERTNUM)[mesh],
            )
            key = _hash_items(table, model, MESH_VERT, at, 12, count, key)
            at, count = (
                _ints(table, model, MESH_FACEADR)[mesh],
                _ints(table, model, MESH_FACENUM)[mesh],
            )
            key = _hash_items(table, model, MESH_FACE, at, 12, count, key)
    return key if key != 0 else 1


@kernel
def _look_up(table: Any, key: int) -> Any:
    """Address of the block of a content: 0 if it cannot be built, -1 if nobody has tried."""
    blocks = as_words(table[TABLE])
    slots = blocks[SLOTS]
    k = key & (slots - 1)
    while blocks[PAIRS + 2 * k] != key:
        if blocks[PAIRS + 2 * k] == 0:
            return -1
        k = (k + 1) & (slots - 1)
    return blocks[PAIRS + 2 * k + 1]


@kernel
def _build(table: Any, model: int, body: int, instance: int, key: int, request: int) -> Any:
    """Ask Python for a block; request holds what it says."""
    words = as_words(request)
    words[BODY], words[INSTANCE], words[KEY], words[BLOCK], words[MESSAGE] = (
        body,
        instance,
        key,
        0,
        0,
    )
    call_address(table[BUILDER], model, request, 0)
    return words[BLOCK]


@kernel
def _load(table: Any, model: int, data: int, body: int, instance: int, scratch: int) -> Any:
    """Pose and wrench of a body to scratch; the address of its block, 0 if there is no finite wrench.

    scratch: state (18), wrench (12), request (5).
    """
    key = _content(table, model, body, instance)
    block = _look_up(table, key)
    if block == -1:
        block = _build(table, model, body, instance, key, scratch + 8 * 30)
    state, wrench = as_doubles(scratch), as_doubles(scratch + 8 * 18)
    total = np.nan
    if block != 0:
        centre, rotation = _doubles(table, data, XIPOS), _doubles(table, data, XMAT)
        moving, origin = _doubles(table, data, CVEL), _doubles(table, data, SUBTREE_COM)
        tree = _ints(table, model, BODY_ROOTID)[body]
        for i in range(3):
            state[i] = centre[3 * body + i]
        for i in range(9):
            state[3 + i] = rotation[9 * body + i]
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
        call_address(table[WRENCH], block, scratch, scratch + 8 * 18)
        total = 0.0
        for i in range(12):
            total += wrench[i]
    if np.isfinite(total):
        return block
    mj_warning(data, WARN_BADQACC, WARNED_BODY + body)
    return 0


@kernel
def _push(table: Any, model: int, data: int, body: int, scratch: int) -> None:
    """qfrc_passive += J'w: the wrench about the body's centre of mass, on every dof that moves it."""
    state, wrench = as_doubles(scratch), as_doubles(scratch + 8 * 18)
    fx, fy, fz = wrench[0] + wrench[6], wrench[1] + wrench[7], wrench[2] + wrench[8]
    tree = 3 * _ints(table, model, BODY_ROOTID)[body]
    origin = _doubles(table, data, SUBTREE_COM)  # about which MuJoCo keeps the motion of a tree
    rx, ry, rz = state[0] - origin[tree], state[1] - origin[tree + 1], state[2] - origin[tree + 2]
    tx = wrench[3] + wrench[9] + (ry * fz - rz * fy)
    ty = wrench[4] + wrench[10] + (rz * fx - rx * fz)
    tz = wrench[5] + wrench[11] + (rx * fy - ry * fx)
    count, parent = _ints(table, model, BODY_DOFNUM), _ints(table, model, BODY_PARENTID)
    while body > 0 and count[body] == 0:
        body = parent[body]
    dof = _ints(table, model, BODY_DOFADR)[body] + count[body] - 1 if body > 0 else -1
    above, axis = _ints(table, model, DOF_PARENTID), _doubles(table, data, CDOF)
    out = _doubles(table, data, QFRC_PASSIVE)
    while dof >= 0:
        k = 6 * dof
        out[dof] += (
            axis[k] * tx + axis[k + 1] * ty + axis[k + 2] * tz
            + axis[k + 3] * fx + axis[k + 4] * fy + axis[k + 5] * fz
        )  # fmt: skip
        dof = above[dof]


@kernel
def _sense(table: Any, model: int, data: int, instance: int, sensor: int, scratch: int) -> None:
    """One sensor: its readings of every body of the instance in turn."""
    wrench, seen = as_doubles(scratch + 8 * 18), as_doubles(scratch + 8 * 35)
    out = as_words(data + table[SENSORDATA])[0] + 8 * _ints(table, model, SENSOR_ADR)[sensor]
    reading = as_doubles(out)
    plugin = _ints(table, model, BODY_PLUGIN)
    at = 0
    for body in range(1, _size(table, model, NBODY)):
        if plugin[body] != instance:
            continue
        block = _load(table, model, data, body, instance, scratch)
        for i in range(6):
            reading[at + i] = wrench[i] + wrench[6 + i] if block != 0 else 0.0
        if block != 0:
            call_address(table[IMMERSION], block, scratch, scratch + 8 * 35)
        reading[at + 6] = seen[0] if block != 0 else 0.0
        at += READING


def nstate(model: int, instance: int) -> int:
    """No state: it is all in the model and in the data."""
    return 0


def nsensordata(model: int, instance: int, sensor: int) -> int:
    """Numbers that a sensor shows: READING for every body of the instance."""
    table = as_words(_root())
    plugin = _ints(table, model, BODY_PLUGIN)
    count = 0
    for body in range(1, _size(table, model, NBODY)):
        if plugin[body] == instance:
            count += READING
    return count


def init(model: int, data: int, instance: int) -> int:
    """Called for every new MjData, and so by the compiler: look at the configuration, build the blocks."""
    table = as_words(_root())
    request = stack_doubles(REQUEST)
    _build(table, model, -1, instance, 0, request)
    plugin = _ints(table, model, BODY_PLUGIN)
    for body in range(1, _size(table, model, NBODY)):
        if plugin[body] == instance and as_words(request)[MESSAGE] == 0:
            key = _content(table, model, body, instance)
            if _look_up(table, key) <= 0:
                _build(table, model, body, instance, key, request)
    message = as_words(request)[MESSAGE]
    if message != 0:
        mju_error(message)  # does not return
    return 0


def reset(model: int, state: int, stored: int, instance: int) -> None:
    """Nothing to reset."""


def compute(model: int, data: int, instance: int, capability: int) -> None:
    """The wrench of water and air on every body of the instance: as a force, or as sensors show it."""
    table = as_words(_root())
    scratch = stack_doubles(40)
    if capability & PASSIVE:
        plugin = _ints(table, model, BODY_PLUGIN)
        awake = _ints(table, data, BODY_AWAKE)
        for body in range(1, _size(table, model, NBODY)):
            mine = plugin[body] == instance and awake[body] != ASLEEP
            if mine and _load(table, model, data, body, instance, scratch) != 0:
                _push(table, model, data, body, scratch)
    if capability & SENSOR:
        plugin = _ints(table, model, SENSOR_PLUGIN)
        for sensor in range(_size(table, model, NSENSOR)):
            if plugin[sensor] == instance:
                _sense(table, model, data, instance, sensor, scratch)
