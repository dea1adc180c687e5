# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages by their bytes: what was laid out once is read without rclpy, number by number."""

import numpy as np
from rclpy.serialization import deserialize_message

from diag_dynamics.exceptions import InputError
from diag_dynamics.wire.cdr import Template

KEPT = 4
"""Layouts that are remembered: of a robot's states there are those with efforts and those without."""

QUEUE = 64
"""Messages that wait to be taken, of each topic: where more have come, the oldest are gone, and all are not counted."""

SECOND = 1_000_000_000


class Reading:
    """Numbers of one message; they stay until the reader of its layout reads again."""

    def __init__(self, message, template):
        self.template = template
        self.names = tuple(message.dof_names)
        self.positions = tuple(getattr(message, "position_names", ())) or self.names

    def rows(self, name):
        """A field of several numbers as a row, a copy, shape (1, length); None if it is empty."""
        numbers = self.template.numbers.get(name)
        return None if numbers is None else np.array(numbers, dtype=float)[None]

    def number(self, name):
        """A field of one number or truth value."""
        return self.template.numbers[name].item()

    @property
    def stamp(self):
        """Stamp of the header [ns]."""
        return self.number("header.stamp.sec") * SECOND + self.number("header.stamp.nanosec")


class Reader:
    """Reads messages of one type from one publisher, or from several.

    Parameters
    ----------
    kind : type
        Of messages that have dof_names.
    """

    def __init__(self, kind):
        self._kind, self._known = kind, []

    def read(self, raw):
        """:class:`Reading` of a message's bytes.

        Raises
        ------
        InputError
            These bytes are not laid out as messages are.
        """
        for known in self._known:
            if known.template.fits(raw):
                known.template.data[:] = np.frombuffer(raw, dtype=np.uint8, count=len(known.template.data))
                return known
        message = deserialize_message(raw, self._kind)
        template = Template(message)
        if not template.holds(raw):
            raise InputError(f"{self._kind.__name__} comes in another encoding than plain little-endian CDR.")
        self._known = [Reading(message, template), *self._known[: KEPT - 1]]
        return self._known[0]


def drained(subscription):
    """The newest message of those that wait, its information, and how many there were."""
    newest, info, count, handle = None, {}, 0, subscription.handle
    with handle:
        while count < QUEUE and (taken := handle.take_message(subscription.msg_type, True)) is not None:
            (newest, info), count = taken, count + 1
    return newest, info, count
