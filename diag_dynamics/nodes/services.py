"""The dynamics services: each answers with numbers, or with success = false and a message that names the fault."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import DiagDynamicsError, UnsupportedError
from diag_dynamics.nodes.joint_states import RobotState
from diag_dynamics.nodes.messages import doubles, in_model_order, requested_gravity, requested_state, to_time
from diag_dynamics.srv import Diagonalize, ForwardDynamics, InverseDynamics


class DynamicsServices:
    """Offers forward_dynamics, inverse_dynamics and diagonalize on a node.

    Parameters
    ----------
    node : rclpy.node.Node
    current : callable
        Returns the (DiagonalDynamics, MessageMaker) in force, or None while there is no model.
    """

    def __init__(self, node, current):
        self._node = node
        self._current = current
        for kind, name, answer in (
            (ForwardDynamics, "forward_dynamics", self._forward),
            (InverseDynamics, "inverse_dynamics", self._inverse),
            (Diagonalize, "diagonalize", self._diagonalize),
        ):
            node.create_service(kind, f"~/{name}", self._guarded(kind, answer))

    def _guarded(self, kind, answer):
        """`answer`, with every failure turned into a response."""

        def callback(request, response):
            current = self._current()
            if current is None:
                response.message = "There is no robot model yet: waiting for a valid robot_description."
                return response
            try:
                answer(request, response, *current)
                response.success = True
            except DiagDynamicsError as error:
                response = kind.Response(success=False, message=str(error))
            except Exception as error:  # a request must not end the node
                self._node.get_logger().error(f"{kind.__name__}: {error!r}")
                response = kind.Response(success=False, message=f"Internal error: {error!r}")
            return response

        return callback

    def _forward(self, request, response, dynamics, maker):
        dynamics = _with_gravity(dynamics, request)
        _no_wrenches(request)
        q, qd, tau, _ = requested_state(dynamics.model, request.state)
        qd, tau = _or_zero(qd, q), _or_zero(tau, q)
        acceleration = dynamics.forward_dynamics(q, qd, tau)
        s = dynamics.evaluate(q, qd, tau)
        response.dof_names = list(dynamics.model.dof_names)
        response.acceleration = doubles(acceleration)
        response.nu_dot = doubles(s.epsilon - s.gravity - s.coriolis)

    def _inverse(self, request, response, dynamics, maker):
        dynamics = _with_gravity(dynamics, request)
        _no_wrenches(request)
        model = dynamics.model
        q, qd, _, order = requested_state(model, request.state)
        qdd = in_model_order(model, "acceleration", request.acceleration, len(request.state.name), order)
        response.dof_names = list(model.dof_names)
        response.effort = doubles(dynamics.inverse_dynamics(q, _or_zero(qd, q), _or_zero(qdd, q)))

    def _diagonalize(self, request, response, dynamics, maker):
        dynamics = _with_gravity(dynamics, request)
        q, qd, tau, _ = requested_state(dynamics.model, request.state)
        qd = _or_zero(qd, q)
        s = dynamics.evaluate(q, qd, tau)
        stamp = request.state.header.stamp
        at = stamp.sec * 1_000_000_000 + stamp.nanosec
        response.state = maker.state(to_time(at), s, RobotState(q, qd, tau, at, at, False))
        response.coriolis = maker.coriolis(stamp, s)
        response.factors = maker.mass_matrix_factors(stamp, dynamics.factors(q), with_inverse=True)
        response.kinetic_energy = maker.kinetic_energy(stamp, s)
        response.joint_space_dynamics = maker.joint_space_dynamics(
            stamp, dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
        )


def _with_gravity(dynamics, request):
    gravity = requested_gravity(request)
    return dynamics if gravity is None else DiagonalDynamics(dynamics.model.with_gravity(gravity))


def _no_wrenches(request):
    if request.wrench_links or request.wrenches:
        raise UnsupportedError("wrench_links, wrenches: external wrenches are not offered yet.")


def _or_zero(values, like):
    return np.zeros_like(like) if values is None else values
