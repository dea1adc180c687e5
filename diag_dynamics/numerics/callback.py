# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Functions that kernels call by address: their code is compiled when a kernel first calls it."""

import _thread
import ctypes
import functools
import logging
import threading

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from diag_dynamics.numerics.cache import code_folder
from diag_dynamics.numerics.kernel import (
    compilation,
    compile_ahead,
    compiler_lock,
    without_collection,
)

logger = logging.getLogger(__name__)

_NUMBER = types.int64

FAILED = -3
"""Status of a function that could not be compiled."""

INTERRUPT_DELAY = 0.1
"""Time [s] from the end of a compilation to an interrupt during it."""


class Callback:
    """A function of integers that returns one.

    `address` is that of a cell with the address of the code: at first of code that compiles the
    function, and then calls it.
    """

    def __init__(self, function):
        functools.update_wrapper(self, function)
        count = 1 + function.__code__.co_argcount
        self._prototype = ctypes.CFUNCTYPE(*[ctypes.c_int64] * count)
        self._first_call = self._prototype(self._compile_and_call)
        self._cell = np.array([ctypes.cast(self._first_call, ctypes.c_void_p).value], np.int64)
        self.address = self._cell.ctypes.data
        self._is_compiled = False
        compile_ahead(self)

    def compile(self):
        """Compile the function, or load it from the cache."""
        with compiler_lock, without_collection():
            self._cell[0] = self._compiled.address
            self._is_compiled = True

    def _compile_and_call(self, *numbers):
        """Compile the function in a thread and call it.

        An interrupt follows, because kernels raise nothing.
        """
        compiled = threading.Event()
        interrupted = False
        try:
            _thread.start_new_thread(self._compile_and_report, (compiled,))
            while not compiled.is_set():
                try:
                    compiled.wait()
                except KeyboardInterrupt:
                    interrupted = True
            if interrupted:
                threading.Timer(INTERRUPT_DELAY, _thread.interrupt_main).start()
            return self._prototype(int(self._cell[0]))(*numbers) if self._is_compiled else FAILED
        except BaseException as error:  # an exception would make the result 0
            logger.error("%s cannot be called: %r", self.__name__, error)
            return FAILED

    def _compile_and_report(self, compiled):
        """Compile the function; set an event at the end, after a failure too."""
        try:
            self.compile()
        except Exception as error:
            logger.error("%s cannot be compiled: %s", self.__name__, error)
        finally:
            compiled.set()

    @functools.cached_property
    def _compiled(self):
        """The compiled function, kept on disk."""
        folder = code_folder(self.__module__)
        function = self.__wrapped__
        signature = _NUMBER(*[_NUMBER] * function.__code__.co_argcount)
        compiler = functools.partial(numba.cfunc, signature, error_model="numpy")
        with compilation(self.__name__, folder):
            try:
                return compiler(cache=folder is not None)(function)
            except Exception as error:  # a full disk; a damaged file may unpickle into any
                logger.warning(
                    "The cache %s cannot be used for %s: %r", folder, self.__name__, error
                )
                return compiler()(function)


@intrinsic
def call_address(typingctx, address, numbers):
    """Call the :class:`Callback` of this address with a tuple of integers."""
    count = len(numbers)

    def lower(context, builder, signature, args):
        number = context.get_value_type(_NUMBER)
        function = ir.FunctionType(number, [number] * count).as_pointer()
        code = builder.load(builder.inttoptr(args[0], function.as_pointer()))
        values = [builder.extract_value(args[1], k) for k in range(count)]
        return builder.call(code, values)

    return _NUMBER(_NUMBER, types.UniTuple(_NUMBER, count)), lower
