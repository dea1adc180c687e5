# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The mark that all was compiled: a small file beside the compiled code, which goes where that goes."""

import hashlib
import os
import platform
import sys
from contextlib import suppress
from pathlib import Path

from diag_dynamics.compiled.cache import PACKAGE, cache_folder, source_hash
from diag_dynamics.compiled.switch import PLAIN

OURS = f"{hashlib.sha256(str(PACKAGE).encode()).hexdigest()[:16]}.py{sys.version_info[0]}{sys.version_info[1]}"
"""In the names of this package's files for this Python: copies of the package share the folder."""

PROCESSOR = ("vendor_id", "cpu family", "model", "flags", "Features", "CPU implementer", "CPU part")
"""What /proc/cpuinfo says of a processor, as far as code is made for it."""


def set_mark(units):
    """Keep that units were compiled; a disk that refuses has them looked through another time."""
    with suppress(OSError):
        _path().write_text(_text(units), encoding="utf-8")


def is_marked(units):
    """Whether units were compiled from these sources for this machine and Python, and no code was written or lost since."""
    try:
        return _path().read_text(encoding="utf-8") == _text(units)
    except (OSError, UnicodeDecodeError):
        return False


def _path():
    return cache_folder() / f"ahead-{OURS}"


def _text(units):
    parts = [source_hash(), *units, _processor()]
    for path in sorted(_files()):
        with suppress(FileNotFoundError):  # just now replaced
            about = path.stat()
            parts.append(f"{path.name} {about.st_size} {about.st_mtime_ns}")
    return hashlib.sha256("\0".join(parts).encode()).hexdigest()


def _files():
    """All files of code, those of other sources among them: they take the places of ours."""
    if PLAIN:
        return cache_folder().glob(f"plain-{source_hash()[:16]}/**/*.nb?")
    return cache_folder().glob(f"*-{OURS}*.nb?")


def _processor():
    """What numba looks at: the processor, or what stands for it in the environment."""
    found = [platform.machine(), platform.processor()]
    with suppress(OSError):
        first = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").split("\n\n")[0]
        found += [line for line in first.splitlines() if line.partition(":")[0].strip() in PROCESSOR]
    found += [os.environ.get(name, "") for name in ("NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES")]
    return "\n".join(found)
