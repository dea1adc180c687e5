# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The decorators that compile the physics, and the types of its arguments: numba's documented interface.

Kernels are compiled into the entries that call them. An entry is called from Python with one pointer and a few arrays. It
is compiled on its first call, for the types that it declares, and kept on disk.
"""

import functools
import gc
import importlib
import logging
import pkgutil
import threading

import numba
from numba import types

from diag_dynamics.numerics.cache import code_folder
from diag_dynamics.numerics.progress import report_compilation

try:  # All that is private to numba. Without it, kernels are compiled for the types of each call: slower, to the same code.
    from diag_dynamics.numerics import linking
except (ImportError, AttributeError):
    linking = None

logger = logging.getLogger(__name__)

ROBOT = numba.int64
"""Type of the argument that stands for a robot: see sweeps.Workspace."""

VECTOR, MATRIX, STATES = (types.Array(numba.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3))
"""Types of arrays that an entry reads: read-only arrays, as results are, and others."""

FILLED_VECTOR, FILLED_MATRIX, FILLED_STATES = (types.Array(numba.float64, ndim, "C") for ndim in (1, 2, 3))
"""Types of arrays that an entry writes."""

NUMBER, COUNT, FLAG = numba.float64, numba.int64, numba.boolean


_ENTRY = {"error_model": "numpy"}
_CALLED, INLINED, _COUNTED = dict(_ENTRY), dict(_ENTRY), {}
if linking:
    # Without reference counts: no kernel allocates, and LLVM does not vectorize a loop that counts.
    _COUNTED = linking.supported("_nrt")
    _ENTRY |= dict.fromkeys(_COUNTED, False) | linking.supported("no_cfunc_wrapper")
    _ENTRY["pipeline_class"] = linking.KernelCompiler
    _CALLED = _ENTRY | linking.supported("no_cpython_wrapper")
    INLINED = _CALLED | linking.supported("forceinline")

_entries = {}
_lock = threading.RLock()


def kernel(function):
    """Compile `function` into every function that calls it, so that tuples stay in registers.

    Division by zero gives inf as in NumPy.
    """
    return numba.njit(**INLINED)(function)


def array_kernel(function):
    """Compile `function` as :func:`kernel` does, where it returns an array: numba requires reference counts for that."""
    return numba.njit(**INLINED | _COUNTED)(function)


def large_kernel(function):
    """Compile `function` as a function of its own, where :func:`kernel` would copy much code that seldom runs."""
    return numba.njit(**_CALLED)(function)


def entry_kernel(*signature, nogil=False):
    """Compile a function on its first call from Python, for arguments of these types alone; keep the code on disk.

    Arguments of other types raise TypeError. `nogil` lets other threads run meanwhile; it costs 0.1 µs a call. Kernels that
    call an entry have it compiled as :func:`large_kernel` does.
    """

    def decorate(function):
        entry = numba.njit(nogil=nogil, **_ENTRY)(function)
        compile_entry = _entries[entry] = functools.partial(_compile_once, entry, signature)
        if linking:
            linking.hook_entry(entry, large_kernel(function), compile_entry)
        return entry

    return decorate


def ready(entry):
    """Compile an entry, or load it from the cache, so that its first call does not wait."""
    _entries[entry]()


def precompile(*modules):
    """Compile the entries in modules and packages, or load them from the cache; ``diag_dynamics.sweeps`` is one."""
    for module in modules:
        package = importlib.import_module(module)
        for found in pkgutil.iter_modules(getattr(package, "__path__", ()), f"{module}."):
            importlib.import_module(found.name)
    for entry in tuple(_entries):
        if any(f"{entry.__module__}.".startswith(f"{module}.") for module in modules):
            ready(entry)


def _compile_once(entry, signature, *_):
    """Compile an entry, or load it; return it, as numba then calls it."""
    with _lock:
        if not entry.signatures:  # else another thread was first
            collecting = gc.isenabled()
            gc.disable()  # a tenth of the time: the compiler leaves no garbage before it is done
            try:
                with report_compilation(entry.__name__):
                    _compile(entry, signature)
            finally:
                if collecting:
                    gc.enable()
            entry.disable_compile()
    return entry


def _compile(entry, signature):
    folder, before = code_folder(entry.__module__), numba.config.CACHE_DIR
    try:
        if folder:
            numba.config.CACHE_DIR = str(folder)
            entry.enable_caching()
        try:
            entry.compile(signature)
        except OSError as error:  # a full disk
            logger.warning("Compiled code could not be saved to %s; each process compiles it again: %s", folder, error)
        except Exception as error:  # a damaged file may unpickle into any
            files = list(folder.rglob(f"*.{entry.__name__}-*.nb?")) if folder else []
            if not files:
                raise
            logger.warning("Compiled code in %s is unreadable and compiled again: %r", folder, error)
            for file in files:
                file.unlink(missing_ok=True)
            entry.compile(signature)
    finally:
        numba.config.CACHE_DIR = before
