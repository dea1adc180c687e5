# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor's services: dynamics, and the payload from requests and loads."""

from std_srvs.srv import Trigger

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model import Payload
from diag_dynamics.nodes.support.guard import offer
from diag_dynamics.nodes.support.messages import doubles
from diag_dynamics.nodes.support.requests import read_acceleration, read_state, read_wrenches
from diag_dynamics.parameters.shared import NO_PAYLOAD
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics, SetPayload


def _required(current):
    if current is None:
        raise InputError("There is no robot yet. The node waits for a valid robot_description.")
    return current


class DynamicsServices:
    """Services of a node; `current` returns dynamics, MessageMaker and Followers, or None."""

    def __init__(self, node, current, set_payload):
        self._current = current
        self._attach = set_payload
        for kind, name, answer in (
            (ForwardDynamics, "forward_dynamics", self._forward_dynamics),
            (InverseDynamics, "inverse_dynamics", self._inverse_dynamics),
            (Diagonalize, "diagonalize", self._diagonalize),
            (SetPayload, "set_payload", self._set_payload),
        ):
            offer(node, kind, name, answer)

    def _read(self, request):
        """Return the dynamics, MessageMaker, state and options of a request."""
        dynamics, maker, followers = _required(self._current())
        if request.override_gravity:
            g = request.gravity
            dynamics = DiagonalDynamics(dynamics.model.with_gravity((g.x, g.y, g.z)))
        state = read_state(dynamics.model, request, followers)
        options = read_wrenches(dynamics.model, request) | {"friction": request.include_friction}
        return dynamics, maker, state, options

    def _forward_dynamics(self, request, response):
        dynamics, _, (q, qd, tau, _), options = self._read(request)
        tau = 0.0 * qd if tau is None else tau
        response.acceleration = doubles(dynamics.forward_dynamics(q, qd, tau, **options))
        response.nu_dot = doubles(dynamics.evaluate(q, qd, tau, **options).nu_dot)
        response.dof_names = list(dynamics.model.dof_names)

    def _inverse_dynamics(self, request, response):
        dynamics, _, (q, qd, _, joints), options = self._read(request)
        qdd = read_acceleration(dynamics.model, request, joints)
        response.effort = doubles(dynamics.inverse_dynamics(q, qd, qdd, **options))
        response.dof_names = list(dynamics.model.dof_names)

    def _diagonalize(self, request, response):
        dynamics, maker, (q, qd, tau, _), options = self._read(request)
        s = dynamics.evaluate(q, qd, tau, **options)
        stamp = request.state.header.stamp
        at = stamp.sec * SECOND + stamp.nanosec
        state = RobotState(q, qd, tau, at, at, False)
        response.state = maker.evaluated("state", s, state)
        response.external = doubles(s.external)
        response.coriolis = maker.evaluated("coriolis", s, state)
        response.factors = maker.matrix("mass_matrix_factors", dynamics, state, with_inverse=True)
        response.kinetic_energy = maker.evaluated("kinetic_energy", s, state)
        response.joint_space_dynamics = maker.matrix("joint_space_dynamics", dynamics, state)

    def _set_payload(self, request, response):
        payload = payload_of(request.inertia)
        _required(self._current())[0].model.with_payload(
            request.link, *payload
        )  # raises InputError
        response.total_mass = self._attach(request.link, payload).total_mass


class PayloadServices:
    """The services ~/accept_payload and ~/reset_payload.

    `current` returns the MonitoredRobot or None; `attach` changes one payload.
    """

    def __init__(self, node, current, attach):
        self._current = current
        self._attach = attach
        self._accepted = None  # link, its payload before the first acceptance, and the accepted one
        offer(node, Trigger, "accept_payload", self._accept)
        offer(node, Trigger, "reset_payload", self._reset)

    def _model(self):
        return _required(self._current()).model

    def _watch(self):
        load = _required(self._current()).load
        if not load.estimator:
            raise InputError(
                "parameter 'load.link' is ''; expected a link. Set it to have loads estimated."
            )
        return load

    def _accept(self, *_):
        """Add the load to the payload of its link; return a message."""
        watch = self._watch()
        link = watch.link
        estimate = watch.estimate
        if not estimate.is_load:
            value = (
                f"{estimate.mass:.3g} ± {estimate.mass_deviation:.2g} kg"
                if estimate.valid
                else f"unknown: {estimate.reason}"
            )
            raise InputError(
                f"load on link '{link}' is {value}; expected a recognized load. "
                "Move the arm with the load."
            )
        before = self._before(link)
        payload = watch.estimator.payload()
        self._accepted = link, before, self._attach(link, payload).payloads.get(link, NO_PAYLOAD)
        return f"The payload of '{link}' is {payload.mass:.3g} kg."

    def _before(self, link):
        """Return the payload of a link before the acceptances that are in force."""
        now = self._model().payloads.get(link, NO_PAYLOAD)
        if (
            self._accepted
            and self._accepted[0] == link
            and _numbers(self._accepted[2]) == _numbers(now)
        ):
            return self._accepted[1]
        return now

    def _reset(self, *_):
        watch = self._watch()
        before = self._before(watch.link)
        self._attach(watch.link, before)
        self._accepted = None
        watch.forget()
        return f"The payload of '{watch.link}' is {before.mass:.3g} kg, as before accept_payload."


def payload_of(i):
    """Return the Payload of a geometry_msgs/Inertia."""
    inertia = ((i.ixx, i.ixy, i.ixz), (i.ixy, i.iyy, i.iyz), (i.ixz, i.iyz, i.izz))
    return Payload(i.m, (i.com.x, i.com.y, i.com.z), inertia)


def _numbers(payload):
    """Return mass, centre and inertia as plain numbers; those of a mass of 0 do not matter."""
    rows = [list(map(float, row)) for row in payload.inertia]
    return (payload.mass, list(map(float, payload.com)), rows) if payload.mass else ()
