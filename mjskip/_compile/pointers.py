"""Addresses in compiled code: what C does with pointers, for numba kernels.

An address is an int64. Calling a compiled function by its address (rather than by name) keeps each
file's kernels in a cache entry of their own, and makes every engine run the very same machine code.
"""

import ctypes
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils, extending

F8P = types.CPointer(types.float64)


def intrinsic(function: Callable[..., Any]) -> Any:
    """numba's decorator, for a type checker that would take the typing context for an argument."""
    return extending.intrinsic(function)


@intrinsic
def as_doubles(typingctx: Any, address: Any) -> Any:
    """Address of doubles as a pointer that indexes like a C array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.DoubleType().as_pointer())

    return F8P(types.int64), codegen


@intrinsic
def as_singles(typingctx: Any, address: Any) -> Any:
    """Address of single-precision numbers as a pointer that indexes like a C array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.FloatType().as_pointer())

    return types.CPointer(types.float32)(types.int64), codegen


@intrinsic
def address_of(typingctx: Any, array: Any) -> Any:
    """Address of the first element of a contiguous array; the array must stay alive."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        data = context.make_array(signature.args[0])(context, builder, args[0]).data
        return builder.ptrtoint(data, ir.IntType(64))

    return types.int64(array), codegen


@intrinsic
def place_of(typingctx: Any, doubles: Any, index: Any) -> Any:
    """The doubles from an index on, of those behind a pointer."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.gep(args[0], [args[1]])

    return F8P(F8P, types.int64), codegen


@intrinsic
def call_address(typingctx: Any, function: Any, first: Any, second: Any, third: Any) -> Any:
    """Call void(double*, double*, double*) at an address, with three addresses."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        double_p = ir.DoubleType().as_pointer()
        callee = ir.FunctionType(ir.VoidType(), [double_p] * 3)
        pointer = builder.inttoptr(args[0], callee.as_pointer())
        builder.call(pointer, [builder.inttoptr(arg, double_p) for arg in args[1:]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64, types.int64), codegen


@intrinsic
def stack_doubles(typingctx: Any, count: Any) -> Any:
    """Address of `count` doubles on the caller's stack: scratch without a heap, safe in threads.

    Freed when the compiled function returns; not for use in a loop.
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        block = builder.alloca(ir.DoubleType(), size=args[0])
        block.align = 64
        return builder.ptrtoint(block, ir.IntType(64))

    return types.int64(types.int64), codegen


@intrinsic
def as_ints(typingctx: Any, address: Any) -> Any:
    """Address of 32-bit integers as a pointer that indexes like a C array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(32).as_pointer())

    return types.CPointer(types.int32)(types.int64), codegen


@intrinsic
def as_bytes(typingctx: Any, address: Any) -> Any:
    """Address of bytes as a pointer that indexes like a C array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(8).as_pointer())

    return types.CPointer(types.uint8)(types.int64), codegen


@intrinsic
def as_words(typingctx: Any, address: Any) -> Any:
    """Address of 64-bit integers as a pointer that indexes like a C array."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.inttoptr(args[0], ir.IntType(64).as_pointer())

    return types.CPointer(types.int64)(types.int64), codegen


@intrinsic
def bits(typingctx: Any, number: Any) -> Any:
    """The 64 bits of a double as an int64: how an address travels among doubles."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.IntType(64))

    return types.int64(types.float64), codegen


def symbol(name: str, address: int) -> Any:
    """An intrinsic that returns `address` by looking up `name` when code is linked.

    The address changes from process to process, the name does not: code that uses it can be cached
    on disk, where a Python global would be frozen into it.
    """
    import llvmlite.binding

    llvmlite.binding.add_symbol(name, address)

    @intrinsic
    def look_up(typingctx: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            word = ir.IntType(64)
            table = cgutils.add_global_variable(builder.module, word, name)
            table.linkage = "external"
            return builder.ptrtoint(table, word)

        return types.int64(), codegen

    return look_up


def address_of_cfunc(function: Any) -> int:
    """Address of a numba cfunc as an int."""
    return int(ctypes.cast(function.ctypes, ctypes.c_void_p).value or 0)
