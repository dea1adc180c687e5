# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Stamps of serialized messages that begin with a header: after CDR's four bytes, seconds and nanoseconds."""

import struct

_STAMP = struct.Struct("<iI")
_OFFSET = 4


def put(data, nanoseconds):
    """Overwrite the stamp of a bytearray."""
    _STAMP.pack_into(data, _OFFSET, *divmod(nanoseconds, 1_000_000_000))


def get(data):
    """Nanoseconds of the stamp."""
    sec, nanosec = _STAMP.unpack_from(data, _OFFSET)
    return 1_000_000_000 * sec + nanosec
