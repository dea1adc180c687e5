# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays that are taken from Python at half the cost: those that a kernel reads, and those that it fills."""

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.datamodel import models
from numba.core.typeconv import Conversion
from numba.core.typeconv.rules import default_type_manager
from numba.extending import NativeValue, lower_cast, register_model, unbox


class Lent(types.Array):
    """numba's type of a C-contiguous array that its caller keeps alive: taken at half the cost of an array that is shared.

    Of an entry kernel it is what the kernel reads: read-only arrays will do, as results are.
    """

    def __init__(self, dtype, ndim):
        super().__init__(dtype, ndim, "C", name=f"lent({dtype}, {ndim})")


class Filled(types.Array):
    """The same of an array that an entry kernel writes: what is read-only is refused, by a TypeError."""

    def __init__(self, dtype, ndim):
        super().__init__(dtype, ndim, "C", name=f"filled({dtype}, {ndim})")


register_model(Lent)(models.ArrayModel)
register_model(Filled)(models.ArrayModel)


@unbox(Lent)
@unbox(Filled)
def _borrow(array, value, c):
    """What numba does with arrays where it counts no references."""
    native = c.context.make_array(array)(c.context, c.builder)
    place = c.builder.bitcast(native._getpointer(), c.pyapi.voidptr)
    signature = ir.FunctionType(ir.IntType(32), [c.pyapi.pyobj, c.pyapi.voidptr])
    failed = c.builder.call(c.pyapi._get_function(signature, name="numba_adapt_ndarray"), (value, place))
    return NativeValue(native._getvalue(), is_error=cgutils.is_not_null(c.builder, failed))


@lower_cast(types.Array, Lent)
@lower_cast(Filled, Lent)
def _lend(context, builder, fromty, toty, val):
    return val


@lower_cast(Lent, types.Array)
@lower_cast(Filled, types.Array)
def _keep(context, builder, fromty, toty, val):
    return val


def lent(kind):
    """The type by which kernels take an argument: a contiguous array of numbers is as good as a :class:`Lent` one.

    Slices and arrays at an address are none, nor is one that an entry fills; without this, what takes them is compiled once
    more.
    """
    plain = type(kind) in (types.Array, Filled) and kind.layout == "C" and kind.mutable and kind.aligned
    return Lent(kind.dtype, kind.ndim) if plain and kind.dtype == types.float64 else kind


for _ndim in (1, 2, 3):
    # Results are read-only. Without this line an entry kernel refuses them as arguments, after 60 µs of looking for code.
    _read_only = types.Array(numba.float64, _ndim, "C", readonly=True)
    default_type_manager.set_compatible(_read_only, Lent(numba.float64, _ndim), Conversion.safe)
