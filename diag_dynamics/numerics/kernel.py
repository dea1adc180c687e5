# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decorators that compile the physics, and types of its arguments, by numba's public interface.

Kernels are compiled into the entries that call them. An entry is called from Python with one
pointer and a few arrays. It is compiled on its first call, for the types that it declares, and kept
on disk.
"""

import functools
import gc
import importlib
import logging
import pkgutil
import threading
from contextlib import contextmanager

import numba
from numba import types
from numba.extending import typeof_impl

from diag_dynamics.numerics.cache import code_folder, only_process, source_hash
from diag_dynamics.numerics.progress import report_compilation

logger = logging.getLogger(__name__)

ROBOT = numba.int64
"""Type of the argument that stands for a robot: see sweeps.memory.Workspace."""

VECTOR, MATRIX, STATES = (
    types.Array(numba.float64, ndim, "C", readonly=True) for ndim in (1, 2, 3)
)
"""Types of arrays that an entry reads: read-only arrays, as results are, and others."""

FILLED_VECTOR, FILLED_MATRIX, FILLED_STATES = (
    types.Array(numba.float64, ndim, "C") for ndim in (1, 2, 3)
)
"""Types of arrays that an entry writes."""

NUMBER, COUNT, FLAG = numba.float64, numba.int64, numba.boolean

try:  # all that is private to numba; without it, the same code compiles in twice the time
    from diag_dynamics.numerics import linking
except (ImportError, AttributeError, TypeError) as error:
    linking = None
    logger.info("Kernels compile slowly under numba %s: %r", numba.__version__, error)

_entries = []
compiler_lock = threading.RLock()


def kernel(function):
    """Compile `function` into every function that calls it, so that tuples stay in registers.

    Division by zero gives inf as in NumPy.
    """
    return _decorator("KERNEL")(function)


def array_kernel(function):
    """Compile `function` as :func:`kernel` does, with the reference counts of a returned array."""
    return _decorator("ARRAY_KERNEL")(function)


def large_kernel(function):
    """Compile `function` as a function of its own, if it is long and seldom runs."""
    return _decorator("LARGE_KERNEL")(function)


def entry_kernel(*signature, nogil=False):
    """Compile a function on its first call from Python and keep the code on disk.

    Arguments of other types raise TypeError. `nogil` lets other threads run meanwhile; it costs 0.1
    µs a call. Kernels that call an entry have it compiled as :func:`large_kernel` does.
    """
    return lambda function: Entry(function, signature, nogil)


def precompile(*modules):
    """Compile the entries in modules and packages, or load them from the cache."""
    for module in modules:
        package = importlib.import_module(module)
        for submodule in pkgutil.iter_modules(getattr(package, "__path__", ()), f"{module}."):
            importlib.import_module(submodule.name)
    for entry in tuple(_entries):
        if any(f"{entry.__module__}.".startswith(f"{module}.") for module in modules):
            entry.compile()


def compile_ahead(entry):
    """Add an entry or callback to those that :func:`precompile` compiles.

    The hash of its sources is that of its import: a later upgrade changes the files.
    """
    source_hash(entry.__module__)
    _entries.append(entry)


def _decorator(kind, **options):
    """Return numba's decorator for a kind of function."""
    return numba.njit(error_model="numpy", **options, **getattr(linking, kind, {}))


@contextmanager
def without_collection():
    """Compile in a tenth less time: the compiler leaves no garbage before it ends."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


@contextmanager
def compilation(name, folder):
    """Let numba keep code in a folder, in one process at a time; report how long it compiles."""
    before = numba.config.CACHE_DIR
    with report_compilation(name, linking is not None), only_process(folder, name):
        try:
            numba.config.CACHE_DIR = str(folder or before)
            yield
        finally:
            numba.config.CACHE_DIR = before


class Entry:
    """A function that Python calls: see :func:`entry_kernel`.

    `run` is the compiled function, or one that compiles it. It saves the 0.1 µs that a call of the
    entry costs.
    """

    def __init__(self, function, signature, nogil):
        functools.update_wrapper(self, function)
        self._signature = signature
        self._nogil = nogil
        self.run = self._compile_and_run
        compile_ahead(self)

    def __call__(self, *arguments):  # noqa: D102  # the docstring is the function's
        return self.run(*arguments)

    @functools.cached_property
    def kernel(self):
        """The function as kernels call it, for the declared types alone.

        Otherwise numba would compile it for the types of each call.
        """
        compiled = large_kernel(self.__wrapped__)
        compiled.compile(self._signature)
        compiled.disable_compile()
        return compiled

    def compile(self):
        """Compile the function, or load it from the cache, so that its first call does not wait."""
        with compiler_lock:
            if self.run == self._compile_and_run:  # else another thread was first
                folder = code_folder(self.__module__)
                with without_collection(), compilation(self.__name__, folder):
                    self.run = self._compile(folder)

    def _compile_and_run(self, *arguments):
        self.compile()
        return self.run(*arguments)

    def _compile(self, folder):
        compiled = _decorator("ENTRY", nogil=self._nogil, cache=folder is not None)(
            self.__wrapped__
        )
        try:
            compiled.compile(self._signature)
        except OSError as error:  # a full disk, or a folder that cannot be read
            logger.warning(
                "The cache %s cannot be used; each process compiles %s again: %s",
                folder,
                self.__name__,
                error,
            )
            if not compiled.signatures:
                compiled = _decorator("ENTRY", nogil=self._nogil)(self.__wrapped__)
                compiled.compile(self._signature)
        except Exception as error:  # a damaged file may unpickle into any
            files = list(folder.rglob(f"*.{self.__name__}-*.nb?")) if folder else []
            if not files:
                raise
            logger.warning(
                "Compiled code in %s is unreadable and compiled again: %r", folder, error
            )
            for file in files:
                file.unlink(missing_ok=True)
            compiled.compile(self._signature)
        compiled.disable_compile()
        return compiled


@typeof_impl.register(Entry)
def _type_of_entry(entry, _):
    return numba.typeof(entry.kernel)
