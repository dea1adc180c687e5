# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor's services: dynamics, and the payload from requests and loads."""

from std_srvs.srv import Trigger

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.model import Payload
from diag_dynamics.nodes.support.guard import offer
from diag_dynamics.nodes.support.messages import doubles
from diag_dynamics.nodes.support.requests import read_acceleration, read_state, read_wrenches
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics, SetPayload


class Services:
    """Services of a monitor.

    `robot` returns the MonitoredRobot or None; `set_payload` changes one payload and returns the
    model with it.
    """

    def __init__(self, node, robot, set_payload):
        self._robot = robot
        self._attach = set_payload
        for kind, name, answer in (
            (ForwardDynamics, "forward_dynamics", self._forward_dynamics),
            (InverseDynamics, "inverse_dynamics", self._inverse_dynamics),
            (Diagonalize, "diagonalize", self._diagonalize),
            (SetPayload, "set_payload", self._set_payload),
            (Trigger, "accept_payload", self._accept_payload),
        ):
            offer(node, kind, name, answer)

    def _required(self):
        robot = self._robot()
        if robot is None:
            raise InputError("There is no robot yet. The node waits for a valid robot_description.")
        return robot

    def _read(self, request):
        """Return the dynamics, MessageMaker, state and options of a request."""
        robot = self._required()
        dynamics = robot.dynamics
        if request.override_gravity:
            g = request.gravity
            dynamics = DiagonalDynamics(dynamics.model.with_gravity((g.x, g.y, g.z)))
        state = read_state(dynamics.model, request, robot.assembler.followers)
        options = read_wrenches(dynamics.model, request) | {"friction": request.include_friction}
        return dynamics, robot.maker, state, options

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
        self._required().model.with_payload(request.link, *payload)  # raises InputError
        response.total_mass = self._attach(request.link, payload).total_mass

    def _accept_payload(self, *_):
        """Add the load to the payload of its link; return a message."""
        load = self._required().load
        if not load.estimator:
            raise InputError(
                "parameter 'load.link' is ''; expected a link. Set it to have loads estimated."
            )
        estimate = load.estimate
        if not estimate.is_load:
            value = (
                f"{estimate.mass:.3g} ± {estimate.mass_deviation:.2g} kg"
                if estimate.valid
                else f"unknown: {estimate.reason}"
            )
            raise InputError(
                f"load on link '{load.link}' is {value}; expected a recognized load. "
                "Move the arm with the load."
            )
        payload = load.estimator.payload()
        self._attach(load.link, payload)
        return f"The payload of '{load.link}' is {payload.mass:.3g} kg."


def payload_of(i):
    """Return the Payload of a geometry_msgs/Inertia."""
    inertia = ((i.ixx, i.ixy, i.ixz), (i.ixy, i.iyy, i.iyz), (i.ixz, i.iyz, i.izz))
    return Payload(i.m, (i.com.x, i.com.y, i.com.z), inertia)
