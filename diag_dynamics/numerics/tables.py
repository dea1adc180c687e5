# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Structs of numbers and arrays that a kernel receives as one pointer: cheaper than an argument for each."""

import functools
from collections import namedtuple
from numbers import Integral
from typing import NamedTuple

import numba
import numpy as np
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


class Array(NamedTuple):
    """Field of a Table: an array. See :func:`array`."""

    dtype: np.dtype
    """What it holds, in Python."""
    kind: numba.types.Type
    """That element."""
    ndim: int
    """Number of its dimensions in the kernel."""
    last: int | None = None
    """Extent of the last one of these, where it is the same in all tables."""


def array(dtype, ndim=1, last=None):
    """Field of a Table: a C-contiguous array. Its `last` extent, if known beforehand, is a constant to the compiler."""
    return Array(np.dtype(dtype), numba.from_dtype(np.dtype(dtype)), ndim, last)


class Table:
    """Declaration of a table: what Python writes is what kernels read, by the same names and of the same types.

    Parameters
    ----------
    name : str
        Unique name: numba distinguishes the types of tables by it.
    **fields
        :class:`int`, :class:`float`, or an :class:`Array`.

    Attributes
    ----------
    fields : dict
    dtype : dtype
        How a table lies in memory: numbers, and of an array its address and its extents.
    opened : kernel
        Of the address of a table; gives a named tuple of all numbers and arrays, of which only those that are used are read.
        A field that is not there ends compilation by a TypingError.
    """

    def __init__(self, name, /, **fields):
        self.fields = fields
        self.dtype = np.dtype(
            [
                (field, np.int64, (1 + kind.ndim,)) if isinstance(kind, Array) else (field, np.dtype(kind))
                for field, kind in fields.items()
            ]
        )
        self.opened = _reader(name, fields, self.dtype)

    def extended(self, name, /, **more):
        """Declaration of a table that has further fields behind these: kernels of this one read it, too."""
        return Table(name, **self.fields, **more)


def _reader(name, fields, dtype):
    """Kernel (address) that returns a table as a named tuple.

    Its source is generated, because numba compiles a composition of one kernel for each field twenty times slower.
    """
    names, values = {"row": namedtuple(name, fields), "record_at": array_at(numba.from_dtype(dtype), 1)}, []
    for field, kind in fields.items():
        if isinstance(kind, Array):
            names[f"{field}_at"] = array_at(kind.kind, kind.ndim)
            extents = [f"record.{field}[{1 + k}]" for k in range(kind.ndim)]
            if kind.last is not None:
                extents[-1] = str(kind.last)
            values.append(f"{field}_at(record.{field}[0], ({', '.join(extents)},))")
        else:
            values.append(f"record.{field}")
    source = f"def read(address):\n    record = record_at(address, (1,))[0]\n    return row({', '.join(values)})\n"
    exec(source, names)
    return kernel(names["read"])


class Addresses:
    """A table, with the arrays whose addresses are in it: they live as long as this.

    Parameters
    ----------
    table : Table
    **entries : int, float or ndarray
        One for each of its fields.

    Attributes
    ----------
    at : int
        Address of the table.

    Raises
    ------
    TypeError
        A field is missing or not there, or an array is not what the kernel takes it for.
    """

    def __init__(self, table, /, **entries):
        missing = [name for name in table.fields if name not in entries]
        if missing:
            raise TypeError(f"nothing is given for {', '.join(missing)}")
        self._fields, self._memory, self._arrays = table.fields, np.zeros(1, table.dtype), {}
        self.at = self._memory.ctypes.data
        for name, entry in entries.items():
            self[name] = entry

    def __setitem__(self, name, entry):
        """Have a field be another number, or another array."""
        if name not in self._fields:
            raise TypeError(f"there is no field {name}")
        field = self._fields[name]
        if isinstance(field, Array):
            _check(name, field, entry)
            self._arrays[name] = entry
            self._memory[name] = entry.ctypes.data, *entry.shape[: field.ndim]
        elif isinstance(entry, np.ndarray):
            raise TypeError(f"{name} is a number, not an array")
        elif field is int and not isinstance(entry, Integral):
            raise TypeError(f"{name} is a whole number, not {entry!r}")
        else:
            self._memory[name] = entry


def _check(name, field, entry):
    """Refuse what a kernel would misread."""
    if not isinstance(entry, np.ndarray) or entry.dtype != field.dtype:
        raise TypeError(f"{name} is an array of {field.dtype}, not {getattr(entry, 'dtype', type(entry).__name__)}")
    if entry.ndim != field.ndim:
        raise TypeError(f"{name} has {field.ndim} dimensions, not the shape {entry.shape}")
    if field.last not in (None, *entry.shape[field.ndim - 1 : field.ndim]):
        raise TypeError(f"the last extent of {name} is {field.last}, not that of the shape {entry.shape}")
    if not entry.flags.c_contiguous:
        raise TypeError(f"{name} is not C-contiguous")
