# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""numba's cache of compiled functions, in a folder of ours, with a digest, and never in the way."""

import hashlib
import logging
import pickle

from numba.core import caching
from numba.core.runtime import rtsys

from diag_dynamics.compiled.cache import PACKAGE, cache_folder, source_hash

logger = logging.getLogger(__name__)


FORMAT = 2
"""Of the files: a part of their names, so that files of another format, of a version before or after, are not looked at.

It goes up with every change of :class:`_Files`. Without it, files of the older format would be called damaged.
"""


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
        return f"{FORMAT}-{hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:16]}"

    @classmethod
    def from_function(cls, py_func, py_file):
        return cls(py_file)


class _CacheImpl(caching.CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _Files(caching.IndexDataCacheFile):
    """Files that say what they are for, and have a digest of what they hold: numba would run what a disk has damaged.

    numba writes the index first, and numbers files of code by it. Should the code then not get to the disk, that of other
    sources is still in its file; and where two kinds of processors share a folder, and begin at the same time, either may
    have written the file that the other one's index names. What a file says it is for tells that, and it is stale then.
    """

    def load(self, key):
        """Code for a key of numba's, which has the processor in it; None if there is none."""
        name = self._load_index().get(key)
        try:
            return None if name is None else self._read(name, repr(key))
        except FileNotFoundError:
            return None

    def save(self, key, data):
        """Keep code for a key, under the name that numba gives it."""
        self._key = repr(key)
        super().save(key, data)

    def _load_index(self):
        try:
            return self._read(self._index_name) or {}
        except FileNotFoundError:
            return {}

    def _save_index(self, overloads):
        self._write(self._index_name, overloads)

    def _save_data(self, name, data):
        self._write(name, data, self._key)

    def _read(self, name, key=""):
        path = self._data_path(name)
        with open(path, "rb") as file:
            purpose, digest, content = file.read(32), file.read(32), file.read()
        if digest != hashlib.sha256(purpose + content).digest():
            raise ValueError(f"{path} is damaged")
        return pickle.loads(content) if purpose == self._purpose(name, key) else None

    def _write(self, name, data, key=""):
        purpose, content = self._purpose(name, key), self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(purpose + hashlib.sha256(purpose + content).digest() + content)

    def _purpose(self, name, key):
        """What a file is for: its name, the sources, and of code numba's key."""
        return hashlib.sha256("\0".join((name, self._source_stamp, key)).encode()).digest()


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
