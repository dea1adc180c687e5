# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Reaction to collisions: the topic ~/collision and a service call. Not safety-rated."""

import math
from functools import partial

from std_msgs.msg import Bool
from std_srvs.srv import Trigger

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.controller_manager import ControllerSwitch
from diag_dynamics.nodes.support.publishing import connected, latched
from diag_dynamics.nodes.support.statuses import ERROR, OK, Status

RESPONSE_TIMEOUT, RESULT_TIMEOUT = 1.0, 1.0
"""Timeouts of a response and of a result [s].

Without a response diagnostics report an error. Without a result ~/collision becomes false.
"""


class Reaction:
    """Publish whether there is a collision, and call the service of the parameters.

    The service is called when a collision or a contact begins. The topic is latched. It becomes
    false when judgement ends, because no later result would end the collision.
    """

    def __init__(self, node):
        self._node = node
        self._steady = node.time.steady
        self._publisher = connected(node.create_publisher, Bool, "~/collision", latched())
        self._service = node.values["reaction.service"]
        self._client = None
        self._on_contact = node.values["reaction.event"] == "contact"
        self._published = self._future = self._fallback = self._controllers = None
        self._judged_at = -math.inf
        self._is_missed = False
        self._calls = 0
        self._failures = 0
        self._failure = ""
        self._latencies = {}
        if self._service:
            names = [
                list(filter(None, node.values[f"reaction.{part}"]))
                for part in ("deactivate", "activate")
            ]
            kind = ControllerSwitch.service_type() if any(names) else Trigger
            try:
                self._client = node.create_client(kind, self._service)
            except Exception as error:  # rclpy does not name the parameter
                raise InputError(
                    f"parameter 'reaction.service' is '{self._service}': {error}"
                ) from error
            self._request = kind.Request()
            if any(names):
                self._controllers = ControllerSwitch(node, self._service, *names)
                self._request, self._fallback = self._controllers.requests()

    def accept_state(self, watch, received):
        """React to the last state of a CollisionWatch, received at the steady time `received` [s].

        A further event within an alarm makes no call. One without the service is made up for as
        soon as there is one, while the alarm lasts.
        """
        alarm = watch.contact if self._on_contact else watch.collision
        self._is_missed = self._is_missed and alarm.on
        late = self._is_missed and self._client.service_is_ready()
        if late or (alarm.starts and self._client):
            self._call(received)
        if not (watch.seen.valid and watch.is_judged):
            self.end()
            return
        self._judged_at = received
        self._publish(watch.collision.on)

    def end(self):
        """Publish the end of a collision that is not judged any more."""
        if self._published:
            self._publish(False)

    def check(self, now):
        """End a collision without a judged state for RESULT_TIMEOUT.

        The steady time is `now` [s].
        """
        if now - self._judged_at > RESULT_TIMEOUT:
            self.end()

    def _publish(self, collision):
        if collision != self._published:
            self._published = collision
            self._publisher.publish(Bool(data=collision))

    def _call(self, received):
        self._calls += 1
        self._failure = ""
        if self._future:
            self._client.remove_pending_request(self._future)
        self._future = None
        self._is_missed = not self._client.service_is_ready()
        if self._is_missed:
            self._fail("the service is not available")
            return
        self._send(self._request, received)
        self._measure("call sent", received)

    def _send(self, request, received):
        self._future = self._client.call_async(request)
        self._sent = self._steady()
        self._future.add_done_callback(partial(self._take_response, request, received))

    def _take_response(self, request, received, future):
        """Measure and log the response to the last call."""
        if future is not self._future:
            return
        self._future = None
        response = future.result()
        latency = self._measure("response", received)
        if getattr(response, "success", getattr(response, "ok", False)):
            self._node.log_info(
                f"Reaction: response of '{self._service}' {latency:.3g} ms after the joint state."
            )
            if self._controllers:
                self._controllers.update(self._take_differences)
            return
        self._fail(f"the response is a failure: {getattr(response, 'message', '')}")
        if request is self._request and self._fallback:
            self._send(self._fallback, received)

    def _take_differences(self, differences):
        """Report controllers in another state than that of the request, after a success."""
        if differences:
            self._fail(f"after the response {differences}")

    def _measure(self, event, received):
        """Store the time since reception [ms] and its maximum; return it."""
        latency = 1e3 * (self._steady() - received)
        largest = max(latency, self._latencies.get(event, (0.0, 0.0))[1])
        self._latencies[event] = latency, largest
        return latency

    def _fail(self, reason):
        self._failures += not self._failure  # once a call
        self._failure = reason
        self._node.log_error(f"Reaction failed: '{self._service}': {reason}")

    def report(self):
        """Return the status of the service in a list; empty without a service."""
        if not self._client:
            return []
        values = {"calls": self._calls, "failed calls": self._failures}
        for event, (last, largest) in self._latencies.items():
            values[f"{event} after [ms]"] = f"{last:.3g}"
            values[f"{event} after, maximum [ms]"] = f"{largest:.3g}"
        message = self._failure and f"last call failed: {self._failure}"
        if self._future and self._steady() - self._sent > RESPONSE_TIMEOUT:
            message = f"no response within {RESPONSE_TIMEOUT:g} s"
        if self._controllers:
            self._controllers.update()
            message = message or self._controllers.problem()
        if not self._client.service_is_ready():
            message = "the service is not available"
        level = ERROR if message else OK
        text = f"'{self._service}': {message or 'ready'}"
        return [Status("reaction", level, text, values, is_logged=bool(self._failure))]
