# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From results to messages and from requests to vectors. Dense numbers go through array('d'), the fast legal way."""

import math
from array import array
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from diag_dynamics.msg import (
    Contact,
    CoriolisTerm,
    DiagonalizedState,
    ExternalTorque,
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


class Alarming(NamedTuple):
    """What external torque is judged by, joint by joint.

    Attributes
    ----------
    limits : ndarray, shape (nv + 2,)
        Of an AlarmDetector: thresholds of the joints [N m, N], of ‖m r‖ [N m] and of |r| [J^½/s].
    joints : ndarray of bool, shape (nv,)
        Which joints keep the alarm up.
    """

    limits: np.ndarray
    joints: np.ndarray

    def fields(self, valid):
        """Fields of ExternalTorque, with a result or without."""
        fields = {"torque_threshold": self.limits[:-2], "torque_norm_threshold": float(self.limits[-2])}
        return fields | ({"joint_collision": self.joints} if valid else {})


class MessageMaker:
    """Messages about one model, whose names and frame they share."""

    def __init__(self, model, revision=0):
        self._revision = revision
        self._names = list(model.dof_names)
        self._positions = [] if model.coordinate_names == model.dof_names else list(model.coordinate_names)
        self._links = list(model.link_names)
        self._frame = model.root_link
        self._nv = model.nv

    def _begin(self, kind, state):
        message = kind(header=Header(stamp=to_time(state.newest), frame_id=self._frame), dof_names=self._names)
        message.stamp_is_receive_time = state.stamp_is_receive_time
        return message

    def messages(self, topics, s, state):
        """The messages of several topics that are about an Evaluation and the RobotState it came from."""
        return [getattr(self, topic)(s, state) for topic in topics]

    def total_joint_rates(self, s, state):
        """ν and ξ of an Evaluation."""
        message = self._begin(TotalJointRates, state)
        message.velocity_estimated = state.velocity_estimated
        message.nu, message.xi = doubles(s.nu), doubles(s.xi)
        return message

    def working_moments(self, s, state):
        """ε and κ, empty where the effort is unknown."""
        message = self._begin(WorkingMoments, state)
        message.epsilon, message.kappa = doubles(s.epsilon), doubles(s.kappa)
        message.effort_valid = s.epsilon is not None
        return message

    def coriolis(self, s, state):
        """C, C_ξ and ε_g."""
        message = self._begin(CoriolisTerm, state)
        message.velocity_estimated = state.velocity_estimated
        message.coriolis = doubles(s.coriolis)
        message.coriolis_unnormalized = doubles(s.coriolis_unnormalized)
        message.gravity = doubles(s.gravity)
        message.friction, message.friction_valid = doubles(s.friction), s.friction is not None
        return message

    def named(self, s, state):
        """½ν_k², ν and ε by joint; without ε where the effort is unknown."""
        header = Header(stamp=to_time(state.newest), frame_id=self._frame)
        shares, nu, epsilon = doubles(s.energy_share), doubles(s.nu), doubles(s.epsilon)
        return JointState(header=header, name=self._names, position=shares, velocity=nu, effort=epsilon)

    def kinetic_energy(self, s, state):
        """K, its two splits and its rate."""
        message = self._begin(KineticEnergy, state)
        message.velocity_estimated = state.velocity_estimated
        message.total = s.kinetic_energy
        message.energy_share = doubles(s.energy_share)
        message.base_energy = s.base_energy
        message.link_names, message.link_energy = self._links, doubles(s.link_energy)
        message.power_valid = s.effort_power is not None
        message.power = s.effort_power or 0.0
        return message

    def mass_matrix_factors(self, factors, with_inverse, state):
        """M and D of Factors, and ℓ if wanted."""
        message = self._begin(MassMatrixFactors, state)
        message.model_revision, message.nv = self._revision, self._nv
        message.m, message.d = doubles(factors.m), doubles(factors.D)
        message.l, message.l_valid = doubles(factors.l if with_inverse else None), with_inverse
        return message

    def joint_space_dynamics(self, mass_matrix, bias, gravity, state):
        """M, c and g."""
        message = self._begin(JointSpaceDynamics, state)
        message.velocity_estimated = state.velocity_estimated
        message.mass_matrix = doubles(mass_matrix)
        message.bias, message.gravity = doubles(bias), doubles(gravity)
        return message

    def external_torque(self, seen, observation, state, alarming=None):
        """What an observer has seen: a Disturbance, by these thresholds, at a RobotState; empty where it is not valid."""
        message = self._begin(ExternalTorque, state)
        message.velocity_estimated, message.valid = state.velocity_estimated, seen.valid
        message.residual, message.external_torque = doubles(seen.residual), doubles(seen.external_torque)
        message.norm, message.collision = seen.norm, seen.collision
        message.threshold, message.release_threshold = observation.threshold, observation.release
        message.torque_norm, message.torque_norm_threshold = seen.torque_norm, math.inf
        for field, value in (alarming.fields(seen.valid) if alarming else {}).items():
            setattr(message, field, value.tolist() if isinstance(value, np.ndarray) else value)
        return message

    @staticmethod
    def contact_numbers(contact):
        """What of the message Contact changes from one state to the next, by field."""
        return {
            "positions": contact.position,
            "directions": contact.direction,
            "speed": contact.speed,
            "reflected_mass": contact.reflected_mass,
            "transferable_energy": contact.energy,
            "force": contact.force,
            "allowed_speed": contact.allowed_speed,
            "margin": contact.margin,
            "worst": int(contact.worst),
        }

    def contact(self, contact, state):
        """Contact at the points of a robot, and the RobotState it came from."""
        message = Contact(header=Header(stamp=to_time(state.newest), frame_id=self._frame), valid=True)
        message.stamp_is_receive_time = state.stamp_is_receive_time
        message.velocity_estimated = state.velocity_estimated
        message.point_names, message.link_names = list(contact.names), list(contact.links)
        message.limited = contact.points.limited.tolist()
        for field, value in self.contact_numbers(contact).items():
            setattr(message, field, doubles(value) if isinstance(value, np.ndarray) else value)
        return message

    def state(self, s, state):
        """One evaluation, whole, with the RobotState it came from."""
        message = self._begin(DiagonalizedState, state)
        message.velocity_estimated = state.velocity_estimated
        message.oldest_stamp = to_time(state.oldest)
        message.model_revision, message.position_names = self._revision, self._positions
        message.position, message.velocity = doubles(state.position), doubles(state.velocity)
        message.effort, message.effort_valid = doubles(state.effort), state.effort is not None
        message.nu, message.xi = doubles(s.nu), doubles(s.xi)
        message.epsilon, message.kappa = doubles(s.epsilon), doubles(s.kappa)
        message.coriolis, message.gravity = doubles(s.coriolis), doubles(s.gravity)
        message.friction, message.friction_valid = doubles(s.friction), s.friction is not None
        message.articulated_inertia = doubles(s.articulated_inertia)
        message.kinetic_energy, message.power = s.kinetic_energy, s.effort_power or 0.0
        return message
