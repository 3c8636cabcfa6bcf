"""The inner loop of the water's step, sixteen cells at a time: rows of cells in explicit vectors.

A compiler that finds the vectors by itself loads each row three times, a cell apart, and two of the three
cross a cache line. Here a row is loaded once and its neighbours to the left and right are shifted out of
registers; products and sums are fused. Scalar and vector form are the same operations in the same order,
so that a cell comes out the same to the last bit wherever in a row, a tile or a thread's share it lies.
"""

from itertools import chain
from typing import Any

import llvmlite.binding
from llvmlite import ir
from numba import types
from numba.core import cgutils

from mjskip._compile.pointers import intrinsic

LANES = 16
"""Cells in a vector: one register of the widest machines, a few of any other."""

_FLOAT, _WORD, _INDEX = ir.FloatType(), ir.IntType(64), ir.IntType(32)
_VECTOR, _MASK = ir.VectorType(_FLOAT, LANES), ir.VectorType(ir.IntType(1), LANES)
_LANES_BEFORE = [LANES - 1 + k for k in range(LANES)]
_LANES_AFTER = [1 + k for k in range(LANES)]

_FEATURES = llvmlite.binding.get_host_cpu_features()
_FUSED = _FEATURES.get("fma", "sse2" not in _FEATURES)
"""Whether the machine fuses products and sums: all but x86 from before 2013."""


class _Lines:
    """Writes what is done to numbers or vectors alike."""

    def __init__(self, builder: Any, kind: Any) -> None:
        self.builder, self.kind = builder, kind

    def constant(self, value: float) -> Any:
        scalar = self.kind is _FLOAT
        return ir.Constant(self.kind, value if scalar else [value] * LANES)

    def fused(self, a: Any, b: Any, c: Any) -> Any:
        """a b + c, rounded once."""
        if not _FUSED:
            return self.builder.fadd(self.builder.fmul(a, b), c)
        name = "llvm.fma.f32" if self.kind is _FLOAT else f"llvm.fma.v{LANES}f32"
        function = ir.FunctionType(self.kind, [self.kind] * 3)
        return self.builder.call(
            cgutils.get_or_insert_function(self.builder.module, function, name), [a, b, c]
        )

    def column(self, below: Any, here: Any, above: Any) -> Any:
        """[1 4 1] across rows."""
        return self.fused(self.constant(4.0), here, self.builder.fadd(below, above))

    def next_level(
        self, level: Any, before: Any, columns: tuple[Any, Any, Any], q: Any, sixth: Any
    ) -> Any:
        """level + q (level - before) + sixth ([1 4 1] columns - 36 level)."""
        left, here, right = columns
        four_here = self.builder.fmul(self.constant(4.0), here)  # exact
        middle = self.fused(self.constant(-36.0), level, four_here)
        bend = self.builder.fadd(self.builder.fadd(left, right), middle)
        drift = self.fused(q, self.builder.fsub(level, before), level)
        return self.fused(sixth, bend, drift)


class _Vectors(_Lines):
    """The same, and what only vectors can do."""

    def __init__(self, builder: Any) -> None:
        super().__init__(builder, _VECTOR)

    def splat(self, number: Any) -> Any:
        empty = ir.Constant(_VECTOR, ir.Undefined)
        first = self.builder.insert_element(empty, number, ir.Constant(_INDEX, 0))
        return self.shuffle(first, empty, [0] * LANES)

    def shuffle(self, a: Any, b: Any, lanes: list[int]) -> Any:
        index = ir.Constant(ir.VectorType(_INDEX, LANES), lanes)
        return self.builder.shuffle_vector(a, b, index)

    def lanes_below(self, count: Any) -> Any:
        """Mask of the first `count` lanes."""
        words = ir.VectorType(_INDEX, LANES)
        empty = ir.Constant(words, ir.Undefined)
        count = self.builder.trunc(count, _INDEX)
        first = self.builder.insert_element(empty, count, ir.Constant(_INDEX, 0))
        counts = self.builder.shuffle_vector(first, empty, ir.Constant(words, [0] * LANES))
        return self.builder.icmp_unsigned("<", ir.Constant(words, list(range(LANES))), counts)

    def _place(self, data: Any, at: Any) -> Any:
        return self.builder.bitcast(self.builder.gep(data, [at]), _VECTOR.as_pointer())

    def load(self, data: Any, at: Any, mask: Any = None) -> Any:
        place = self._place(data, at)
        if mask is None:
            loaded = self.builder.load(place)
            loaded.align = 4
            return loaded
        function = ir.FunctionType(_VECTOR, [place.type, _INDEX, _MASK, _VECTOR])
        name = f"llvm.masked.load.v{LANES}f32.p0"
        masked = cgutils.get_or_insert_function(self.builder.module, function, name)
        return self.builder.call(masked, [place, ir.Constant(_INDEX, 4), mask, self.constant(0.0)])

    def store(self, value: Any, data: Any, at: Any, mask: Any = None) -> None:
        place = self._place(data, at)
        if mask is None:
            self.builder.store(value, place).align = 4
            return
        function = ir.FunctionType(ir.VoidType(), [_VECTOR, place.type, _INDEX, _MASK])
        name = f"llvm.masked.store.v{LANES}f32.p0"
        masked = cgutils.get_or_insert_function(self.builder.module, function, name)
        self.builder.call(masked, [value, place, ir.Constant(_INDEX, 4), mask])


@intrinsic
def column_sum(typingctx: Any, below: Any, here: Any, above: Any) -> Any:
    """below + 4 here + above, as `step_rows` sums columns: for the cells beside its rows."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return _Lines(builder, _FLOAT).column(*args)

    return types.float32(types.float32, types.float32, types.float32), codegen


# Over 80 lines: it holds its code generator, which writes one loop for LLVM.
@intrinsic
def step_rows(
    typingctx: Any, z: Any, starts: Any, out: Any, n: Any, left: Any, right: Any, q: Any, sixth: Any
) -> Any:
    """out = z + q (z - out) + sixth ([1 4 1]^T [1 4 1] - 36) z in one or more rows of n cells.

    Args:
        z, out: float32, one dimension, contiguous; nothing outside the rows is touched.
        starts: where the row below the first one starts, the rows, and the one above the last: a tuple of
            indices into z; into out too, for the rows themselves.
        n: cells in a row, at least 1.
        left, right: the `column_sum` beside each row, tuples.
        q, sixth: float32.
    """
    count = len(starts) - 2

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        z, starts, out, n, left, right, q, sixth = args
        source, target = (
            context.make_array(kind)(context, builder, array).data
            for kind, array in ((signature.args[0], z), (signature.args[2], out))
        )
        write = _Vectors(builder)
        rows = range(count)
        at = [builder.extract_value(starts, r) for r in range(count + 2)]
        left, right = (
            [write.splat(builder.extract_value(side, r)) for r in rows] for side in (left, right)
        )
        q, sixth = write.splat(q), write.splat(sixth)
        one, lanes = ir.Constant(_WORD, 1), ir.Constant(_WORD, LANES)
        whole = builder.udiv(builder.sub(n, one), lanes)  # vectors but the last
        rest = write.lanes_below(builder.sub(n, builder.mul(whole, lanes)))

        def levels_and_columns(j: Any, mask: Any = None) -> tuple[list[Any], list[Any]]:
            z = [write.load(source, builder.add(start, j), mask) for start in at]
            sums = [write.column(*z[r : r + 3]) for r in rows]
            if mask is not None:
                sums = [builder.select(mask, sums[r], right[r]) for r in rows]
            return z[1:-1], sums

        def update(j: Any, level: Any, columns: tuple[Any, Any, Any], r: int, mask: Any) -> None:
            before, here, after = columns
            beside = (
                write.shuffle(before, here, _LANES_BEFORE),
                here,
                write.shuffle(here, after, _LANES_AFTER),
            )
            place = builder.add(at[r + 1], j)
            old = write.load(target, place, mask)
            write.store(write.next_level(level, old, beside, q, sixth), target, place, mask)

        # A vector is updated when the next one's columns are known; the last one is loaded masked.
        last_only = builder.icmp_unsigned("==", whole, ir.Constant(_WORD, 0))
        names = ("first", "many", "loop", "before_last", "last")
        first, many, loop, before_last, last = map(builder.append_basic_block, names)
        builder.cbranch(last_only, first, many)

        builder.position_at_end(first)
        zero = ir.Constant(_WORD, 0)
        only = levels_and_columns(zero, rest)
        builder.branch(last)

        builder.position_at_end(many)
        start = levels_and_columns(zero)
        stop = builder.mul(whole, lanes)
        builder.branch(loop)

        def phis(*lists: list[Any]) -> list[list[Any]]:
            return [[builder.phi(_VECTOR) for _ in values] for values in lists]

        def incoming(to: list[list[Any]], values: tuple[list[Any], ...], block: Any) -> None:
            for phi, value in zip(chain(*to), chain(*values), strict=True):
                phi.add_incoming(value, block)

        builder.position_at_end(loop)
        j = builder.phi(_WORD)
        carried = phis(left, *start)
        before, level, here = carried
        j.add_incoming(zero, many)
        incoming(carried, (left, *start), many)
        after_j = builder.add(j, lanes)
        is_last = builder.icmp_unsigned("==", after_j, stop)
        body = builder.append_basic_block("body")
        builder.cbranch(is_last, before_last, body)

        builder.position_at_end(body)
        next_level, after = levels_and_columns(after_j)
        for r in rows:
            update(j, level[r], (before[r], here[r], after[r]), r, None)
        j.add_incoming(after_j, body)
        incoming(carried, (here, next_level, after), body)
        builder.branch(loop)

        builder.position_at_end(before_last)
        final = levels_and_columns(stop, rest)
        for r in rows:
            update(j, level[r], (before[r], here[r], final[1][r]), r, None)
        builder.branch(last)

        builder.position_at_end(last)
        j = builder.phi(_WORD)
        carried = phis(left, *only)
        j.add_incoming(zero, first)
        incoming(carried, (left, *only), first)
        j.add_incoming(stop, before_last)
        incoming(carried, (here, *final), before_last)
        before, level, here = carried
        for r in rows:
            update(j, level[r], (before[r], here[r], right[r]), r, rest)
        return context.get_dummy_value()

    sides = types.UniTuple(types.float32, count)
    signature = types.void(
        z, types.UniTuple(types.int64, count + 2), out, types.int64, sides, sides,
        types.float32, types.float32,
    )  # fmt: skip
    return signature, codegen
