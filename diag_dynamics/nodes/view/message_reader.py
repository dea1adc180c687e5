# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Numbers of messages, read from their bytes."""

from rclpy.serialization import deserialize_message

from diag_dynamics.wire.cdr import Template


class MessageReader:
    """Read messages of one type. rclpy reads the first one of each layout; of others the numbers alone are read.

    Attributes
    ----------
    message
        The last message that rclpy has read: its texts are those of the last one.
    """

    def __init__(self, kind):
        self._kind, self._template, self.message = kind, None, None

    def read(self, raw):
        """Return arrays by field, valid until the next call; fields that are empty are not there."""
        if self._template is None or not self._template.read(raw):
            self.message = deserialize_message(raw, self._kind)
            self._template = Template(self.message)
        return self._template.numbers
