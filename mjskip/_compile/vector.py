"""What lets a loop over many faces run in vector registers: choices without branches, logarithms without calls."""

from typing import Any

from llvmlite import ir
from numba import types

from mjskip._compile.jit import inlined
from mjskip._compile.pointers import F8P, bits, intrinsic


@intrinsic
def select(typingctx: Any, condition: Any, yes: Any, no: Any) -> Any:
    """`yes` if the condition holds, else `no`; both are worked out, and nothing branches."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.select(*args)

    return types.float64(types.boolean, types.float64, types.float64), codegen


@intrinsic
def copy_vector(typingctx: Any, target: Any, source: Any) -> Any:
    """Copy eight doubles from one pointer to another."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        vector = ir.VectorType(ir.DoubleType(), 8).as_pointer()
        to, of = (builder.bitcast(arg, vector) for arg in args)
        builder.store(builder.load(of, align=8), to, align=8)
        return context.get_dummy_value()

    return types.void(F8P, F8P), codegen


@intrinsic
def lowest_byte(typingctx: Any, word: Any) -> Any:
    """Which of the eight bytes of a word, that is not zero, is the first that is not."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        zeros = builder.cttz(args[0], ir.Constant(ir.IntType(1), 1))
        return builder.lshr(zeros, ir.Constant(zeros.type, 3))

    return types.int64(types.int64), codegen


@intrinsic
def _double_of(typingctx: Any, word: Any) -> Any:
    """The double that these 64 bits are."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.bitcast(args[0], ir.DoubleType())

    return types.float64(types.int64), codegen


ROOT_HALF = 0x3FE6A09E667F3BCD  # bits of sqrt(1/2)
MAGIC = 0x4330000000000000  # bits of 2^52, whose last place is 1
LN_2 = 0.6931471805599453
LOG10_E = 0.4342944819032518


ATANH = (
    0.666666666666667,
    0.399999999998994,
    0.28571428626020057,
    0.22222211127910602,
    0.18182889606249983,
    0.15331706149703653,
    0.14616635201998912,
)
"""Polynomial in q = s^2 through Chebyshev's nodes, within 1e-17 of (2 atanh(s) - 2 s) / s^3 for q up to 0.0295."""


@inlined
def log10(x: float) -> float:
    """Logarithm of a finite x >= 1, to a unit or two in the last place.

    x = 2^e m with m between sqrt(1/2) and sqrt(2), and ln m = 2 atanh(s), s = (m - 1) / (m + 1).
    """
    word = bits(x) - ROOT_HALF
    power = word >> 52
    m = _double_of(bits(x) - (power << 52))
    s = (m - 1.0) / (m + 1.0)
    q = s * s
    t = ATANH[3] + q * (ATANH[4] + q * (ATANH[5] + q * ATANH[6]))
    t = q * (ATANH[0] + q * (ATANH[1] + q * (ATANH[2] + q * t)))
    whole = _double_of(MAGIC + power) - 4503599627370496.0
    found: float = LOG10_E * (2.0 * s + s * t + LN_2 * whole)
    return found
