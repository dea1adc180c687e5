# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The folders of compiled code: one for each state of the sources."""

import functools
import hashlib
import importlib
import logging
import os
import re
import shutil
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

import numba

from diag_dynamics.numerics.progress import send_message

logger = logging.getLogger(__name__)

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of diag_dynamics."""

PREFIX = "code-"
"""Beginning of the names of folders with compiled code."""

STAMP_PREFIX = "ahead-"
"""Prefix of the files in which ``diag-dynamics compile`` states what it has compiled."""

IMPORT = re.compile(r"^ *from (diag_dynamics[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)
"""An import. Compiled code contains kernels and constants of the imported modules."""

UNUSED = 30 * 86400.0
"""Time [s] after which unused compiled code is removed."""


def sources(module):
    """Return the sources of a module and of this package's modules that it imports, by name."""
    contents = {}
    waiting = [module]
    while waiting:
        name = waiting.pop()
        if name not in contents and (source := read_source(name)):
            contents[name], imported = source
            waiting += imported
    return contents


@functools.cache
def read_source(name):
    """Return the source of a module and the names of modules that it imports, None without a file.

    The file is read once, because it may change after its import.
    """
    path = source_path(name)
    imported = []
    if not path.is_file():
        return None
    content = path.read_bytes()
    for package, names in IMPORT.findall(content.decode()):
        modules = [f"{package}.{part}" for part in re.findall(r"\w+", names)]
        imported += [part if source_path(part).is_file() else package for part in modules]
    return content, imported


def source_path(name):
    """Return the file of a module."""
    if name.partition(".")[0] != PACKAGE.name:  # an entry of another package
        return Path(getattr(sys.modules.get(name), "__file__", None) or os.devnull)
    path = PACKAGE.parent.joinpath(*name.split("."))
    return path / "__init__.py" if path.is_dir() else path.with_suffix(".py")


@functools.cache
def source_hash(module):
    """Return the hash of :func:`sources` and of numba's version."""
    digest = hashlib.sha256(numba.__version__.encode())
    for name, text in sorted(sources(module).items()):
        digest.update(name.encode() + b"\0" + text + b"\0")
    return digest.hexdigest()


@functools.cache
def code_folder(module):
    """Return the folder for compiled code of a module; None without a writable one or a source.

    Its name contains the hash of all sources, because numba compares the file of an entry alone
    with its cache, also of a package in a zip, whose sources are not read.
    """
    if cache_folder() is None or not read_source(module):
        return None
    folder = cache_folder() / f"{PREFIX}{source_hash(module)[:16]}"
    try:
        make_private(folder)
        folder.touch()
        remove_unused(folder.parent)
    except OSError as error:
        logger.warning("No folder for compiled code; each process compiles it again: %s", error)
        return None
    return folder


@contextmanager
def only_process(folder, name):
    """Let one process at a time compile a kernel; the others load its code after that."""
    with ExitStack() as stack:
        with suppress(OSError, ImportError):  # no folder that can be locked, or Windows
            fcntl = importlib.import_module("fcntl")
            lock = stack.enter_context(
                (folder or Path(os.devnull)).joinpath(f"{name}.lock").open("w")
            )
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                send_message(f"another process compiles {name}; this one waits for it")
                fcntl.flock(lock, fcntl.LOCK_EX)
        yield


def remove_unused(folder):
    """Remove compiled code and stamps that no process has used for :data:`UNUSED`."""
    for path in (*folder.glob(f"{PREFIX}*"), *folder.glob(f"{STAMP_PREFIX}*")):
        with suppress(FileNotFoundError):  # another process removes it at the same time
            if time.time() - path.stat().st_mtime > UNUSED:
                _remove(path)


def _remove(path):
    """Remove a file or folder."""
    if path.is_dir():
        shutil.rmtree(path, ignore_errors=True)
    else:
        path.unlink(missing_ok=True)


def make_private(folder):
    """Make a folder that this user alone can write; OSError for one of another user.

    Compiled code runs as this user. Others may have written into a folder that was open to them.
    """
    for path in (*reversed(folder.parents), folder):
        if not path.exists():
            path.mkdir(mode=0o700, exist_ok=True)
            path.chmod(0o700)
    if not hasattr(os, "getuid"):
        return
    if {folder.lstat().st_uid, folder.stat().st_uid} != {os.getuid()}:
        raise PermissionError(f"'{folder}' belongs to another user")
    if folder.stat().st_mode & 0o022:
        folder.chmod(0o700)
        for path in folder.iterdir():
            _remove(path)
        logger.warning("Other users could write '%s'. Its compiled code is discarded.", folder)


@functools.cache
def cache_folder():
    """Return the folder of all compiled code, or None where none is writable.

    ``$NUMBA_CACHE_DIR/diag_dynamics`` if set, else ``$XDG_CACHE_HOME/diag_dynamics``
    (``~/.cache/diag_dynamics``), else ``diag_dynamics-<user>`` in the system's folder of temporary
    files.
    """
    configured = os.environ.get("NUMBA_CACHE_DIR")
    if configured:
        candidates = [Path(configured) / "diag_dynamics"]
    else:
        user = os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()
        owner = os.getuid() if hasattr(os, "getuid") else "user"
        candidates = [
            Path(user) / "diag_dynamics",
            Path(tempfile.gettempdir()) / f"diag_dynamics-{owner}",
        ]
    reasons = []
    for candidate in candidates:
        try:
            make_private(candidate)
            with tempfile.TemporaryFile(dir=candidate):
                return candidate
        except OSError as error:
            reasons.append(str(error))
    logger.warning(
        "No folder for compiled code; each process compiles it again. %s. Set NUMBA_CACHE_DIR.",
        "; ".join(reasons),
    )
    return None
