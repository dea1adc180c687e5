# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor's services of dynamics."""

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.joints import RobotState
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.nodes.monitor.load import payload_of
from diag_dynamics.nodes.support.guard import answered
from diag_dynamics.nodes.support.messages import doubles
from diag_dynamics.nodes.support.publishing import SERVICE_QOS
from diag_dynamics.nodes.support.requests import read_acceleration, read_state, read_wrenches
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics, SetPayload


class DynamicsServices:
    """Services of a node; `current` returns dynamics, MessageMaker and Followers, or None."""

    def __init__(self, node, current, set_payload):
        self._current, self._attach = current, set_payload
        for kind, name, answer in (
            (ForwardDynamics, "forward_dynamics", self._forward_dynamics),
            (InverseDynamics, "inverse_dynamics", self._inverse_dynamics),
            (Diagonalize, "diagonalize", self._diagonalize),
            (SetPayload, "set_payload", self._set_payload),
        ):
            callback = answered(node, kind, answer)
            node.create_service(kind, f"~/{name}", callback, qos_profile=SERVICE_QOS)

    def _robot(self):
        if (current := self._current()) is None:
            raise InputError("There is no robot yet. The node waits for a valid robot_description.")
        return current

    def _read(self, request):
        """Return the dynamics, MessageMaker, state and options of a request."""
        dynamics, maker, followers = self._robot()
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
        M, c, g = dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
        response.state = maker.evaluated("state", s, state)
        response.external = doubles(s.external)
        response.coriolis = maker.evaluated("coriolis", s, state)
        response.factors = maker.mass_matrix_factors(dynamics.factors(q), True, state)
        response.kinetic_energy = maker.evaluated("kinetic_energy", s, state)
        response.joint_space_dynamics = maker.joint_space_dynamics(M, c, g, state)

    def _set_payload(self, request, response):
        payload = payload_of(request.inertia)
        self._robot()[0].model.with_payload(request.link, *payload)  # raises InputError
        response.total_mass = self._attach(request.link, payload).total_mass
