"""numba's cache of compiled functions, in a folder of ours, with a digest, and never in the way."""

import hashlib
import logging
import os
import pickle

from numba.core import caching
from numba.core.runtime import rtsys

from diag_dynamics.compiled.cache import PACKAGE, cache_folder, source_hash

logger = logging.getLogger(__name__)


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
        return hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:16]

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_file)


class _CacheImpl(caching.CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _Files(caching.IndexDataCacheFile):
    """Files that begin with a digest of what follows: numba would run what a disk has damaged."""

    def _load_index(self):
        try:
            stamp, overloads = self._read(self._index_path)
        except FileNotFoundError:
            return {}
        return overloads if stamp == self._source_stamp else {}

    def _save_index(self, overloads):
        self._write(self._index_path, (self._source_stamp, overloads))

    # numba writes the index first. Should the code then not get to the disk, that of other sources is still in its file:
    # without the stamp in the digest it would run.

    def _load_data(self, name):
        return self._read(self._data_path(name), self._source_stamp)

    def _save_data(self, name, data):
        self._write(self._data_path(name), data, self._source_stamp)

    def _read(self, path, stamp=""):
        with open(path, "rb") as file:
            digest, content = file.read(32), file.read()
        if digest != _digest(path, stamp, content):
            raise ValueError(f"{path} is damaged")
        return pickle.loads(content)

    def _write(self, path, data, stamp=""):
        content = self._dump(data)
        with self._open_for_write(path) as file:
            file.write(_digest(path, stamp, content) + content)


def _digest(path, stamp, content):
    """Of the name, too: one file in the place of another is as wrong as a damaged one."""
    return hashlib.sha256(os.path.basename(path).encode() + stamp.encode() + content).digest()


class Cache(caching.FunctionCache):
    """numba's function cache, except that a failing disk costs compile time and nothing else, and loading much less."""

    _impl_class = _CacheImpl

    def __init__(self, function):
        super().__init__(function)
        self._cache_file = _Files(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())

    def load_overload(self, sig, target_context):
        """Load compiled code; None if there is none, or none that is whole."""
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
        """Keep compiled code, if the disk lets it be kept."""
        self._without_disk_errors(super().save_overload, sig, data)

    def _without_disk_errors(self, action, *args):
        try:
            action(*args)
        except (OSError, ValueError) as error:  # the latter: an index that is damaged, and could not be emptied
            logger.warning("Compiled code could not be saved to %s: %s", self.cache_path, error)
