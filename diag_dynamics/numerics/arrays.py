# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Arrays in kernels: at an address, and flattened; and the address of an array."""

import functools

import numba
from numba import types
from numba.extending import intrinsic

from diag_dynamics.numerics.kernel import array_kernel, kernel


@functools.cache
def array_at(dtype, ndim):
    """Kernel (address, shape) that returns the C-contiguous array of numba type `dtype` at an address."""
    pointer_type = types.CPointer(dtype)

    @intrinsic
    def pointer(typingctx, address):
        def lower(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(pointer_type))

        return pointer_type(types.intp), lower

    @array_kernel
    def at(address, shape):
        return numba.carray(pointer(address), shape)

    return at


@kernel
def address_of(array):
    """Address of the first number of an array."""
    return array.ctypes.data


@array_kernel
def flat(array):
    """All numbers of a C-contiguous array as a vector."""
    return array.reshape(array.size)
