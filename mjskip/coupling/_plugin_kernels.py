"""Engine plugin mjskip.water, compiled to C by numba: force on bodies, and sensors.

Of still water the plugin keeps nothing in MjData; of water that moves (`_moving_kernels`, called by address since it is
compiled for those that use it alone) everything, as its state; and of bodies that radiate the waves of their surface
(`_sea_kernels`, called by address too). An instance wets the bodies that carry it, and what moves below them unless it
carries another; each such *head* has the bodies that are welded to it. At every call the content of a head (its
geoms, mass and inertia, the text of its configuration) is hashed, and the hash finds the *record*
(`_record_kernels`) in a table of this process. So it does not matter which model, copy of a model or data comes, from
which thread, or whether a model lives where another was freed. A content that is new is handed to
Python, which builds its record; that happens when MjData is made, or when somebody alters a model.

Of a large mesh some words are hashed at every call, with the address of the model; MjData that is made looks at all.

    root      addresses of the force and immersion kernels, of the builder and of the table; offsets of
              gravity, time step and disabling flags in mjModel; number of the plugin, of its key `radiation`; addresses of what lets
              bodies radiate (`_sea_kernels`); offsets of the members of mjModel and
              mjData below
    table     of pairs (hash, address of the record; 0: cannot be built, 1: dry), stamped (`_table_kernels`)
    request   what is asked, body, instance, hash; answer: address of the record, error message

A table is only ever added to, value before key, or replaced by another whose address is put in the root. What is looked up
is stamped, so that records which no model uses any more can be told from others.
"""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import (
    as_doubles,
    as_ints,
    as_words,
    bits,
    call_address,
    intrinsic,
    stack_doubles,
    symbol,
)
from mjskip.coupling._record_kernels import BLOCK, NEEDED_STEP, SCRATCH, body_state, wet_load
from mjskip.coupling._table_kernels import (
    add_generalised_force,
    doubles,
    ints,
    last_dof,
    look_up_and_stamp,
    mj_warning,
    mju_error,
)

WRENCH, IMMERSION, BUILDER, TABLE, GRAVITY, TIMESTEP, SLOT, INTEGRATOR = range(8)
MOVING_COMPUTE, MOVING_ADVANCE, MOVING_DRAW = 8, 9, 10  # 0 until an instance needs them
SCENE_MAXGEOM, SCENE_NGEOM, SCENE_GEOMS, GEOM_BYTES = 11, 12, 13, 14
RADIATION_KEY, SEA_ACT, SEA_ADVANCE, SEA_SENSE = 15, 16, 17, 18
DISABLED = 19
MEMBERS = 20
ASK, BODY, INSTANCE, KEY, ANSWER, MESSAGE, REQUEST = 0, 1, 2, 3, 4, 5, 6
CONFIGURATION, HULL, FRESH_HULL, WARNINGS, TOO_LARGE_STEP, SURFACE, STATE_SIZE = range(7)
"""What is asked: whether a configuration is allowed; a record; the same after a look at all of its meshes;
to say what is doubtful about an instance; to say that a body's drag was limited; the record of an instance's surface
(`_moving_kernels`); how many doubles its state has."""
CANNOT, DRY, UNKNOWN = 0, 1, -1
MOVES, STATE_DOUBLES = 0, 1
"""Of the record of a surface: above 0 if it moves, and how many doubles of state it has."""

MODEL_MEMBERS = (
    "nbody", "nsensor", "nplugin", "npluginattr",
    "body_plugin", "body_rootid", "body_parentid", "body_weldid", "body_jntnum",
    "body_dofnum", "body_dofadr", "dof_parentid", "body_invweight0",
    "body_pos", "body_quat", "body_mass",
    "body_ipos", "body_iquat", "body_inertia", "body_geomadr", "body_geomnum",
    "geom_type", "geom_dataid", "geom_size", "geom_pos", "geom_quat",
    "geom_contype", "geom_conaffinity", "geom_group", "name_geomadr", "names",
    "mesh_vertadr", "mesh_vertnum", "mesh_vert", "mesh_faceadr", "mesh_facenum", "mesh_face",
    "plugin", "plugin_attr", "plugin_attradr",
    "plugin_stateadr", "plugin_statenum", "sensor_plugin", "sensor_adr", "sensor_objtype", "sensor_objid",
)  # fmt: skip
(
    NBODY, NSENSOR, NPLUGIN, NPLUGINATTR,
    BODY_PLUGIN, BODY_ROOTID, BODY_PARENTID, BODY_WELDID, BODY_JNTNUM,
    BODY_DOFNUM, BODY_DOFADR, DOF_PARENTID, BODY_INVWEIGHT0,
    BODY_POS, BODY_QUAT, BODY_MASS,
    BODY_IPOS, BODY_IQUAT, BODY_INERTIA, BODY_GEOMADR, BODY_GEOMNUM,
    GEOM_TYPE, GEOM_DATAID, GEOM_SIZE, GEOM_POS, GEOM_QUAT,
    GEOM_CONTYPE, GEOM_CONAFFINITY, GEOM_GROUP, NAME_GEOMADR, NAMES,
    MESH_VERTADR, MESH_VERTNUM, MESH_VERT, MESH_FACEADR, MESH_FACENUM, MESH_FACE,
    PLUGIN, PLUGIN_ATTR, PLUGIN_ATTRADR,
    PLUGIN_STATEADR, PLUGIN_STATENUM, SENSOR_PLUGIN, SENSOR_ADR, SENSOR_OBJTYPE, SENSOR_OBJID,
) = range(MEMBERS, MEMBERS + len(MODEL_MEMBERS))  # fmt: skip
DATA_MEMBERS = (
    "xpos", "xmat", "cvel", "cdof", "subtree_com", "qfrc_passive", "body_awake", "sensordata",
    "plugin_state", "site_xpos",
)  # fmt: skip
(
    XPOS, XMAT, CVEL, CDOF, SUBTREE_COM, QFRC_PASSIVE, BODY_AWAKE, SENSORDATA,
    PLUGIN_STATE, SITE_XPOS,
) = range(MEMBERS + len(MODEL_MEMBERS), MEMBERS + len(MODEL_MEMBERS) + len(DATA_MEMBERS))  # fmt: skip

HASH_WHOLE_ROWS = 512
"""Rows of a mesh's arrays up to which all are hashed at every call, and words that are hashed of more."""

AT_WRENCH, AT_REQUEST, AT_SEEN, AT_LOAD = 18, 30, 36, 41
LOAD_SCRATCH = AT_LOAD + SCRATCH

READING = 7
"""Numbers of a sensor for one body: force (3) and torque (3) of water and air, wetted area."""

# MuJoCo's constants, part of its binary interface
SENSOR, PASSIVE = 2, 4  # capabilities
GEOM_MESH = 7
ASLEEP = 0
WARN_BADQACC = 5
NO_GRAVITY = 1 << 7
WARNED_BODY = 1_000_000  # added to the body's id, where MuJoCo's own warning has a dof

root = np.zeros(MEMBERS + len(MODEL_MEMBERS) + len(DATA_MEMBERS), dtype=np.int64)
root_address = symbol("mjskip_plugin_root", root.ctypes.data)

STEP = -7046029254386353131  # 2^64 over the golden ratio, as a signed word
HALF = 0xFFFFFFFF


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
def size(table: Any, owner: int, member: int) -> Any:
    """A member that is a size."""
    return as_words(owner + table[member])[0]


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
def _has_plugin(table: Any, model: int, body: int) -> Any:
    """Whether a body carries this plugin, by whichever instance."""
    instance = ints(table, model, BODY_PLUGIN)[body]
    return instance >= 0 and ints(table, model, PLUGIN)[instance] == table[SLOT]


@kernel
def _text_end(table: Any, model: int, instance: int) -> Any:
    """Where the texts of an instance's configuration end in plugin_attr."""
    if instance + 1 == size(table, model, NPLUGIN):
        return size(table, model, NPLUGINATTR)
    return ints(table, model, PLUGIN_ATTRADR)[instance + 1]


@kernel
def wets_below(table: Any, model: int, instance: int) -> bool:
    """Whether an instance wets what moves below its bodies too: the last of its texts is not "this"."""
    end = as_words(model + table[PLUGIN_ATTR])[0] + _text_end(table, model, instance)
    return not (
        byte_at(end - 6) == 0 and byte_at(end - 5) == 116 and byte_at(end - 4) == 104
        and byte_at(end - 3) == 105 and byte_at(end - 2) == 115
    )  # fmt: skip


@kernel
def _radiates(table: Any, model: int, instance: int) -> Any:
    """Whether an instance lets its bodies make waves: its text of the key `radiation` is "true"."""
    at = as_words(model + table[PLUGIN_ATTR])[0] + ints(table, model, PLUGIN_ATTRADR)[instance]
    for _ in range(table[RADIATION_KEY]):
        while byte_at(at) != 0:
            at += 1
        at += 1
    return byte_at(at) == 116  # t


@kernel
def is_head(table: Any, model: int, body: int, instance: int, below: bool) -> Any:
    """Whether a body is one that an instance wets, with what is welded to it."""
    if ints(table, model, BODY_PLUGIN)[body] == instance:
        return True
    if not below or ints(table, model, BODY_JNTNUM)[body] == 0:
        return False
    parent = ints(table, model, BODY_PARENTID)
    while body > 0:
        if _has_plugin(table, model, body):
            return ints(table, model, BODY_PLUGIN)[body] == instance
        body = parent[body]
    return False


@kernel
def _is_welded(table: Any, model: int, body: int, head: int) -> bool:
    """Whether a body below a head is welded to it, and carries no plugin of its own."""
    weld, parent = ints(table, model, BODY_WELDID), ints(table, model, BODY_PARENTID)
    if weld[body] != weld[head]:
        return False
    while body != head:
        if _has_plugin(table, model, body):
            return False
        body = parent[body]
    return True


@kernel
def _content(table: Any, model: int, head: int, instance: int) -> int:
    """Hash of all that a head's record is made from; never 0."""
    begin = ints(table, model, PLUGIN_ATTRADR)[instance]
    end = _text_end(table, model, instance)
    key = _hash_items(table, model, PLUGIN_ATTR, begin, 1, end - begin, 1)
    key = _hash(model + table[GRAVITY], 24, key)
    parent = ints(table, model, BODY_PARENTID)
    last = size(table, model, NBODY)
    body = head
    while True:
        if body == head or _is_welded(table, model, body, head):
            key = _body_content(table, model, body, head, key)
        body += 1
        if body >= last or parent[body] < head:
            break  # bodies are listed depth first
    return key if key != 0 else 1


@kernel
def _body_content(table: Any, model: int, body: int, head: int, key: int) -> int:
    """Hash of a body that is welded to a head, after what was hashed to `key`."""
    if body != head:
        key = _hash_items(table, model, BODY_POS, body, 24, 1, key)
        key = _hash_items(table, model, BODY_QUAT, body, 32, 1, key)
    key = _hash_items(table, model, BODY_MASS, body, 8, 1, key)
    key = _hash_items(table, model, BODY_IPOS, body, 24, 1, key)
    key = _hash_items(table, model, BODY_IQUAT, body, 32, 1, key)
    key = _hash_items(table, model, BODY_INERTIA, body, 24, 1, key)
    first = ints(table, model, BODY_GEOMADR)[body]
    for geom in range(first, first + ints(table, model, BODY_GEOMNUM)[body]):
        kind = ints(table, model, GEOM_TYPE)[geom]
        collides = (
            ints(table, model, GEOM_CONTYPE)[geom] != 0
            or ints(table, model, GEOM_CONAFFINITY)[geom] != 0
        )
        sort = kind + 64 * ints(table, model, GEOM_GROUP)[geom] + (32 if collides else 0)
        key = _hash_items(table, model, GEOM_SIZE, geom, 24, 1, key ^ sort)
        key = _hash_items(table, model, GEOM_POS, geom, 24, 1, key)
        key = _hash_items(table, model, GEOM_QUAT, geom, 32, 1, key)
        name = as_words(model + table[NAMES])[0] + ints(table, model, NAME_GEOMADR)[geom]
        length = 0
        while byte_at(name + length) != 0:
            length += 1
        key = _hash(name, length, key)
        if kind == GEOM_MESH:
            mesh = ints(table, model, GEOM_DATAID)[geom]
            at = ints(table, model, MESH_VERTADR)[mesh]
            count = ints(table, model, MESH_VERTNUM)[mesh]
            key = _hash_large(table, model, MESH_VERT, at, count, key)
            at = ints(table, model, MESH_FACEADR)[mesh]
            count = ints(table, model, MESH_FACENUM)[mesh]
            key = _hash_large(table, model, MESH_FACE, at, count, key)
    return key


@kernel
def _hash_large(table: Any, model: int, member: int, first: int, count: int, key: int) -> int:
    """Hash of rows of 12 bytes; of many, some words and the address of the model."""
    if count <= HASH_WHOLE_ROWS:
        return _hash_items(table, model, member, first, 12, count, key)
    address = as_words(model + table[member])[0] + 12 * first
    words = 12 * count >> 3
    key = _mix(_mix(key, model), count)
    for i in range(HASH_WHOLE_ROWS):
        key = _mix(key, word_at(address, i * words // HASH_WHOLE_ROWS))
    return key


@kernel
def _is_large(table: Any, model: int, head: int) -> bool:
    """Whether not all of a head's meshes are hashed at every call."""
    parent = ints(table, model, BODY_PARENTID)
    body, last = head, size(table, model, NBODY)
    while True:
        first = ints(table, model, BODY_GEOMADR)[body]
        for geom in range(first, first + ints(table, model, BODY_GEOMNUM)[body]):
            mesh = ints(table, model, GEOM_DATAID)[geom]
            if ints(table, model, GEOM_TYPE)[geom] == GEOM_MESH and (
                ints(table, model, MESH_VERTNUM)[mesh] > HASH_WHOLE_ROWS
                or ints(table, model, MESH_FACENUM)[mesh] > HASH_WHOLE_ROWS
            ):
                return True
        body += 1
        if body >= last or parent[body] < head:
            return False


@kernel
def _request_python(
    table: Any, model: int, what: int, body: int, instance: int, key: int, request: int
) -> Any:
    """Ask Python; request (REQUEST words) holds what it says, its answer is returned."""
    words = as_words(request)
    words[ASK], words[BODY], words[INSTANCE], words[KEY] = what, body, instance, key
    words[ANSWER] = words[MESSAGE] = 0
    call_address(table[BUILDER], model, request, 0)
    return words[ANSWER]


@kernel
def load_body(table: Any, model: int, data: int, body: int, instance: int, scratch: int) -> Any:
    """Pose and wrench of a body to scratch; the address of its record, 0 if there is no force.

    scratch: state (18), wrench (12), request (6), readings (5), of `wet_load`.
    """
    key = _content(table, model, body, instance)
    record = look_up_and_stamp(table[TABLE], key, UNKNOWN)
    if record == -1:
        record = _request_python(table, model, HULL, body, instance, key, scratch + 8 * AT_REQUEST)
    if record == DRY:
        return 0
    wrench = as_doubles(scratch + 8 * AT_WRENCH)
    total = np.nan
    if record != CANNOT:
        known = as_doubles(record)
        tree = ints(table, model, BODY_ROOTID)[body]
        body_state(
            as_words(data + table[XPOS])[0],
            as_words(data + table[XMAT])[0],
            as_words(data + table[CVEL])[0],
            as_words(data + table[SUBTREE_COM])[0] + 24 * tree,
            body,
            record,
            scratch,
        )
        weights = doubles(table, model, BODY_INVWEIGHT0)
        gravity = -as_doubles(model + table[GRAVITY])[2]
        if as_ints(model + table[DISABLED])[0] & NO_GRAVITY != 0:
            gravity = 0.0
        needed = wet_load(
            table[WRENCH], record, scratch, scratch + 8 * AT_WRENCH, scratch + 8 * AT_LOAD,
            as_doubles(model + table[TIMESTEP])[0], gravity,
            weights[2 * body], weights[2 * body + 1],
        )  # fmt: skip
        if needed < known[NEEDED_STEP]:
            first = not known[NEEDED_STEP] < np.inf
            known[NEEDED_STEP] = needed
            if first:
                _request_python(
                    table, model, TOO_LARGE_STEP, body, instance, key, scratch + 8 * AT_REQUEST
                )
        total = 0.0
        for i in range(12):
            total += wrench[i]
    if np.isfinite(total):
        return record
    warn(data, body)
    return 0


@kernel
def warn(data: int, body: int) -> None:
    """Count a force that is not finite as a warning of MuJoCo's."""
    mj_warning(data, WARN_BADQACC, WARNED_BODY + body)


@kernel
def _surface(table: Any, model: int, instance: int, request: int) -> Any:
    """Address of the record of an instance's surface; DRY if it is still water that shows nothing."""
    begin = ints(table, model, PLUGIN_ATTRADR)[instance]
    end = _text_end(table, model, instance)
    key = _hash_items(table, model, PLUGIN_ATTR, begin, 1, end - begin, 2)
    key = _hash(model + table[GRAVITY], 24, key)
    key = key if key != 0 else 1
    found = look_up_and_stamp(table[TABLE], key, UNKNOWN)
    if found == -1:
        found = _request_python(table, model, SURFACE, -1, instance, key, request)
    return found


@kernel
def _moves(surface: int) -> bool:
    """Whether a surface is one that moves."""
    return surface > DRY and as_doubles(surface)[MOVES] > 0.0


@kernel
def push(table: Any, model: int, data: int, body: int, scratch: int) -> None:
    """qfrc_passive += J'w: the wrench about the body's centre of mass, on every dof that moves it."""
    state, wrench = as_doubles(scratch), as_doubles(scratch + 8 * AT_WRENCH)
    fx, fy, fz = wrench[0] + wrench[6], wrench[1] + wrench[7], wrench[2] + wrench[8]
    tree = 3 * ints(table, model, BODY_ROOTID)[body]
    origin = doubles(table, data, SUBTREE_COM)  # about which MuJoCo keeps the motion of a tree
    rx, ry, rz = state[0] - origin[tree], state[1] - origin[tree + 1], state[2] - origin[tree + 2]
    tx = wrench[3] + wrench[9] + (ry * fz - rz * fy)
    ty = wrench[4] + wrench[10] + (rz * fx - rx * fz)
    tz = wrench[5] + wrench[11] + (rx * fy - ry * fx)
    count, parent = ints(table, model, BODY_DOFNUM), ints(table, model, BODY_PARENTID)
    dof = last_dof(count, parent, ints(table, model, BODY_DOFADR), body)
    above, axis = ints(table, model, DOF_PARENTID), doubles(table, data, CDOF)
    out = doubles(table, data, QFRC_PASSIVE)
    add_generalised_force(dof, above, axis, out, fx, fy, fz, tx, ty, tz)


@kernel
def _sense(table: Any, model: int, data: int, instance: int, sensor: int, scratch: int) -> None:
    """One sensor: its readings of every wet body of the instance in turn."""
    wrench, seen = as_doubles(scratch + 8 * AT_WRENCH), as_doubles(scratch + 8 * AT_SEEN)
    out = as_words(data + table[SENSORDATA])[0] + 8 * ints(table, model, SENSOR_ADR)[sensor]
    reading = as_doubles(out)
    below = wets_below(table, model, instance)
    at = 0
    for body in range(1, size(table, model, NBODY)):
        if not is_head(table, model, body, instance, below):
            continue
        record = load_body(table, model, data, body, instance, scratch)
        carries = ints(table, model, BODY_PLUGIN)[body] == instance
        if record != 0 and carries and _radiates(table, model, instance):
            as_words(scratch + 8 * AT_REQUEST)[BODY] = body
            as_words(scratch + 8 * AT_REQUEST)[INSTANCE] = instance
            call_address(table[SEA_SENSE], model, data, scratch + 8 * AT_WRENCH)
        for i in range(6):
            reading[at + i] = wrench[i] + wrench[6 + i] if record != 0 else 0.0
        if record != 0:
            block = bits(as_doubles(record)[BLOCK])
            call_address(table[IMMERSION], block, scratch, scratch + 8 * AT_SEEN)
        reading[at + 6] = seen[0] if record != 0 else 0.0
        at += READING


def nstate(model: int, instance: int) -> int:
    """Doubles of state: of a surface that moves, or on which bodies radiate; of still water none."""
    request = stack_doubles(REQUEST)
    found: int = _request_python(
        as_words(root_address()), model, STATE_SIZE, -1, instance, 0, request
    )
    if as_words(request)[MESSAGE] != 0:
        mju_error(as_words(request)[MESSAGE])  # does not return
    return found


def nsensordata(model: int, instance: int, sensor: int) -> int:
    """Numbers that a sensor shows: READING for every wet body of the instance."""
    table = as_words(root_address())
    below = wets_below(table, model, instance)
    count = 0
    for body in range(1, size(table, model, NBODY)):
        if is_head(table, model, body, instance, below):
            count += READING
    return count


def init(model: int, data: int, instance: int) -> int:
    """Called for every new MjData, and so by the compiler: look at the configuration, build the records."""
    table = as_words(root_address())
    request = stack_doubles(REQUEST)
    _request_python(table, model, CONFIGURATION, -1, instance, 0, request)
    below = wets_below(table, model, instance)
    built = False
    for body in range(1, size(table, model, NBODY)):
        if as_words(request)[MESSAGE] == 0 and is_head(table, model, body, instance, below):
            key = _content(table, model, body, instance)
            known = look_up_and_stamp(table[TABLE], key, UNKNOWN)
            if known <= 0:
                built = True
                _request_python(table, model, HULL, body, instance, key, request)
            elif _is_large(table, model, body):
                _request_python(table, model, FRESH_HULL, body, instance, key, request)
    if built and as_words(request)[MESSAGE] == 0:
        _request_python(table, model, WARNINGS, -1, instance, 0, request)
    message = as_words(request)[MESSAGE]
    if message != 0:
        mju_error(message)  # does not return
    return 0


def reset(model: int, state: int, stored: int, instance: int) -> None:
    """Still water: also when a keyframe is loaded, since MuJoCo resets first."""
    table, numbers = as_words(root_address()), as_doubles(state)
    for i in range(ints(table, model, PLUGIN_STATENUM)[instance]):
        numbers[i] = 0.0


def compute(model: int, data: int, instance: int, capability: int) -> None:
    """The wrench of water and air on every wet body of the instance: as a force, or as sensors show it."""
    table = as_words(root_address())
    scratch = stack_doubles(LOAD_SCRATCH)
    surface = _surface(table, model, instance, scratch)
    if _moves(surface):
        arguments = as_words(scratch)
        arguments[0], arguments[1], arguments[2] = instance, capability, surface
        call_address(table[MOVING_COMPUTE], model, data, scratch)
        return
    radiates = _radiates(table, model, instance)
    if capability & PASSIVE:
        if radiates:
            call_address(table[SEA_ACT], model, data, instance)
        below = wets_below(table, model, instance)
        awake = ints(table, data, BODY_AWAKE)
        carrier = ints(table, model, BODY_PLUGIN)
        for body in range(1, size(table, model, NBODY)):
            mine = awake[body] != ASLEEP and is_head(table, model, body, instance, below)
            mine = mine and not (radiates and carrier[body] == instance)
            if mine and load_body(table, model, data, body, instance, scratch) != 0:
                push(table, model, data, body, scratch)
    if capability & SENSOR:
        plugin = ints(table, model, SENSOR_PLUGIN)
        for sensor in range(size(table, model, NSENSOR)):
            if plugin[sensor] == instance:
                _sense(table, model, data, instance, sensor, scratch)


def advance(model: int, data: int, instance: int) -> None:
    """Step a surface that moves, once after every step of MuJoCo's."""
    table = as_words(root_address())
    if _radiates(table, model, instance):
        call_address(table[SEA_ADVANCE], model, data, instance)
        return
    scratch = stack_doubles(REQUEST)
    surface = _surface(table, model, instance, scratch)
    if _moves(surface):
        arguments = as_words(scratch)
        arguments[0], arguments[2] = instance, surface
        call_address(table[MOVING_ADVANCE], model, data, scratch)


def visualize(model: int, data: int, option: int, scene: int, instance: int) -> None:
    """Put a surface that moves, and force arrows if asked for, into a scene of MuJoCo's."""
    table = as_words(root_address())
    scratch = stack_doubles(REQUEST)
    surface = _surface(table, model, instance, scratch)
    if surface > DRY:
        arguments = as_words(scratch)
        arguments[0], arguments[2], arguments[3] = instance, surface, scene
        call_address(table[MOVING_DRAW], model, data, scratch)
