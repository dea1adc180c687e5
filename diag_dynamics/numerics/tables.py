# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Structs of numbers and arrays that a kernel receives as one pointer."""

import functools
import operator

import numba
import numpy as np
from numba import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, intrinsic, lower_getattr_generic, models, register_model

from diag_dynamics.numerics.kernel import array_kernel, kernel


@functools.cache
def array_at(dtype, ndim):
    """Return a kernel (address, shape) that returns the C-contiguous array at an address."""
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


@functools.cache
def type_of(dtype):
    """Return numba's type of a dtype, which takes 0.1 ms to find for a record."""
    return numba.from_dtype(dtype)


def array(dtype, ndim=1):
    """Field of a Table: a C-contiguous array of numbers or records."""
    return types.Array(type_of(np.dtype(dtype)), ndim, "C")


class Table:
    """Declaration of a table: Python writes it and kernels read it by the same names.

    Its fields are :class:`int`, :class:`float` or an :func:`array`; numba distinguishes types of
    tables by `name`. The kernel `opened` of the address of a table returns the table, with its
    fields as attributes. Only those fields are read and compiled that are used.
    """

    def __init__(self, name, /, **fields):
        self.fields = fields
        self.dtype = np.dtype(
            [
                (field, np.int64, (1 + kind.ndim,))
                if isinstance(kind, types.Array)
                else (field, np.dtype(kind))
                for field, kind in fields.items()
            ]
        )
        places = {}
        for field, kind in fields.items():
            number = kind if isinstance(kind, types.Array) else numba.from_dtype(np.dtype(kind))
            places[field] = number, self.dtype.fields[field][1]
        self.opened = _opener(Reference(name, places))


class Reference(types.Opaque):
    """A table as kernels see it: its address. `fields` has type and offset of each."""

    def __init__(self, name, fields):
        super().__init__(f"Table({name})")
        self.fields = fields


register_model(Reference)(models.OpaqueModel)


@infer_getattr
class Fields(AttributeTemplate):
    """Types of the fields of a table."""

    key = Reference

    def generic_resolve(self, table, name):
        """Return the type of a field, or None."""
        return table.fields.get(name, (None,))[0]


@lower_getattr_generic(Reference)
def _read_field(context, builder, table, address, name):
    """Read a field. No kernel writes it: LLVM may read it once for a loop."""
    kind, offset = table.fields[name]
    is_array = isinstance(kind, types.Array)
    pointer = context.get_value_type(types.CPointer(types.intp if is_array else kind))
    entry = builder.gep(address, [context.get_constant(types.intp, offset)])
    first = builder.bitcast(entry, pointer)
    values = []
    for k in range(1 + kind.ndim if is_array else 1):
        value = builder.load(builder.gep(first, [context.get_constant(types.intp, k)]))
        value.set_metadata("invariant.load", builder.module.add_metadata([]))
        values.append(value)
    if not is_array:
        return values[0]
    size = context.get_abi_sizeof(context.get_data_type(kind.dtype))
    strides = [context.get_constant(types.intp, size)]
    for length in reversed(values[2:]):
        strides.insert(0, builder.mul(strides[0], length))
    array = context.make_array(kind)(context, builder)
    data = builder.inttoptr(values[0], array.data.type)
    context.populate_array(
        array, data=data, shape=values[1:], strides=strides, itemsize=size, meminfo=None
    )
    return array._getvalue()


def _opener(table):
    """Kernel (address) that returns a table."""

    @intrinsic
    def opened(typingctx, address):
        def lower(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(table))

        return table(types.intp), lower

    return opened


class Addresses:
    """A table at the address `at`, and the arrays whose addresses are in it.

    TypeError if a field has another type.
    """

    def __init__(self, table, /, **entries):
        if entries.keys() != table.fields.keys():
            raise TypeError(
                f"the fields are {', '.join(entries)}; expected {', '.join(table.fields)}"
            )
        self._arrays = entries
        self._memory = np.zeros(1, table.dtype)
        self.at = self._memory.ctypes.data
        for name, field in table.fields.items():
            entry = entries[name]
            if not isinstance(field, types.Array):
                self._memory[name] = operator.index(entry) if field is int else entry
                continue
            if not entry.flags.c_contiguous or entry.ndim != field.ndim:
                raise TypeError(f"{name} has shape {entry.shape}; expected {field} in C order")
            if type_of(entry.dtype) != field.dtype:
                raise TypeError(f"{name} is {entry.dtype}; expected {field}")
            self._memory[name] = entry.ctypes.data, *entry.shape
