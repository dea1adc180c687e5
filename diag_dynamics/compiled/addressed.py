# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays at an address, or of another one's numbers in a row, made without a call to numba's own; and addresses of arrays."""

import numba
from numba.core import cgutils, types
from numba.extending import intrinsic

from diag_dynamics.compiled.lent import Lent
from diag_dynamics.compiled.lowering import packed_array


def array_at(dtype, ndim, lent=False):
    """Kernel (address, shape) that gives the C-contiguous array of numba type `dtype` that lies at an address.

    That of lanes must be a multiple of their size. One that is `lent` is of the type that entry kernels take, so that what is
    compiled for these need not be compiled again.
    """
    array = Lent(dtype, ndim) if lent else types.Array(dtype, ndim, "C")

    @intrinsic
    def at(typingctx, address, shape):
        def lower(context, builder, sig, args):
            return _array(context, builder, array, args[0], cgutils.unpack_tuple(builder, args[1], ndim))

        return array(types.intp, types.UniTuple(types.intp, ndim)), lower

    return at


def table_at(row, dtype, kinds):
    """Kernel (address) that gives a named tuple of the numbers and arrays that a table at an address tells of.

    Parameters
    ----------
    row : type
        The named tuple, whose name no other table's has.
    dtype : dtype
        How the table lies in memory: a number, or the address and the extents of an array, for each field.
    kinds : sequence of (numba type, int, int or None) or None
        What each array holds, its number of dimensions, and its last extent, if that is known; None for a number.
    """
    fields = []  # type, offset and last extent of each
    for name, kind in zip(row._fields, kinds, strict=True):
        of, offset = dtype.fields[name]
        fields.append((_array_type(*kind[:2]), offset, kind[2]) if kind else (numba.from_dtype(of), offset, None))
    opened = types.NamedTuple([kind for kind, _, _ in fields], row)

    @intrinsic
    def at(typingctx, address):
        def lower(context, builder, sig, args):
            def read(kind, offset):
                place = builder.add(args[0], context.get_constant(types.intp, offset))
                return builder.load(builder.inttoptr(place, context.get_value_type(kind).as_pointer()))

            def value(kind, offset, last):
                if not isinstance(kind, types.Array):
                    return read(kind, offset)
                address, *shape = (read(types.intp, offset + 8 * k) for k in range(1 + kind.ndim))
                if last is not None:
                    shape[-1] = context.get_constant(types.intp, last)
                return _array(context, builder, kind, address, shape)

            return context.make_tuple(builder, opened, [value(*field) for field in fields])

        return opened(types.intp), lower

    return at


def _array_type(dtype, ndim):
    """Type by which kernels take such an array: one of numbers as entry kernels do, or it would be compiled for anew."""
    return Lent(dtype, ndim) if dtype == types.float64 else types.Array(dtype, ndim, "C")


def _array(context, builder, array, address, shape):
    """Array of this type at an address."""
    size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(array.dtype)))
    strides = [size]
    for extent in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], extent))
    data = builder.inttoptr(address, context.get_data_type(array.dtype).as_pointer())
    return packed_array(context, builder, array, data, shape, strides)


@intrinsic
def address_of(typingctx, array):
    """Where the numbers of an array begin."""

    def lower(context, builder, sig, args):
        data = context.make_array(array)(context, builder, args[0]).data
        return builder.ptrtoint(data, context.get_value_type(types.intp))

    return types.intp(array), lower


@intrinsic
def flat(typingctx, array):
    """All numbers of a C-contiguous array in a row; numba's `ravel` takes half a second to compile."""
    row = Lent(array.dtype, 1)

    def lower(context, builder, sig, args):
        given, fields = args[0], context.data_model_manager[array]
        data, shape = (builder.extract_value(given, fields.get_field_position(name)) for name in ("data", "shape"))
        count = context.get_constant(types.intp, 1)
        for extent in cgutils.unpack_tuple(builder, shape, array.ndim):
            count = builder.mul(count, extent)
        size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(array.dtype)))
        return packed_array(context, builder, row, data, [count], [size])

    return row(array), lower
