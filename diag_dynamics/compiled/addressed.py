"""Arrays at an address, or of another one's numbers in a row, made without a call to numba's own; and addresses of arrays."""

from numba.core import cgutils, types
from numba.extending import intrinsic

from diag_dynamics.compiled.lent import Lent


def array_at(dtype, ndim, lent=False):
    """Kernel (address, shape) that gives the C-contiguous array of numba type `dtype` that lies at an address.

    That of lanes must be a multiple of their size. One that is `lent` is of the type that entry kernels take, so that what is
    compiled for these need not be compiled again.
    """
    array = Lent(dtype, ndim) if lent else types.Array(dtype, ndim, "C")

    @intrinsic
    def at(typingctx, address, shape):
        def lower(context, builder, sig, args):
            from numba.np.arrayobj import populate_array  # half of numba, which only who compiles has to wait for

            result = context.make_array(array)(context, builder)
            size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(dtype)))
            shape, strides = cgutils.unpack_tuple(builder, args[1], ndim), [size]
            for extent in reversed(shape[1:]):
                strides.insert(0, builder.mul(strides[0], extent))
            populate_array(
                result,
                data=builder.inttoptr(args[0], result.data.type),
                shape=shape,
                strides=strides,
                itemsize=size,
                meminfo=None,
            )
            return result._getvalue()

        return array(types.intp, types.UniTuple(types.intp, ndim)), lower

    return at


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
        from numba.np.arrayobj import populate_array

        source, result = context.make_array(array)(context, builder, args[0]), context.make_array(row)(context, builder)
        count, size = context.get_constant(types.intp, 1), source.itemsize
        for extent in cgutils.unpack_tuple(builder, source.shape, array.ndim):
            count = builder.mul(count, extent)
        populate_array(result, data=source.data, shape=[count], strides=[size], itemsize=size, meminfo=None)
        return result._getvalue()

    return row(array), lower
