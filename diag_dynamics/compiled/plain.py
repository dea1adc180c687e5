# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kernels compiled by numba's documented interface alone: what is in its place should a numba have changed inside.

Files of compiled code have no digest here: numba reads and writes them, and has no documented place for one. It looks at
one file of sources alone, so that each state of ours has a folder of its own, see :func:`_folder`.
"""

import functools
import gc
import logging
import shutil
import threading
import time

import numba
import numpy as np
from numba import types
from numba.extending import intrinsic, typeof_impl

from diag_dynamics.compiled.cache import cache_folder, source_hash
from diag_dynamics.compiled.progress import register, told

logger = logging.getLogger(__name__)

UNUSED = 30 * 86400.0
"""Time [s] after which a folder that no process has begun with is removed."""

_lock = threading.RLock()  # again by one that compiles what another one calls
"""Held while an entry is compiled: threads of a batch would compile the same one, and leave each other's folder in force."""

_OPTIONS = {"error_model": "numpy"}


def _known(*options):
    """Those of some options that this numba knows: they are not documented, but as old as its cache."""
    try:
        known = numba.core.registry.cpu_target.options
    except AttributeError:
        return {}
    return {option: True for option in options if hasattr(known, option)}


_UNCALLED = _known("no_cpython_wrapper", "no_cfunc_wrapper")
"""By Python, nor by C: what would take arguments from there is a quarter of what there is to compile."""

INLINED = {**_OPTIONS, **_UNCALLED}
"""Options of numba's for kernels."""


def array_of(ndim):
    """Type of an array of numbers that entry kernels read."""
    return types.Array(numba.float64, ndim, "C")


class _Filled:
    """An array of numbers that an entry kernel writes."""

    def __init__(self, ndim):
        self.kind = array_of(ndim)


filled_of = _Filled


def kernel(function):
    """Compile `function` with numba on first use; division by zero gives inf as in NumPy."""
    return numba.njit(**INLINED)(function)


large_kernel = kernel


def entry_kernel(*arguments, nogil=False):
    """Compile a function for arguments of these types alone; the result is kept on disk."""

    def compiled(function):
        entry = Entry(function, arguments, nogil)
        register(entry)
        return entry

    return compiled


class Entry:
    """What Python calls, compiled on first use; kernels may call it, too."""

    def __init__(self, function, arguments, nogil):
        self.__doc__, self.__name__, self.__module__ = function.__doc__, function.__name__, function.__module__
        self.py_func, self._nogil, self._dispatcher = function, nogil, None
        self._read = {k for k, kind in enumerate(arguments) if isinstance(kind, types.Array) and kind.mutable}
        self._arguments = tuple(kind.kind if isinstance(kind, _Filled) else kind for kind in arguments)

    def __call__(self, *given):
        """Call the compiled function; what it reads is copied if it is read-only, for numba has another type for that.

        What it writes is not, and numba refuses it then.
        """
        arrays = [
            x.copy() if k in self._read and isinstance(x, np.ndarray) and not x.flags.writeable else x
            for k, x in enumerate(given)
        ]
        return self.dispatcher(*arrays)

    @property
    def stats(self):
        """What numba has counted: loads from the cache, and compilations."""
        return self.dispatcher.stats

    @property
    def dispatcher(self):
        """Numba's function, compiled."""
        if self._dispatcher is None:
            with _lock:
                if self._dispatcher is None:  # else another thread was first
                    self._compile()
        return self._dispatcher

    def _compile(self):
        collecting = gc.isenabled()
        gc.disable()  # a tenth of the time
        try:
            with told(self.__name__):
                self._dispatcher = self._compiled()
        finally:
            if collecting:
                gc.enable()

    def _compiled(self):
        folder, before = _folder(), numba.config.CACHE_DIR
        if folder:
            numba.config.CACHE_DIR = str(folder)
        try:
            dispatcher = self._made(cache=bool(folder))
        except OSError as error:  # a full disk
            logger.warning(
                "Compiled code could not be saved to %s, and is made anew in every process: %s", folder, error
            )
            dispatcher = self._made(cache=False)
        finally:
            numba.config.CACHE_DIR = before
        dispatcher.disable_compile()
        return dispatcher

    def _made(self, cache):
        dispatcher = numba.njit(cache=cache, nogil=self._nogil, **_OPTIONS)(self.py_func)
        dispatcher.compile(self._arguments)
        return dispatcher


@functools.cache
def _folder():
    """Folder for compiled code of these sources, or None; those of others that are :data:`UNUSED` are removed.

    A process that has begun with one has loaded what it needs of it, or compiles the rest anew.
    """
    if cache_folder() is None:
        return None
    folder = cache_folder() / f"plain-{source_hash()[:16]}"
    try:
        folder.mkdir(exist_ok=True)
        folder.touch()  # used by now
        for other in folder.parent.glob("plain-*"):
            if time.time() - other.stat().st_mtime > UNUSED:
                shutil.rmtree(other, ignore_errors=True)
    except OSError as error:
        logger.warning("No folder for compiled code, which is made anew in every process: %s", error)
        return None
    return folder


@typeof_impl.register(Entry)
def _(entry, context):
    """Type of an entry in a kernel that calls it."""
    return numba.typeof(entry.dispatcher)


def ready(entry):
    """Compile an entry kernel, or load it from the cache, so that its first call does not wait for it."""
    entry.dispatcher  # noqa: B018 (asking for it compiles it)


@functools.cache
def array_at(dtype, ndim, lent=False):
    """Kernel (address, shape) that gives the C-contiguous array of numba type `dtype` that lies at an address."""
    pointer = types.CPointer(dtype)

    @intrinsic
    def place(typingctx, address):
        def lower(context, builder, signature, args):
            return builder.inttoptr(args[0], context.get_value_type(pointer))

        return pointer(types.intp), lower

    @kernel
    def at(address, shape):
        return numba.carray(place(address), shape)

    return at


def table_at(row, dtype, kinds):
    """Kernel (address) that gives a named tuple of the numbers and arrays that a table at an address tells of.

    `row` is the named tuple, `dtype` how the table lies in memory, `kinds` what each array holds, its number of dimensions,
    and its last extent, if that is known, which is not made use of here; None for a number.
    """
    given, entries = {"row": row, "table": array_at(numba.from_dtype(dtype), 1)}, []
    for name, kind in zip(row._fields, kinds, strict=True):
        if kind:
            given[f"{name}_at"] = array_at(*kind[:2])
            shape = "".join(f"record.{name}[{1 + k}], " for k in range(kind[1]))
            entries.append(f"{name}_at(record.{name}[0], ({shape}))")
        else:
            entries.append(f"record.{name}")
    # One kernel, written out: put together from one for each field, it takes five seconds to compile.
    text = f"def at(address):\n    record = table(address, (1,))[0]\n    return row({', '.join(entries)})\n"
    exec(text, given)
    return kernel(given["at"])


@kernel
def address_of(array):
    """Where the numbers of an array begin."""
    return array.ctypes.data


@kernel
def flat(array):
    """All numbers of a C-contiguous array in a row."""
    return array.reshape(array.size)
