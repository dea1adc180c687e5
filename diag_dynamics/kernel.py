"""The decorator that compiles the physics, and the disk cache of what it compiled."""

import functools
import hashlib
import logging
import os
import tempfile
from pathlib import Path

import numba
from numba.core import caching

logger = logging.getLogger(__name__)

_OPTIONS = {"error_model": "numpy", "nogil": True}

_PACKAGE = Path(__file__).resolve().parent


@functools.cache
def source_hash():
    """Hash of every source file of this package that holds compiled code.

    numba invalidates a cached function when its own file changes, not when a function that was inlined into
    it from another file does. All kernels therefore share this one stamp.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(_PACKAGE.rglob("*.py")):
        source = path.read_bytes()
        if b"kernel\ndef " in source:
            digest.update(path.name.encode() + b"\0" + source + b"\0")
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
    """numba's function cache, except that a failing disk costs compile time and nothing else."""

    _impl_class = _CacheImpl

    def load_overload(self, sig, target_context):
        try:
            return super().load_overload(sig, target_context)
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

    Without the GIL, division by zero giving inf as in NumPy. Tuples then stay in registers, where a call passes them
    through memory.
    """
    return numba.njit(forceinline=True, **_OPTIONS)(function)


def large_kernel(function):
    """Compile `function` as :func:`kernel` does, but once, and call it: for what is large and seldom."""
    return numba.njit(**_OPTIONS)(function)


def entry_kernel(function):
    """Compile `function` as :func:`large_kernel` does, and keep the result on disk: for what Python calls."""
    dispatcher = large_kernel(function)
    if cache_folder():
        dispatcher._cache = _Cache(function)
    return dispatcher
