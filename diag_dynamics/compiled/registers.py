# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers side by side in a vector register, calculated with as if they were one.

A kernel that is written for numbers works on :data:`EIGHT` unchanged. Arithmetic acts on each lane, and a number among
lanes stands for as many equal ones. A comparison holds if it holds in every lane, and so does all else that yields a bool:
control flow is common to all. No operation is reordered or fused, so each lane has the bits that it would have alone.
"""

import math
import operator

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types, typing
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global
from numba.extending import intrinsic, lower_builtin, lower_cast, register_model

_DOUBLE, _INT = ir.DoubleType(), ir.IntType(32)


class Lanes(types.Type):
    """numba's type of several float64 in a vector register."""

    def __init__(self, width):
        super().__init__(name=f"lanes{width}")
        self.width, self.bitwidth = width, 64 * width

    @property
    def vector(self):
        """Type that LLVM knows them by."""
        return ir.VectorType(_DOUBLE, self.width)

    def can_convert_from(self, typingctx, other):
        """Accept numbers."""
        return Conversion.safe if isinstance(other, (types.Float, types.Integer)) else None

    def unify(self, typingctx, other):
        """Where control flow joins, numbers become lanes."""
        return self if isinstance(other, (types.Float, types.Integer)) else None


WIDTH = 8
"""Lanes of :data:`EIGHT`."""

FOUR, EIGHT = Lanes(4), Lanes(WIDTH)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm, fe_type):
        super().__init__(dmm, fe_type, fe_type.vector)


# --- In and out ---------------------------------------------------------------------------------------------


@lower_cast(types.Float, Lanes)
@lower_cast(types.Integer, Lanes)
def _cast(context, builder, fromty, toty, val):
    return _splat(builder, toty, context.cast(builder, val, fromty, types.float64))


def _splat(builder, lanes, number):
    nothing = ir.Constant(lanes.vector, ir.Undefined)
    first = builder.insert_element(nothing, number, _INT(0))
    return builder.shuffle_vector(first, nothing, _indices([0] * lanes.width))


def _indices(indices):
    return ir.Constant(ir.VectorType(_INT, len(indices)), indices)


def spreader(lanes):
    """Kernel (number) that gives lanes of it."""

    @intrinsic
    def spread(typingctx, number):
        return lanes(types.float64), lambda _, builder, __, args: _splat(builder, lanes, args[0])

    return spread


@intrinsic
def nought(typingctx, like):
    """Zero of the kind of a number, of lanes, or of what an array holds."""
    kind = like.dtype if isinstance(like, types.Array) else like
    return kind(like), lambda context, builder, sig, args: context.get_constant_null(kind)


@intrinsic
def side_by_side(typingctx, numbers):
    """Lanes of a tuple of numbers."""
    lanes = Lanes(numbers.count)

    def lower(_, builder, __, args):
        x = ir.Constant(lanes.vector, ir.Undefined)
        for lane in range(lanes.width):
            x = builder.insert_element(x, builder.extract_value(args[0], lane), _INT(lane))
        return x

    return lanes(numbers), lower


@intrinsic
def numbers_of(typingctx, x):
    """Tuple of the numbers in lanes."""
    numbers = types.UniTuple(types.float64, x.width)

    def lower(context, builder, __, args):
        lanes = [builder.extract_element(args[0], _INT(lane)) for lane in range(x.width)]
        return context.make_tuple(builder, numbers, lanes)

    return numbers(x), lower


@intrinsic
def lane_of(typingctx, x, lane):
    """Return the number in one lane."""
    return types.float64(x, types.intp), lambda _, builder, __, args: builder.extract_element(*args)


@intrinsic
def with_lane(typingctx, x, lane, number):
    """Return x with another number in one lane."""

    def lower(_, builder, __, args):
        x, lane, number = args
        return builder.insert_element(x, number, lane)

    return x(x, types.intp, types.float64), lower


def loader(lanes, step=8):
    """Kernel (a) that reads a 3x3 matrix of lanes, `step` numbers from one entry to the next, from an array of numbers."""

    @intrinsic
    def load(typingctx, a):
        row = types.UniTuple(lanes, 3)

        def lower(context, builder, sig, args):
            entries = [
                builder.load(at, align=8) for at in _entries(context, builder, lanes, step, sig.args[0], args[0])
            ]
            rows = [context.make_tuple(builder, row, entries[first : first + 3]) for first in (0, 3, 6)]
            return context.make_tuple(builder, sig.return_type, rows)

        return types.UniTuple(row, 3)(a), lower

    return load


@intrinsic
def store(typingctx, a, M):
    """Write a 3x3 matrix of lanes where a :func:`loader` of step 8 would read it."""

    def lower(context, builder, sig, args):
        places = _entries(context, builder, M.dtype.dtype, 8, sig.args[0], args[0])
        for k, at in enumerate(places):
            builder.store(builder.extract_value(args[1], [k // 3, k % 3]), at, align=8)
        return context.get_dummy_value()

    return types.void(a, M), lower


def _entries(context, builder, lanes, step, array, value):
    """Where the nine entries of a matrix are."""
    data = context.make_array(array)(context, builder, value).data
    return [
        builder.bitcast(builder.gep(data, [context.get_constant(types.intp, step * k)]), lanes.vector.as_pointer())
        for k in range(9)
    ]


@intrinsic
def lanes_at(typingctx, a, k):
    """Numbers of a contiguous vector from index k on, as :data:`EIGHT`."""

    def lower(context, builder, sig, args):
        return builder.load(_place(context, builder, sig.args[0], *args), align=8)

    return EIGHT(a, types.intp), lower


@intrinsic
def set_lanes(typingctx, a, k, x):
    """Write lanes where :func:`lanes_at` would read them."""

    def lower(context, builder, sig, args):
        builder.store(args[2], _place(context, builder, sig.args[0], *args[:2]), align=8)
        return context.get_dummy_value()

    return types.void(a, types.intp, EIGHT), lower


@intrinsic
def set_lanes_from(typingctx, a, k, x, first):
    """As :func:`set_lanes`, of the lanes from `first` on; the others need no place in the vector."""

    def lower(context, builder, sig, args):
        at, mask = _place(context, builder, sig.args[0], *args[:2]), _from(builder, args[3])
        signature = ir.FunctionType(ir.VoidType(), [EIGHT.vector, at.type, _INT, mask.type])
        write = cgutils.get_or_insert_function(
            builder.module, signature, f"llvm.masked.store.v{WIDTH}f64.p0v{WIDTH}f64"
        )
        builder.call(write, [args[2], at, _INT(8), mask])
        return context.get_dummy_value()

    return types.void(a, types.intp, EIGHT, types.intp), lower


@intrinsic
def from_lane(typingctx, first, x, y):
    """Lanes of x from `first` on, of y before."""

    def lower(_, builder, __, args):
        return builder.select(_from(builder, args[0]), *args[1:])

    return EIGHT(types.intp, EIGHT, EIGHT), lower


def _place(context, builder, array, value, k):
    """Where lanes begin in a vector of numbers."""
    data = context.make_array(array)(context, builder, value).data
    return builder.bitcast(builder.gep(data, [k]), EIGHT.vector.as_pointer())


def _from(builder, first):
    """Which lanes come at `first` or later."""
    lanes = ir.VectorType(first.type, WIDTH)
    nothing = ir.Constant(lanes, ir.Undefined)
    spread = builder.insert_element(nothing, first, _INT(0))
    spread = builder.shuffle_vector(spread, nothing, _indices([0] * WIDTH))
    return builder.icmp_signed(">=", ir.Constant(lanes, list(range(WIDTH))), spread)


def mover(*sources):
    """Kernel (M) that fills each lane of a 3x3 matrix with another lane's numbers, or with zeros where the source is None.

    Sources are those of the first four lanes; the next four do the same among themselves.
    """

    @intrinsic
    def move(typingctx, M):
        lanes = M.dtype.dtype
        indices = [
            lanes.width if source is None else first + source
            for first in range(0, lanes.width, len(sources))
            for source in sources
        ]
        return M(M), _of_entries(lanes, indices)

    return move


def _of_entries(lanes, indices):
    def lower(_, builder, __, args):
        M, zeros = args[0], ir.Constant(lanes.vector, [0.0] * lanes.width)
        for at in [(i, j) for i in range(3) for j in range(3)]:
            moved = builder.shuffle_vector(builder.extract_value(M, at), zeros, _indices(indices))
            M = builder.insert_value(M, moved, at)
        return M

    return lower


def chooser(*second):
    """Kernel (x, y) that takes lanes of y where `second` says so and of x elsewhere; by fours as :func:`mover`."""

    @intrinsic
    def choose(typingctx, x, y):
        pattern = list(second) * (x.width // len(second))
        indices = _indices([lane + x.width * from_y for lane, from_y in enumerate(pattern)])
        return x(x, x), lambda _, builder, __, args: builder.shuffle_vector(*args, indices)

    return choose


def record_of_lanes(dtype, lanes):
    """Type of a record that has lanes where one of a NumPy dtype has numbers; offsets and size grow by their width."""
    fields = []
    for name, (of, offset) in dtype.fields.items():
        shape = of.shape if of.subdtype else ()
        fields.append(
            (name, {"type": types.NestedArray(lanes, shape) if shape else lanes, "offset": offset * lanes.width})
        )
    return _RecordOfLanes(fields, dtype.itemsize * lanes.width, aligned=True)


class _RecordOfLanes(types.Record):
    @property
    def dtype(self):
        return np.dtype((np.void, self.size))  # NumPy has no lanes


register_model(_RecordOfLanes)(models.RecordModel)

# --- Arithmetic ---------------------------------------------------------------------------------------------


def _operation(function, arity, lower, result=None):
    """Teach numba a function of lanes; it gives lanes, too, unless said otherwise."""

    @infer_global(function)
    class Operation(AbstractTemplate):
        def generic(self, args, kws):
            lanes = next((arg for arg in args if isinstance(arg, Lanes)), None)
            others = [arg for arg in args if arg != lanes]
            if (
                lanes is None
                or len(args) != arity
                or not all(isinstance(arg, (types.Float, types.Integer)) for arg in others)
            ):
                return None
            return typing.signature(result or lanes, *[lanes] * arity)

    @lower_builtin(function, *[Lanes] * arity)
    def _(context, builder, sig, args):
        return lower(context, builder, sig.args[0], *args)


def _instruction(name):
    return lambda _, builder, __, *args: getattr(builder, name)(*args)


def _comparison(sign):
    return lambda _, builder, __, x, y: _all(builder, builder.fcmp_ordered(sign, x, y))


def _all(builder, mask):
    bits = ir.IntType(mask.type.count)
    return builder.icmp_unsigned("==", builder.bitcast(mask, bits), bits(2**mask.type.count - 1))


def _intrinsic_of_llvm(name):
    def lower(_, builder, lanes, x):
        signature = ir.FunctionType(lanes.vector, [lanes.vector])
        return builder.call(
            cgutils.get_or_insert_function(builder.module, signature, f"llvm.{name}.v{lanes.width}f64"), [x]
        )

    return lower


def _is_finite(_, builder, lanes, x):
    return _all(builder, builder.fcmp_ordered("==", builder.fsub(x, x), ir.Constant(lanes.vector, [0.0] * lanes.width)))


def _larger(_, builder, __, x, y):
    return builder.select(builder.fcmp_ordered(">", x, y), x, y)


for _functions, _name in (
    ((operator.add, operator.iadd), "fadd"),
    ((operator.sub, operator.isub), "fsub"),
    ((operator.mul, operator.imul), "fmul"),
    ((operator.truediv, operator.itruediv), "fdiv"),
):
    for _function in _functions:
        _operation(_function, 2, _instruction(_name))
_operation(operator.neg, 1, _instruction("fneg"))
_operation(operator.lt, 2, _comparison("<"), types.boolean)
_operation(max, 2, _larger)
_operation(abs, 1, _intrinsic_of_llvm("fabs"))
_operation(math.sqrt, 1, _intrinsic_of_llvm("sqrt"))
_operation(math.isfinite, 1, _is_finite, types.boolean)
