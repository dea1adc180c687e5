# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kernels compiled with what numba keeps to itself: each once, and called in half the time."""

import functools
import gc

import numba
from numba.core.compiler_lock import global_compiler_lock

from diag_dynamics.compiled.cache import cache_folder
from diag_dynamics.compiled.lent import Filled, Lent, lent
from diag_dynamics.compiled.parts import EntryCompiler, PartCompiler
from diag_dynamics.compiled.progress import register, told
from diag_dynamics.compiled.store import Cache

_OPTIONS = {"error_model": "numpy", "no_cfunc_wrapper": True, "_nrt": False}
"""No kernel allocates: without references to count, there is a tenth less to compile."""

_UNCALLED = {"no_cpython_wrapper": True, "pipeline_class": PartCompiler, **_OPTIONS}
"""By Python: half of the code is spared."""

INLINED = {"forceinline": True, **_UNCALLED}
"""Options of numba's for what is compiled into its callers."""


def array_of(ndim):
    """Type of an array of numbers that entry kernels read."""
    return Lent(numba.float64, ndim)


def filled_of(ndim):
    """Type of an array of numbers that entry kernels write; one that is read-only is no such."""
    return Filled(numba.float64, ndim)


def kernel(function):
    """Compile `function` with numba on first use, into every function that calls it: for the steps of a sweep.

    Division by zero gives inf as in NumPy. Tuples then stay in registers, where a call passes them
    through memory.
    """
    return _lending(numba.njit(**INLINED)(function))


def large_kernel(function):
    """Compile `function` as :func:`kernel` does, but once, and call it: for what is large and seldom."""
    return _lending(numba.njit(**_UNCALLED)(function))


def _lending(dispatcher):
    """Have a kernel take arrays as :func:`lent` says."""
    resolve = dispatcher.get_call_template

    def resolve_lent(args, kws):
        return resolve(tuple(map(lent, args)), {name: lent(kind) for name, kind in kws.items()})

    dispatcher.get_call_template = resolve_lent
    return dispatcher


def entry_kernel(*arguments, nogil=False):
    """Compile a function for calls from Python, for arguments of these types alone; the result is kept on disk.

    Other arguments raise TypeError, where numba would compile for them, too. What takes long should let other threads run
    meanwhile, `nogil`; what takes a microsecond loses a tenth of it that way. To kernels it is a :func:`large_kernel`.
    """

    def compiled(function):
        dispatcher = numba.njit(nogil=nogil, pipeline_class=EntryCompiler, **_OPTIONS)(function)
        if cache_folder():
            dispatcher._cache = Cache(function)
        dispatcher._compile_for_args = functools.partial(_compile_once, dispatcher, arguments)
        part = large_kernel(function)
        dispatcher.get_call_template, dispatcher.get_overload = part.get_call_template, part.get_overload
        register(dispatcher)
        return dispatcher

    return compiled


def ready(entry):
    """Compile an entry kernel, or load it from the cache, so that its first call does not wait for it."""
    entry._compile_for_args()


def _compile_once(dispatcher, arguments, *given):
    """What numba calls when it has no code for the arguments of a call."""
    with global_compiler_lock:
        if dispatcher._can_compile:  # else another thread was first
            collecting = gc.isenabled()
            gc.disable()  # a tenth of the time of compiling: nothing that it makes is garbage before it is done
            try:
                with told(dispatcher.py_func.__qualname__):
                    dispatcher.compile(arguments)
            finally:
                if collecting:
                    gc.enable()
            dispatcher.disable_compile()
    return dispatcher  # numba calls it with what was given; now it looks at the types
