# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of text, packed or not, in chunks: what can be read of them, and why it ends."""

import bz2
import gzip
import lzma
import os
import zlib
from contextlib import nullcontext
from importlib import import_module

from diag_dynamics.exceptions import InputError

CHUNK = 1 << 18
"""Bytes; what a stream that breaks off has given before stays."""

MAGIC = {
    "gzip": b"\x1f\x8b",
    "bz2": b"BZh",
    "xz": b"\xfd7zXZ\x00",
    "zstd": b"\x28\xb5\x2f\xfd",
    "lz4": b"\x04\x22\x4d\x18",
}
"""First bytes of what is packed."""

_OPENED = {"gzip": gzip.open, "bz2": bz2.open, "xz": lzma.open}

_BROKEN = (EOFError, OSError, zlib.error, lzma.LZMAError)


def packing(path):
    """How a file is packed, by its first bytes: a key of MAGIC, or None.

    Raises
    ------
    InputError
        It cannot be read, or is empty.
    """
    try:
        with open(path, "rb") as file:
            begin = file.read(8)
    except OSError as error:
        raise InputError(f"Cannot read '{path}': {error.strerror or error}.") from error
    if not begin:
        raise InputError(f"'{path}' is empty: it has 0 bytes.")
    return next((name for name, magic in MAGIC.items() if begin.startswith(magic)), None)


def chunks(path, broken):
    """Bytes of a file, unpacked.

    Parameters
    ----------
    path : str
    broken : callable
        Called with a text if the file cannot be read to its end: why, and where in the file.
    """
    packed = packing(path)
    size = os.path.getsize(path)
    with open(path, "rb") as file, _unpacked(file, packed, path) as stream:
        try:
            while chunk := stream.read1(CHUNK):
                yield chunk
        except _BROKEN as error:
            what = f"{packed} stream" if packed else "file"
            why = str(error).rstrip(".") or type(error).__name__
            at = f"at byte {min(file.tell(), size)} of {size}, or shortly before" if packed else f"of {size} bytes"
            cut = isinstance(error, EOFError) or "Truncated" in why
            doubt = "" if cut else "; it is damaged, and rows before that may be wrong"
            broken(f"the {what} cannot be read to its end, {at}: {why}{doubt}")


def _unpacked(file, packed, path):
    """A stream with read1 of what is in a file."""
    if packed is None:
        return nullcontext(file)
    if packed in _OPENED:
        return _OPENED[packed](file)
    try:
        arrow = import_module("pyarrow")
    except ImportError as error:
        raise InputError(
            f"'{path}' is packed by {packed}, for which pyarrow is needed: pip install pyarrow."
        ) from error
    return arrow.CompressedInputStream(arrow.PythonFile(file, mode="r"), packed)
