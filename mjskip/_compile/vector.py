"""What lets a loop over many faces run in vector registers: choices without branches, logarithms without calls."""

from typing import Any

from llvmlite import ir
from numba import types

from mjskip._compile.jit import inlined
from mjskip._compile.pointers import bits, intrinsic


@intrinsic
def select(typingctx: Any, condition: Any, yes: Any, no: Any) -> Any:
    """`yes` if the condition holds, else `no`; both are worked out, and nothing branches."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.select(*args)

    return types.float64(types.boolean, types.float64, types.float64), codegen


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


@inlined
def log10(x: float) -> float:
    """Logarithm of a finite x >= 1, to a unit or two in the last place.

    x = 2^e m with m between sqrt(1/2) and sqrt(2), and ln m = 2 (s + s^3/3 + ...), s = (m - 1) / (m + 1).
    """
    word = bits(x) - ROOT_HALF
    power = word >> 52
    m = _double_of(bits(x) - (power << 52))
    s = (m - 1.0) / (m + 1.0)
    q = s * s  # at most 0.0295: the term left out is below 1e-17 of the first
    t = q * (1 / 13 + q * (1 / 15 + q * (1 / 17 + q / 19)))
    t = q * (1 / 3 + q * (1 / 5 + q * (1 / 7 + q * (1 / 9 + q * (1 / 11 + t)))))
    whole = _double_of(MAGIC + power) - 4503599627370496.0
    found: float = LOG10_E * (2.0 * (s + s * t) + LN_2 * whole)
    return found
