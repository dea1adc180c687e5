# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The dynamics services: each answers with numbers, or with success = false and a message that names the fault."""

import re

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.model import Payload
from diag_dynamics.nodes.support.guard import answered
from diag_dynamics.nodes.support.messages import doubles
from diag_dynamics.nodes.support.publishing import SERVICE_QOS
from diag_dynamics.nodes.support.requests import (
    requested_acceleration,
    requested_gravity,
    requested_state,
    requested_wrenches,
)
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics, SetPayload


class DynamicsServices:
    """Offers forward_dynamics, inverse_dynamics, diagonalize and set_payload on a node.

    Parameters
    ----------
    node : rclpy.node.Node
    current : callable
        Returns the (DiagonalDynamics, MessageMaker, Followers) in force, or None while there is no model.
    put_on : callable
        Called with a link and its :class:`Payload`, which is checked, to put it in force; returns the model then in force.
    """

    def __init__(self, node, current, put_on):
        self._node = node
        self._current = current
        self._put_on = put_on
        for kind, name, answer in (
            (ForwardDynamics, "forward_dynamics", self._forward),
            (InverseDynamics, "inverse_dynamics", self._inverse),
            (Diagonalize, "diagonalize", self._diagonalize),
            (SetPayload, "set_payload", self._set_payload),
        ):
            callback = answered(node, kind, self._with_current(answer), _by_fields)
            node.create_service(kind, f"~/{name}", callback, qos_profile=SERVICE_QOS)

    def _with_current(self, answer):
        """`answer`, with the robot in force."""

        def callback(request, response):
            current = self._current()
            if current is None:
                raise InputError("There is no robot model yet: waiting for a valid robot_description.")
            answer(request, response, *current)

        return callback

    def _forward(self, request, response, dynamics, maker, followers):
        dynamics = _with_gravity(dynamics, request)
        asked = requested_state(dynamics.model, request, followers)
        f_ext, frame = requested_wrenches(dynamics.model, request)
        q, qd = asked.position, asked.velocity
        tau = np.zeros(dynamics.model.nv) if asked.effort is None else asked.effort
        friction = request.include_friction
        acceleration = dynamics.forward_dynamics(q, qd, tau, f_ext, frame=frame, friction=friction)
        s = dynamics.evaluate(q, qd, tau, f_ext, frame=frame, friction=friction)
        response.dof_names = list(dynamics.model.dof_names)
        response.acceleration = doubles(acceleration)
        response.nu_dot = doubles(s.nu_dot)

    def _inverse(self, request, response, dynamics, maker, followers):
        dynamics = _with_gravity(dynamics, request)
        asked = requested_state(dynamics.model, request, followers)
        qdd = requested_acceleration(dynamics.model, request, asked.joints)
        f_ext, frame = requested_wrenches(dynamics.model, request)
        response.dof_names = list(dynamics.model.dof_names)
        options = {"frame": frame, "friction": request.include_friction}
        response.effort = doubles(dynamics.inverse_dynamics(asked.position, asked.velocity, qdd, f_ext, **options))

    def _diagonalize(self, request, response, dynamics, maker, followers):
        dynamics = _with_gravity(dynamics, request)
        q, qd, tau, _ = requested_state(dynamics.model, request, followers)
        f_ext, frame = requested_wrenches(dynamics.model, request)
        s = dynamics.evaluate(q, qd, tau, f_ext, frame=frame, friction=request.include_friction)
        stamp = request.state.header.stamp
        at = stamp.sec * 1_000_000_000 + stamp.nanosec
        state = RobotState(q, qd, tau, at, at, False)
        M, c, g = dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
        response.state = maker.evaluated("state", s, state)
        response.external = doubles(s.external)
        response.coriolis = maker.evaluated("coriolis", s, state)
        response.factors = maker.mass_matrix_factors(dynamics.factors(q), True, state)
        response.kinetic_energy = maker.evaluated("kinetic_energy", s, state)
        response.joint_space_dynamics = maker.joint_space_dynamics(M, c, g, state)

    def _set_payload(self, request, response, dynamics, maker, followers):
        i = request.inertia
        inertia = [[i.ixx, i.ixy, i.ixz], [i.ixy, i.iyy, i.iyz], [i.ixz, i.iyz, i.izz]]
        com = (i.com.x, i.com.y, i.com.z)
        dynamics.model.with_payload(request.link, i.m, com, inertia)  # refuses what is wrong, by name
        response.total_mass = self._put_on(request.link, Payload(i.m, com, inertia)).total_mass


def _with_gravity(dynamics, request):
    gravity = requested_gravity(request)
    return dynamics if gravity is None else DiagonalDynamics(dynamics.model.with_gravity(gravity))


_FIELDS = {
    "q": "state.position",
    "qd": "state.velocity",
    "tau": "state.effort",
    "qdd": "acceleration",
    "f_ext": "wrenches",
    "payloads: mass": "inertia.m",
    "payloads: com": "inertia.com",
    "payloads: inertia": "inertia.ixx to inertia.izz",
    "payloads:": "link:",
}
"""What a request calls what the library calls otherwise."""


def _by_fields(text):
    """What the library says is wrong, with the request's fields in place of its own arguments."""
    if "too large" in text:
        arguments, _, rest = text.partition(" are ")
        return re.sub(r"\w+", lambda word: _FIELDS.get(word[0], word[0]), arguments) + " are " + rest
    own = next((argument for argument in _FIELDS if text.startswith(argument) and ":" in argument), "")
    return _FIELDS.get(own, "") + text[len(own) :]
