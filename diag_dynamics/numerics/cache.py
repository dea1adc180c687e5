# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where compiled code is kept, and when it is stale."""

import functools
import hashlib
import logging
import os
import shutil
import tempfile
import time
from pathlib import Path

import numba

logger = logging.getLogger(__name__)

PACKAGE = Path(__file__).resolve().parents[1]
"""The folder of diag_dynamics."""

PREFIX = "code-"
"""Beginning of the names of folders with compiled code."""

ROOMS = (
    "numerics",
    "sweeps",
    "simulation",
    "joint_states",
    "identification/kernels",
)
"""Where kernels are, and the constants that they are compiled with."""


def sources(package):
    """Paths of all source files that kernels are made of, in a folder of diag_dynamics."""
    return sorted(path for room in ROOMS for path in (package / room).rglob("*.py"))


def hash_of(package):
    """Hash of those files, and of numba's version."""
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sources(package):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@functools.cache
def source_hash():
    """:func:`hash_of` this package, which all kernels share."""
    return hash_of(PACKAGE)


UNUSED = 30 * 86400.0
"""Time [s] after which the code of other sources is removed."""


@functools.cache
def code_folder():
    """Folder for compiled code of these sources, or None; those that no process has used for a month are removed.

    numba compares the file of a function alone with its cache, not those that are compiled into it.
    """
    if cache_folder() is None:
        return None
    folder = cache_folder() / f"{PREFIX}{source_hash()[:16]}"
    try:
        folder.mkdir(exist_ok=True)
        folder.touch()
        for other in folder.parent.glob(f"{PREFIX}*"):
            if time.time() - other.stat().st_mtime > UNUSED:
                shutil.rmtree(other, ignore_errors=True)
    except OSError as error:
        logger.warning("No folder for compiled code; each process compiles it again: %s", error)
        return None
    return folder


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
