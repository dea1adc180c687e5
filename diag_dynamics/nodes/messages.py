"""From results to messages and from requests to vectors. Dense numbers go through array('d'), the fast legal way."""

from array import array

import numpy as np
from builtin_interfaces.msg import Time
from std_msgs.msg import Header

from diag_dynamics.exceptions import InputError
from diag_dynamics.msg import (
    CoriolisTerm,
    DiagonalizedState,
    JointSpaceDynamics,
    KineticEnergy,
    MassMatrixFactors,
    TotalJointRates,
    WorkingMoments,
)


def doubles(values):
    """float64[] of a vector or, row-major, a matrix; empty for None."""
    if values is None:
        return array("d")
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def to_time(nanoseconds):
    """builtin_interfaces/Time of nanoseconds since the epoch."""
    sec, nanosec = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=sec, nanosec=nanosec)


class MessageMaker:
    """Messages about one model, whose names and frame they share."""

    def __init__(self, model):
        self._names = list(model.dof_names)
        self._links = list(model.link_names)
        self._frame = model.root_link
        self._nv = model.nv

    def _begin(self, kind, stamp):
        return kind(header=Header(stamp=stamp, frame_id=self._frame), dof_names=self._names)

    def total_joint_rates(self, stamp, s):
        """ν and ξ of an Evaluation."""
        message = self._begin(TotalJointRates, stamp)
        message.nu, message.xi = doubles(s.nu), doubles(s.xi)
        return message

    def working_moments(self, stamp, s):
        """ε and κ, empty where the effort is unknown."""
        message = self._begin(WorkingMoments, stamp)
        message.epsilon, message.kappa = doubles(s.epsilon), doubles(s.kappa)
        message.effort_valid = s.epsilon is not None
        return message

    def coriolis(self, stamp, s):
        """C, C_ξ and ε_g."""
        message = self._begin(CoriolisTerm, stamp)
        message.coriolis = doubles(s.coriolis)
        message.coriolis_unnormalized = doubles(s.coriolis_unnormalized)
        message.gravity = doubles(s.gravity)
        return message

    def kinetic_energy(self, stamp, s):
        """K, its two splits and its rate."""
        message = self._begin(KineticEnergy, stamp)
        message.total = s.kinetic_energy
        message.energy_share = doubles(s.energy_share)
        message.link_names, message.link_energy = self._links, doubles(s.link_energy)
        message.power_valid = s.power is not None
        message.power = s.power or 0.0
        return message

    def mass_matrix_factors(self, stamp, factors, with_inverse):
        """M and D of Factors, and ℓ if wanted."""
        message = self._begin(MassMatrixFactors, stamp)
        message.nv = self._nv
        message.m, message.d = doubles(factors.m), doubles(factors.D)
        message.l, message.l_valid = doubles(factors.l if with_inverse else None), with_inverse
        return message

    def joint_space_dynamics(self, stamp, mass_matrix, bias, gravity):
        """M, c and g."""
        message = self._begin(JointSpaceDynamics, stamp)
        message.mass_matrix = doubles(mass_matrix)
        message.bias, message.gravity = doubles(bias), doubles(gravity)
        return message

    def state(self, stamp, s, state):
        """One evaluation, whole, with the RobotState it came from."""
        message = self._begin(DiagonalizedState, stamp)
        message.oldest_stamp = to_time(state.oldest)
        message.stamp_is_receive_time = state.stamp_is_receive_time
        message.position, message.velocity = doubles(state.position), doubles(state.velocity)
        message.effort, message.effort_valid = doubles(state.effort), state.effort is not None
        message.nu, message.xi = doubles(s.nu), doubles(s.xi)
        message.epsilon, message.kappa = doubles(s.epsilon), doubles(s.kappa)
        message.coriolis, message.gravity = doubles(s.coriolis), doubles(s.gravity)
        message.articulated_inertia = doubles(s.articulated_inertia)
        message.kinetic_energy, message.power = s.kinetic_energy, s.power or 0.0
        return message


def requested_state(model, state):
    """Vectors in the model's order from a request's JointState.

    Returns
    -------
    position, velocity, effort : ndarray, shape (nv,)
        Velocity and effort are None where the request leaves them empty.
    order : ndarray of int, shape (nv,)
        Place of each degree of freedom in the request.

    Raises
    ------
    InputError
        A joint is missing, unknown or listed twice, or a field has the wrong length or is not finite.
    """
    places = {}
    known = set(model.dof_names) | set(model.fixed_joints) | set(model.mimic_joints)
    for k, name in enumerate(state.name):
        if name not in known:
            raise InputError(f"state.name: '{name}' is not a joint of robot '{model.name}'.")
        if name in places:
            raise InputError(f"state.name: joint '{name}' is listed twice.")
        places[name] = k
    missing = [name for name in model.dof_names if name not in places]
    if missing:
        raise InputError(f"state.name: joint '{missing[0]}' is missing ({len(missing)} of {model.nv} are).")
    order = np.array([places[name] for name in model.dof_names], dtype=int)
    position = in_model_order(model, "state.position", state.position, len(state.name), order)
    if position is None:
        raise InputError(f"state.position is empty, expected {len(state.name)} entries.")
    velocity = in_model_order(model, "state.velocity", state.velocity, len(state.name), order)
    effort = in_model_order(model, "state.effort", state.effort, len(state.name), order)
    return position, velocity, effort, order


def in_model_order(model, field, values, count, order):
    """One field of a request in the model's order, checked; None if it is empty although joints are listed."""
    if len(values) == 0 and count > 0:
        return None
    if len(values) != count:
        raise InputError(f"{field} has {len(values)} entries for {count} names.")
    vector = np.array(values, dtype=np.float64)[order]
    for name, value in zip(model.dof_names, vector, strict=True):
        if not np.isfinite(value):
            raise InputError(f"{field} of joint '{name}' is {value}, expected a finite number.")
    return vector


def requested_gravity(request):
    """Gravity of a request, or None where it does not override the model's."""
    if not request.override_gravity:
        return None
    g = request.gravity
    return (g.x, g.y, g.z)
