# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What has arrived, done in such a way that nothing that goes wrong ends the node."""

from typing import NamedTuple

from diag_dynamics.exceptions import DiagDynamicsError, RejectedError, cause_of
from diag_dynamics.nodes.support.diagnostics import shortened


class Fault(NamedTuple):
    """What kept something from being done."""

    error: Exception

    @property
    def is_internal(self):
        """Whether it is a mistake of this package: what is wrong with an input has an exception of its own."""
        return not isinstance(self.error, (DiagDynamicsError, RejectedError))

    @property
    def cause(self):
        """A short key to count it by."""
        return cause_of(self.error)

    @property
    def text(self):
        """What is wrong, in full."""
        return repr(self.error) if self.is_internal else str(self.error)

    @property
    def reason(self):
        """What is wrong, as it is told to people: an internal error is called that."""
        return shortened(f"internal error: {self.text}" if self.is_internal else self.text)


def attempt(action, *arguments):
    """Do something for somebody else: a message, a request, a parameter or a transition.

    Returns
    -------
    outcome : object
        What the action returns; None if it fails.
    fault : Fault or None
        Why it has failed: whatever it raises is told of and ends nothing.
    """
    try:
        return action(*arguments), None
    except Exception as error:
        return None, Fault(error)


def answered(node, kind, answer, named=str, keep=()):
    """Callback of a service by which every failure is a response.

    Parameters
    ----------
    node : rclpy.node.Node
    kind : type
        Of the service; its response has `success` and `message`.
    answer : callable
        Called with request and response; returns the message of success, or None for none.
    named : callable
        Takes what is wrong to what is said of it, in the request's own words.
    keep : sequence of str
        Fields that a response has although its answer fails; of the others what was filled in before is dropped.
    """

    def callback(request, response):
        message, fault = attempt(answer, request, response)
        if fault is None:
            response.success, response.message = True, message or ""
            return response
        return _refusal(node, kind, response, fault, named, keep)

    return callback


def _refusal(node, kind, response, fault, named, keep):
    """Return a response that names a fault; see :func:`answered`."""
    reason = named(fault.text)
    if fault.is_internal:
        node.get_logger().error(f"{kind.__name__}: {fault.text}", throttle_duration_sec=5.0)
        reason = f"Internal error: {fault.text}"
    refusal = kind.Response(success=False, message=shortened(reason))
    for field in keep:
        setattr(refusal, field, getattr(response, field))
    return refusal
