"""What compiled code in MuJoCo's callbacks shares: its errors, members of its structs, tables by key.

A table is words: the number of slots, a power of two, then pairs of key and value; a key of 0 is an empty slot, and a
key lies in the first free slot from its lowest bits on. A stamped table goes on with a stamp for each slot and the number
of the present round: a slot that is looked up is stamped with it, so that those that nobody uses any more are known.
"""

import ctypes
from typing import Any

from llvmlite import binding
from numba import types

from mjskip._compile.jit import kernel
from mjskip._compile.pointers import as_doubles, as_ints, as_words
from mjskip.coupling._struct_layout import library

SLOTS, PAIRS = 0, 1

for _name in ("mju_error", "mj_warning"):
    binding.add_symbol(_name, ctypes.cast(getattr(library, _name), ctypes.c_void_p).value)
mju_error = types.ExternalFunction("mju_error", types.void(types.int64))
mj_warning = types.ExternalFunction("mj_warning", types.void(types.int64, types.int32, types.int32))


@kernel
def ints(table: Any, owner: int, member: int) -> Any:
    """A member that points to 32-bit integers."""
    return as_ints(as_words(owner + table[member])[0])


@kernel
def doubles(table: Any, owner: int, member: int) -> Any:
    """A member that points to doubles."""
    return as_doubles(as_words(owner + table[member])[0])


@kernel
def _pair_of(words: Any, key: int) -> int:
    """The slot of a key in a table, -1 if it is not there."""
    slots = words[SLOTS]
    k = key & (slots - 1)
    while words[PAIRS + 2 * k] != key:
        if words[PAIRS + 2 * k] == 0:
            return -1
        k = (k + 1) & (slots - 1)
    return int(k)


@kernel
def look_up(address: int, key: int, otherwise: int) -> Any:
    """The value of a key in the table at an address, or another one."""
    words = as_words(address)
    k = _pair_of(words, key)
    return words[PAIRS + 2 * k + 1] if k >= 0 else otherwise


@kernel
def look_up_and_stamp(address: int, key: int, otherwise: int) -> Any:
    """The same in a stamped table; the slot is stamped."""
    words = as_words(address)
    k = _pair_of(words, key)
    if k < 0:
        return otherwise
    slots = words[SLOTS]
    stamp, now = PAIRS + 2 * slots + k, words[PAIRS + 3 * slots]
    if words[stamp] != now:
        words[stamp] = now
    return words[PAIRS + 2 * k + 1]


@kernel
def last_dof(count: Any, parent: Any, first: Any, body: int) -> int:
    """The last degree of freedom that moves a body, -1 if there is none; of body_dofnum, -parentid, -dofadr."""
    while body > 0 and count[body] == 0:
        body = parent[body]
    return first[body] + count[body] - 1 if body > 0 else -1


@kernel
def add_generalised_force(
    dof: int, above: Any, axis: Any, out: Any,
    fx: float, fy: float, fz: float, tx: float, ty: float, tz: float,
) -> None:  # fmt: skip
    """out += J'w: force, and torque about the tree's centre of mass, on a degree of freedom and all above it.

    `above` is dof_parentid, `axis` cdof.
    """
    while dof >= 0:
        k = 6 * dof
        out[dof] += (
            axis[k] * tx + axis[k + 1] * ty + axis[k + 2] * tz
            + axis[k + 3] * fx + axis[k + 4] * fy + axis[k + 5] * fz
        )  # fmt: skip
        dof = above[dof]
