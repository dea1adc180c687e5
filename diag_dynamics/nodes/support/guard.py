# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Callbacks whose failures end no node: they are counted, logged or answered."""

from typing import NamedTuple

from diag_dynamics.exceptions import DiagDynamicsError, RejectedError, cause_of
from diag_dynamics.nodes.support.publishing import SERVICE_QOS
from diag_dynamics.text import shortened


class Fault(NamedTuple):
    """The exception that an action has raised."""

    error: Exception

    @property
    def is_internal(self):
        """Whether the failure is a mistake of this package.

        Faults of inputs have exceptions of their own.
        """
        return not isinstance(self.error, (DiagDynamicsError, RejectedError))

    @property
    def cause(self):
        """A short key to count it by."""
        return cause_of(self.error)

    @property
    def text(self):
        """The whole message."""
        return repr(self.error) if self.is_internal else str(self.error)

    @property
    def reason(self):
        """The message for people, short and without control characters."""
        return shortened(f"internal error: {self.text}" if self.is_internal else self.text)


def attempt(action, *arguments):
    """Call `action`; return its result and None, or None and its :class:`Fault`."""
    try:
        return action(*arguments), None
    except Exception as error:
        return None, Fault(error)


def offer(node, kind, name, answer):
    """Return the service ``~/name`` of a node, whose failures are responses.

    Responses of a `kind` have `success` and `message`. `answer` takes request and response, and
    returns the message of success or None.
    """

    def callback(request, response):
        message, fault = attempt(answer, request, response)
        if fault is None:
            response.success = True
            response.message = message or ""
            return response
        if fault.is_internal:
            text = shortened(f"{kind.__name__}: {fault.reason}")
            node.get_logger().error(text, throttle_duration_sec=5.0)
        return kind.Response(success=False, message=fault.reason)

    return node.create_service(kind, f"~/{name}", callback, qos_profile=SERVICE_QOS)
