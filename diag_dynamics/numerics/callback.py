# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Functions that kernels call by address: what few robots need is compiled for these alone."""

import functools
import logging

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from diag_dynamics.numerics.cache import code_folder
from diag_dynamics.numerics.kernel import compile_ahead, compiler_lock
from diag_dynamics.numerics.progress import report_compilation

logger = logging.getLogger(__name__)

_NUMBER = types.int64


class Callback:
    """A function of integers that returns one, and the address of its code."""

    def __init__(self, function):
        functools.update_wrapper(self, function)
        compile_ahead(self)

    def compile(self):
        """Compile the function, or load it from the cache."""
        return self.address

    @functools.cached_property
    def address(self):
        """Where the machine code begins; compiled when it is first asked for, and kept on disk."""
        with compiler_lock, report_compilation(self.__name__):
            function, before = self.__wrapped__, numba.config.CACHE_DIR
            folder = code_folder(self.__module__)
            signature = _NUMBER(*[_NUMBER] * function.__code__.co_argcount)
            try:
                numba.config.CACHE_DIR = str(folder or before)
                self._compiled = numba.cfunc(
                    signature, cache=folder is not None, error_model="numpy"
                )(function)
            except Exception as error:  # a full disk; a damaged file may unpickle into any
                logger.warning(
                    "The cache %s cannot be used for %s: %r", folder, self.__name__, error
                )
                self._compiled = numba.cfunc(signature, error_model="numpy")(function)
            finally:
                numba.config.CACHE_DIR = before
            return self._compiled.address


@intrinsic
def call_address(typingctx, address, numbers):
    """Call the :class:`Callback` at an address with a tuple of integers."""
    count = len(numbers)

    def lower(context, builder, signature, args):
        number = context.get_value_type(_NUMBER)
        function = ir.FunctionType(number, [number] * count)
        values = [builder.extract_value(args[1], k) for k in range(count)]
        return builder.call(builder.inttoptr(args[0], function.as_pointer()), values)

    return _NUMBER(_NUMBER, types.UniTuple(_NUMBER, count)), lower
