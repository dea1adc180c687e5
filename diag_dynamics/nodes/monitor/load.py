# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Load at the monitor's states, and the payload from services and from the robot's driver."""

from geometry_msgs.msg import InertiaStamped
from rclpy.qos import QoSProfile
from rclpy.serialization import deserialize_message
from std_srvs.srv import Trigger

from diag_dynamics.control.load import LoadEstimator
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Payload
from diag_dynamics.nodes.support.diagnostics import OK, STALE, Status, steady
from diag_dynamics.nodes.support.guard import answered, attempt
from diag_dynamics.nodes.support.publishing import SERVICE_QOS, connected, latched
from diag_dynamics.text import plain

NO_PAYLOAD = Payload(0.0)
"""Removes the payload of a link."""


class LoadWatch:
    """A load estimator on the results of a disturbance observer.

    `estimate` is the Load of the last state, `begins` whether `is_load` begins there.
    """

    def __init__(self, dynamics, link, observation):
        covariance = observation.covariance_of(dynamics.model.dof_names)
        self.link, self.estimator = link, LoadEstimator(dynamics, link, observation.gain, covariance)
        self.forget()

    def forget(self):
        """Reset the estimate."""
        self.estimator.reset()
        self.estimate, self.begins = self.estimator.last, False

    def accept_state(self, time, state, seen, r, torque):
        """Return r and m r of a RobotState, without the part of the load while there is one.

        `seen` is the Disturbance. Without efforts the observer skips a state, and so does the estimator.
        """
        was_load = self.estimate.is_load
        if state.effort is not None:
            external = torque if seen.valid else None
            self.estimate = self.estimator.update(time, state.position, state.velocity, external)
        self.begins = self.estimate.is_load and not was_load
        if seen.valid and self.estimate.is_load:
            torque = torque - self.estimator.torque
            r = self.estimator.dynamics.epsilon_from_tau(state.position, torque)
        return r, torque

    def describe(self):
        """Return mass and link of the load as a text."""
        load = self.estimate
        return f"load {load.mass:.3g} ± {load.mass_deviation:.2g} kg at '{self.link}'"

    def report(self):
        """Return the status of the load."""
        load = self.estimate
        if not load.valid:
            return Status("load", STALE, steady(load.reason))
        values = {"mass [kg]": f"{load.mass:.4g}", "standard deviation of mass [kg]": f"{load.mass_deviation:.2g}"}
        values["explained"] = f"{load.explained:.3f}"
        if load.is_significant:
            values["centre of mass [m]"] = " ".join(f"{x:.3f}" for x in load.center)
        return Status("load", OK, self.describe() if load.is_load else f"no load at '{self.link}'", values)


def check_load_link(model, settings):
    """Raise InputError if parameters of the load do not fit the model or each other."""
    link, observation = settings.values["load.link"], settings.observation
    if not link:
        return
    if link not in model.link_names or not model.placement_in_body(link)[0]:
        raise InputError(
            f"parameter 'load.link' is '{link}'; expected a link of robot '{model.name}' that a joint moves."
        )
    if observation is None or observation.settles_on != "torque" or observation.covariance_of(model.dof_names) is None:
        raise InputError(
            f"parameter 'load.link' is '{link}'; expected external_torque.gain above 0, external_torque.settles_on "
            "'torque' and an external_torque.covariance beside it. Calibrate (diag-dynamics calibrate)."
        )


class PayloadServices:
    """The services ~/accept_payload and ~/reset_payload, and the topic of the driver's payload.

    `current` returns the MonitoredRobot or None; `attach` changes one payload.
    """

    def __init__(self, node, current, attach):
        self._log, self._current, self._attach = node.get_logger(), current, attach
        self._accepted = None  # link, its payload before the first acceptance, and the accepted one
        for name, answer in (("accept_payload", self.accept), ("reset_payload", self._reset)):
            callback = answered(node, Trigger, lambda request, response, answer=answer: answer())
            node.create_service(Trigger, f"~/{name}", callback, qos_profile=SERVICE_QOS)
        self._received = None  # last payload of the driver
        if topic := node.values["load.driver_topic"]:
            options = InertiaStamped, topic, self._accept_message
            connected(node.create_subscription, *options, QoSProfile(depth=1), raw=True)
            node.create_subscription(*options, latched(), raw=True)  # receives nothing from volatile publishers

    def _model(self):
        if (robot := self._current()) is None:
            raise InputError("There is no robot yet. The node waits for a valid robot_description.")
        return robot.model

    def _watch(self):
        self._model()
        torque = self._current().torque
        if torque is None or torque.load is None:
            raise InputError("parameter 'load.link' is ''; expected a link. Set it to have loads estimated.")
        return torque.load

    def accept(self):
        """Add the load to the payload of its link; return a message."""
        watch = self._watch()
        link, found = watch.link, watch.estimate
        if not found.is_load:
            value = f"{found.mass:.3g} ± {found.mass_deviation:.2g} kg" if found.valid else f"unknown: {found.reason}"
            raise InputError(
                f"load on link '{link}' is {value}; expected a recognized load. Move the arm with the load."
            )
        before, payload = self._before(link), watch.estimator.payload()
        self._accepted = link, before, self._attach(link, payload).payloads.get(link, NO_PAYLOAD)
        return f"The payload of '{link}' is {payload.mass:.3g} kg."

    def _before(self, link):
        """Return the payload of a link before the acceptances that are in force."""
        now = self._model().payloads.get(link, NO_PAYLOAD)
        if self._accepted and self._accepted[0] == link and _numbers(self._accepted[2]) == _numbers(now):
            return self._accepted[1]
        return now

    def _reset(self):
        watch = self._watch()
        before = self._before(watch.link)
        self._attach(watch.link, before)
        self._accepted = None
        watch.forget()
        return f"The payload of '{watch.link}' is {before.mass:.3g} kg, as before accept_payload."

    def _accept_message(self, message):
        """Store the bytes of a geometry_msgs/InertiaStamped of the driver, and use its payload."""
        self._received = message
        if self._current():
            self.apply_received()

    def apply_received(self):
        """Replace the payload of a link of the robot in force by the last one of the driver, if there is one."""
        _, fault = attempt(self._use_driver) if self._received else (None, None)
        if fault:
            self._log.warning(f"Payload of the driver rejected: {fault.reason}", throttle_duration_sec=5.0)

    def _use_driver(self):
        found = deserialize_message(self._received, InertiaStamped)
        link, payload = found.header.frame_id, payload_of(found.inertia)
        model = self._model()
        if _numbers(payload) != _numbers(model.payloads.get(link, NO_PAYLOAD)):
            model.with_payload(link, *payload)  # raises InputError
            self._attach(link, payload)
            self._log.info(plain(f"Payload of the driver: {payload.mass:.3g} kg on '{link}'."))


def payload_of(i):
    """Return the Payload of a geometry_msgs/Inertia."""
    inertia = ((i.ixx, i.ixy, i.ixz), (i.ixy, i.iyy, i.iyz), (i.ixz, i.iyz, i.izz))
    return Payload(i.m, (i.com.x, i.com.y, i.com.z), inertia)


def _numbers(payload):
    """Return mass, centre and inertia as plain numbers; those of a mass of 0 do not matter."""
    rows = [list(map(float, row)) for row in payload.inertia]
    return (payload.mass, list(map(float, payload.com)), rows) if payload.mass else ()
