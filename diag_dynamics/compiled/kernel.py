"""The decorator that compiles the physics, and the disk cache of what it compiled."""

import functools
import hashlib
import logging
import os
import tempfile
from pathlib import Path

import numba
from llvmlite import ir
from numba.core import caching, cgutils, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.datamodel import models
from numba.core.runtime import rtsys
from numba.extending import NativeValue, lower_cast, register_model, unbox

logger = logging.getLogger(__name__)

_OPTIONS = {"error_model": "numpy"}

_UNCALLED = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True, **_OPTIONS}  # by Python: half of the code is spared

INLINED = {"forceinline": True, **_UNCALLED}
"""Options of numba's for what is compiled into its callers."""


class Lent(types.Array):
    """numba's type of a C-contiguous array that its caller keeps alive: taken at half the cost of an array that is shared."""

    def __init__(self, dtype, ndim):
        super().__init__(dtype, ndim, "C", name=f"lent({dtype}, {ndim})")


register_model(Lent)(models.ArrayModel)


@unbox(Lent)
def _borrow(array, value, c):
    """What numba does with arrays where it counts no references."""
    native = c.context.make_array(array)(c.context, c.builder)
    place = c.builder.bitcast(native._getpointer(), c.pyapi.voidptr)
    signature = ir.FunctionType(ir.IntType(32), [c.pyapi.pyobj, c.pyapi.voidptr])
    failed = c.builder.call(c.pyapi._get_function(signature, name="numba_adapt_ndarray"), (value, place))
    return NativeValue(native._getvalue(), is_error=cgutils.is_not_null(c.builder, failed))


@lower_cast(types.Array, Lent)
def _lend(context, builder, fromty, toty, val):
    return val


ROBOT = numba.int64
"""Type of the argument that stands for a robot: see sweeps.Workspace."""

VECTOR, MATRIX, STATES = (Lent(numba.float64, ndim) for ndim in (1, 2, 3))
NUMBER, COUNT, FLAG = numba.float64, numba.int64, numba.boolean

_PACKAGE = Path(__file__).resolve().parents[1]


_ROOMS = ("compiled", "sweeps", "simulation", "assembly", "nodes/wire")
"""Where kernels are, and the constants that they are compiled with."""


@functools.cache
def source_hash():
    """Hash of every source file that kernels are made of.

    numba invalidates a cached function when its own file changes, not when a function that was inlined into it from another
    file does. All kernels therefore share this one stamp.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(path for room in _ROOMS for path in (_PACKAGE / room).rglob("*.py")):
        digest.update(path.relative_to(_PACKAGE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@functools.cache
def cache_folder():
    """Folder for compiled code: the first writable one of a short list, or None.

    ``NUMBA_CACHE_DIR`` if set, else ``$XDG_CACHE_HOME/diag_dynamics`` (``~/.cache/diag_dynamics``), else a
    folder of this user's below the system's temporary one.
    """
    configured = os.environ.get("NUMBA_CACHE_DIR")
    if configured:
        candidates = [Path(configured) / "diag_dynamics"]
    else:
        user = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
        owner = os.getuid() if hasattr(os, "getuid") else "user"
        candidates = [Path(user) / "diag_dynamics", Path(tempfile.gettempdir()) / f"diag_dynamics-{owner}"]
    for candidate in candidates:
        if _is_ours(candidate):
            return candidate
    logger.warning(
        "No writable folder for compiled code (tried %s): it is compiled anew in every process. "
        "Set NUMBA_CACHE_DIR to a writable folder.",
        ", ".join(map(str, candidates)),
    )
    return None


def _is_ours(folder):
    """Whether `folder` can be written and nobody else can have put code there."""
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
        return not hasattr(os, "getuid") or folder.stat().st_uid == os.getuid()
    except OSError:
        return False


class _Locator(caching._CacheLocator):
    """Tells numba where this package's compiled code lies, and when it is stale."""

    def __init__(self, py_file):
        self._py_file = py_file

    def get_cache_path(self):
        return str(cache_folder())

    def get_source_stamp(self):
        return source_hash()

    def get_disambiguator(self):
        # Copies of the package (two workspaces, say) must not overwrite each other's code.
        return hashlib.sha256(str(_PACKAGE).encode()).hexdigest()[:16]

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_file)


class _CacheImpl(caching.CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _Cache(caching.FunctionCache):
    """numba's function cache, except that a failing disk costs compile time and nothing else, and loading much less."""

    _impl_class = _CacheImpl

    def load_overload(self, sig, target_context):
        # numba first gathers what it knows how to compile, which takes ten times as long as the loading. Its compiler does
        # so itself; code that is compiled already needs of all that only the runtime that manages memory.
        rtsys.initialize(target_context)
        try:
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except Exception as error:  # a damaged file may unpickle into any of them
            logger.warning("Compiled code in %s is unreadable and made anew: %r", self.cache_path, error)
            self._without_disk_errors(self.flush)
            return None

    def save_overload(self, sig, data):
        self._without_disk_errors(super().save_overload, sig, data)

    def _without_disk_errors(self, action, *args):
        try:
            action(*args)
        except OSError as error:
            logger.warning("Compiled code could not be saved to %s: %s", self.cache_path, error)


def kernel(function):
    """Compile `function` with numba on first use, into every function that calls it: for the steps of a sweep.

    Division by zero gives inf as in NumPy. Tuples then stay in registers, where a call passes them
    through memory.
    """
    return numba.njit(**INLINED)(function)


def large_kernel(function):
    """Compile `function` as :func:`kernel` does, but once, and call it: for what is large and seldom."""
    return numba.njit(**_UNCALLED)(function)


def entry_kernel(*arguments, nogil=False):
    """Compile a function as :func:`large_kernel` does, for arguments of these types alone; the result is kept on disk.

    For what Python calls. Other arguments raise TypeError, where numba would compile for them, too. What takes long should
    let other threads run meanwhile, `nogil`; what takes a microsecond loses a tenth of it that way.
    """

    def compiled(function):
        dispatcher = numba.njit(nogil=nogil, **_OPTIONS)(function)
        if cache_folder():
            dispatcher._cache = _Cache(function)
        dispatcher._compile_for_args = functools.partial(_compile_once, dispatcher, arguments)
        return dispatcher

    return compiled


def ready(entry):
    """Compile an entry kernel, or load it from the cache, so that its first call does not wait for it."""
    entry._compile_for_args()


def _compile_once(dispatcher, arguments, *given):
    """What numba calls when it has no code for the arguments of a call."""
    with global_compiler_lock:
        if dispatcher._can_compile:  # else another thread was first
            dispatcher.compile(arguments)
            dispatcher.disable_compile()
    return dispatcher  # numba calls it with what was given; now it looks at the types
