# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Structs of numbers and arrays that a kernel receives as one pointer."""

import functools
import operator
from collections import namedtuple
from typing import NamedTuple

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic

from diag_dynamics.numerics.kernel import array_kernel, kernel, linking


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


class Array(NamedTuple):
    """Field of a Table: a C-contiguous array."""

    dtype: np.dtype
    ndim: int


def array(dtype, ndim=1):
    """Field of a Table: a C-contiguous array of numbers or records."""
    return Array(np.dtype(dtype), ndim)


class Table:
    """Declaration of a table: Python writes it and kernels read it by the same names.

    Its fields are :class:`int`, :class:`float` or an :func:`array`; numba distinguishes types of
    tables by `name`. The kernel `opened` of the address of a table returns the table, with its
    fields as attributes. Only those fields are read that are used.
    """

    def __init__(self, name, /, **fields):
        self.fields = fields
        self.dtype = np.dtype(
            [
                (field, np.int64, (1 + kind.ndim,))
                if isinstance(kind, Array)
                else (field, np.dtype(kind))
                for field, kind in fields.items()
            ]
        )
        self.opened = (_reader if linking is None else _lazy_reader)(name, fields, self.dtype)


def _lazy_reader(name, fields, dtype):
    """Kernel (address) that returns a table whose fields are compiled where they are used."""
    places = {}
    for field, kind in fields.items():
        number = numba.from_dtype(np.dtype(kind.dtype if isinstance(kind, Array) else kind))
        is_array = isinstance(kind, Array)
        field_type = types.Array(number, kind.ndim, "C") if is_array else number
        places[field] = field_type, dtype.fields[field][1]
    return linking.table_at(name, places)


def _reader(name, fields, dtype):
    """Kernel (address) that returns a table as a named tuple, for a numba without :mod:`linking`.

    Its source is generated, because numba compiles a composition of one kernel for each field
    twenty times slower.
    """
    names = {"row": namedtuple(name, fields), "record_at": array_at(numba.from_dtype(dtype), 1)}
    values = []
    for field, kind in fields.items():
        if isinstance(kind, Array):
            names[f"{field}_at"] = array_at(numba.from_dtype(kind.dtype), kind.ndim)
            shape = "".join(f"record.{field}[{1 + k}], " for k in range(kind.ndim))
            values.append(f"{field}_at(record.{field}[0], ({shape}))")
        else:
            values.append(f"record.{field}")
    source = (
        "def read(address):\n    record = record_at(address, (1,))[0]\n"
        f"    return row({', '.join(values)})\n"
    )
    exec(source, names)
    return kernel(names["read"])


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
            if not isinstance(field, Array):
                self._memory[name] = operator.index(entry) if field is int else entry
            elif (entry.dtype, entry.ndim, entry.flags.c_contiguous) == (*field, True):
                self._memory[name] = entry.ctypes.data, *entry.shape
            else:
                raise TypeError(
                    f"{name} is {entry.dtype} {entry.shape}; expected {field} in C order"
                )
