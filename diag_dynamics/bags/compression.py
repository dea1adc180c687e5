# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Decompression that believes no length: what comes out is never larger than what is said to, or than what there is."""

from importlib import import_module

import numpy as np

from diag_dynamics.exceptions import InputError

MOST = 1 << 32
"""Largest piece that is decompressed [bytes]: chunks have a megabyte or so, or are as large as one image. More is damage."""

_STEP = 1 << 20

ZSTD = b"\x28\xb5\x2f\xfd"
"""Begins a frame of zstd, and no message in CDR."""


class DamagedError(Exception):
    """Bytes cannot be decompressed; its text says why."""


def extra(module):
    """Import a module of a package that comes with the extra `recordings`.

    Raises
    ------
    InputError
        It is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0].replace("yaml", "pyyaml")
        raise InputError(f"recordings of this kind need the package {package}: pip install {package}.") from error


def decompressed(data, compression, size):
    """Decompress bytes that are to be `size` bytes.

    Raises
    ------
    DamagedError
        They are not, or the compression is unknown.
    InputError
        What it needs is not installed.
    """
    if size > MOST:
        raise DamagedError(f"it is to have {size} bytes, and {MOST} is the most that is read")
    if compression == "zstd":
        content = _zstd(data, size)
    elif compression == "":
        content = data
    else:
        content, error = beginning(data, compression, size + 1)
        if error:
            raise DamagedError(error)
    if len(content) != size:
        raise DamagedError(f"it has {len(content)} bytes, and is to have {size}")
    return content


def _zstd(data, size):
    zstandard = extra("zstandard")
    try:
        told = zstandard.get_frame_parameters(data).content_size
        if told == size:  # of one frame that says how large it is, as recorders write them
            return zstandard.ZstdDecompressor().decompress(data)
    except zstandard.ZstdError as error:
        raise DamagedError(f"zstd says: {error}") from error
    content, error = beginning(data, "zstd", size + 1)
    if error:
        raise DamagedError(error)
    return content


def beginning(data, compression, most):
    """Decompress as much as there is, but no more than `most` bytes; returns them, and what ended it, or None.

    Raises
    ------
    InputError
        What it needs is not installed.
    """
    parts, length = [], 0
    if compression == "":
        return data[:most], None
    if compression not in ("zstd", "lz4"):
        return b"", f"compression '{compression}' is not known; zstd, lz4 and none are"
    read, errors = (_zstd_reader if compression == "zstd" else _lz4_reader)(data)
    try:
        while length < most:
            part = read(min(_STEP, most - length))
            if not part:
                break
            parts.append(part)
            length += len(part)
    except errors as error:
        return b"".join(parts), f"{compression} says: {error}"
    return b"".join(parts), None


def _zstd_reader(data):
    zstandard = extra("zstandard")
    reader = zstandard.ZstdDecompressor().stream_reader(data, read_across_frames=True)
    return reader.read, zstandard.ZstdError


def _lz4_reader(data):
    frame = extra("lz4.frame")
    decompressor, rest = frame.LZ4FrameDecompressor(), data

    def read(size):
        nonlocal decompressor, rest
        while True:
            if decompressor.eof:
                rest = decompressor.unused_data or b""
                if not rest:
                    return b""
                decompressor = frame.LZ4FrameDecompressor()
            given, rest = rest, b""
            part = decompressor.decompress(given, max_length=size)
            if part or (decompressor.needs_input and not decompressor.eof):
                return part

    return read, (RuntimeError, EOFError)


def inflated(messages):
    """Messages of which those are decompressed that are compressed one by one; others, and damaged ones, are as they are."""
    data, long = messages.data, np.flatnonzero(messages.size >= len(ZSTD))
    begin = messages.at[long]
    long = long[np.all([data[begin + k] == ZSTD[k] for k in range(len(ZSTD))], axis=0)]
    if not len(long):
        return messages
    parts, at, size = [data], messages.at.copy(), messages.size.copy()
    beyond = len(data)
    for k in long:
        content, error = beginning(data[at[k] : at[k] + size[k]].tobytes(), "zstd", MOST)
        if not error:
            parts.append(np.frombuffer(content, np.uint8))
            at[k], size[k] = beyond, len(content)
            beyond += len(content)
    return messages._replace(data=np.concatenate(parts), at=at, size=size)
