# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Serialized joint states that promise more than they hold, told before rosidl meets them."""

import struct

from diag_dynamics.wire.definitions import ALIGNMENT

_COUNTS = struct.Struct(">I"), struct.Struct("<I")
"""How a count is written, by the last bit of the encapsulation."""


def overruns(raw):
    """Whether a sequence of a serialized JointState counts more entries than there are bytes left.

    rosidl refuses such a message like any other that is malformed, but writes a line to stderr first, past all logging and
    for every message: at 1 kHz 86 million lines a day.

    Parameters
    ----------
    raw : bytes

    Returns
    -------
    bool
        False, too, of what is malformed otherwise: rosidl says nothing of that but to its caller.
    """
    if len(raw) < 4 or raw[0] != 0 or raw[1] not in ALIGNMENT:
        return False
    count, aligned = _COUNTS[raw[1] % 2].unpack_from, ALIGNMENT[raw[1]]

    def after_text(at):
        at += -at % 4
        return at + 4 + count(raw, at)[0]

    try:
        at = after_text(12)  # encapsulation and stamp come before the frame
        at += -at % 4
        names = count(raw, at)[0]
        at += 4
        if names > len(raw) - at:
            return True
        for _ in range(names):
            at = after_text(at)
        for _ in ("position", "velocity", "effort"):
            at += -at % 4
            numbers = count(raw, at)[0]
            at += 4
            if numbers > len(raw) - at:
                return True
            at += -(at - 4) % aligned + 8 * numbers if numbers else 0
    except struct.error:  # it ends before
        pass
    return False
