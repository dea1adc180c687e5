# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From results to messages and from requests to vectors. Dense numbers go through array('d'), the fast legal way."""

import math
from array import array
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from diag_dynamics.joint_states.stamps import SECOND
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
from diag_dynamics.wire.cdr import Template

MAX_LAYOUTS = 64
"""Layouts of messages that are kept: with efforts or without, with friction or without, of points of contact."""


def doubles(values):
    """float64[] of a vector or, row-major, a matrix; empty for None."""
    if values is None:
        return array("d")
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def to_time(nanoseconds):
    """builtin_interfaces/Time of nanoseconds since the epoch."""
    sec, nanosec = divmod(nanoseconds, SECOND)
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
    """Makes messages about one model, whose names and frame they share."""

    def __init__(self, model, revision=0):
        self._revision, self._frame, self._nv = revision, model.root_link, model.nv
        self._dofs = {"dof_names": list(model.dof_names)}
        self._links = self._dofs | {"link_names": list(model.link_names)}
        positions = [] if model.coordinate_names == model.dof_names else list(model.coordinate_names)
        self._coordinates = self._dofs | {"position_names": positions}

    def make(self, topic, kind, state, texts, values, shape=()):
        """Return a message about a RobotState.

        Parameters
        ----------
        topic : str
        kind : type
            Of the message.
        state : RobotState
        texts : dict
            Fields that are the same for all states.
        values : dict
            Numbers and arrays by field; None for those that are unknown, which are empty or zero.
        shape : tuple
            What tells apart messages of this topic that have other texts, or other fields that are empty.
        """
        message = kind(header=Header(stamp=to_time(state.newest), frame_id=self._frame), **texts)
        for field, value in values.items():
            if isinstance(value, np.ndarray):
                value = value.ravel().tolist() if value.dtype == bool else doubles(value)
            if value is not None:
                setattr(message, field, value)
        if topic == "state":
            message.oldest_stamp = to_time(state.oldest)
        return message

    def messages(self, topics, s, state):
        """Return the messages of topics about an Evaluation and the RobotState that it is of."""
        return [getattr(self, topic)(s, state) for topic in topics]

    def total_joint_rates(self, s, state):
        """ν and ξ of an Evaluation."""
        values = _flags(state) | {"nu": s.nu, "xi": s.xi}
        return self.make("total_joint_rates", TotalJointRates, state, self._dofs, values)

    def working_moments(self, s, state):
        """ε and κ, empty where the effort is unknown."""
        values = {"epsilon": s.epsilon, "kappa": s.kappa, "effort_valid": s.epsilon is not None}
        values["stamp_is_receive_time"] = state.stamp_is_receive_time
        return self.make("working_moments", WorkingMoments, state, self._dofs, values, (s.epsilon is None,))

    def coriolis(self, s, state):
        """C, C_ξ and ε_g."""
        values = _flags(state) | {"coriolis": s.coriolis, "coriolis_unnormalized": s.coriolis_unnormalized}
        values |= {"gravity": s.gravity, "friction": s.friction, "friction_valid": s.friction is not None}
        return self.make("coriolis", CoriolisTerm, state, self._dofs, values, (s.friction is None,))

    def named(self, s, state):
        """½ν_k², ν and ε by joint; without ε where the effort is unknown."""
        values = {"position": s.energy_share, "velocity": s.nu, "effort": s.epsilon}
        return self.make("named", JointState, state, {"name": self._dofs["dof_names"]}, values, (s.epsilon is None,))

    def kinetic_energy(self, s, state):
        """K, its two splits and its rate."""
        values = _flags(state) | {
            "total": s.kinetic_energy,
            "energy_share": s.energy_share,
            "link_energy": s.link_energy,
        }
        values |= {"base_energy": s.base_energy, "power": s.effort_power, "power_valid": s.effort_power is not None}
        return self.make("kinetic_energy", KineticEnergy, state, self._links, values, (s.effort_power is None,))

    def mass_matrix_factors(self, factors, with_inverse, state):
        """M and D of Factors, and ℓ if wanted."""
        values = {"model_revision": self._revision, "nv": self._nv, "m": factors.m, "d": factors.D}
        values |= {"l": factors.l if with_inverse else None, "l_valid": with_inverse}
        values["stamp_is_receive_time"] = state.stamp_is_receive_time
        return self.make("mass_matrix_factors", MassMatrixFactors, state, self._dofs, values, (with_inverse,))

    def joint_space_dynamics(self, mass_matrix, bias, gravity, state):
        """M, c and g."""
        values = _flags(state) | {"mass_matrix": mass_matrix, "bias": bias, "gravity": gravity}
        return self.make("joint_space_dynamics", JointSpaceDynamics, state, self._dofs, values)

    def external_torque(self, seen, observation, state, alarming=None):
        """What an observer has seen: a Disturbance, by these thresholds, at a RobotState; empty where it is not valid."""
        values = _flags(state) | {"valid": seen.valid, "norm": seen.norm, "collision": seen.collision}
        if seen.valid:
            values |= {"residual": seen.residual, "external_torque": seen.external_torque}
        values |= {"threshold": observation.threshold, "release_threshold": observation.release}
        values |= {"torque_norm": seen.torque_norm, "torque_norm_threshold": math.inf}
        values |= alarming.fields(seen.valid) if alarming else {}
        return self.make("external_torque", ExternalTorque, state, self._dofs, values, (seen.valid, alarming is None))

    def contact(self, contact, state):
        """Contact at the points of a robot, and the RobotState it came from."""
        texts = {"point_names": list(contact.names), "link_names": list(contact.links)}
        values = _flags(state) | {
            "valid": True,
            "limited": contact.points.limited,
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
        return self.make("contact", Contact, state, texts, values, (contact.points,))

    def state(self, s, state):
        """One evaluation, whole, with the RobotState it came from."""
        values = _flags(state) | {
            "model_revision": self._revision,
            "position": state.position,
            "velocity": state.velocity,
            "effort": state.effort,
            "effort_valid": state.effort is not None,
            "nu": s.nu,
            "xi": s.xi,
            "epsilon": s.epsilon,
            "kappa": s.kappa,
            "coriolis": s.coriolis,
            "gravity": s.gravity,
            "friction": s.friction,
            "friction_valid": s.friction is not None,
            "articulated_inertia": s.articulated_inertia,
            "kinetic_energy": s.kinetic_energy,
            "power": s.effort_power,
        }
        return self.make(
            "state", DiagonalizedState, state, self._coordinates, values, (state.effort is None, s.friction is None)
        )


def _flags(state):
    return {"stamp_is_receive_time": state.stamp_is_receive_time, "velocity_estimated": state.velocity_estimated}


class BytesMaker(MessageMaker):
    """Makes the same messages as bytes: each is laid out once by rclpy, then only its numbers are written.

    Should rclpy serialize a message otherwise than :class:`Template` does, the message itself is returned.

    Attributes
    ----------
    unlike : set of str
        Topics of which rclpy makes other bytes.
    """

    def __init__(self, model, revision=0):
        super().__init__(model, revision)
        self._layouts, self.unlike = {}, set()

    def make(self, topic, kind, state, texts, values, shape=()):
        """Return the bytes of a message about a RobotState."""
        layout = self._layouts.get((topic, shape))
        if layout is None:
            message = super().make(topic, kind, state, texts, values)
            template = None if topic in self.unlike else Template(message)
            if template is None or not template.holds(serialize_message(message)):
                self.unlike.add(topic)
                return message
            if len(self._layouts) >= MAX_LAYOUTS:
                self._layouts.clear()
            layout = self._layouts[topic, shape] = _Layout(template, values)
        return layout.write(state, values)


class _Layout:
    """Bytes of a message, and views of its numbers in the order of its values."""

    def __init__(self, template, values):
        self._template, numbers = template, template.numbers
        self._stamp, self._oldest_stamp = (
            [numbers.get(f"{path}.{part}") for part in ("sec", "nanosec")] for path in ("header.stamp", "oldest_stamp")
        )
        self._views = [
            numbers[field].reshape(np.shape(value) or 1) if value is not None and field in numbers else None
            for field, value in values.items()
        ]

    def write(self, state, values):
        """Return the bytes of the message with these values."""
        self._stamp[0][0], self._stamp[1][0] = divmod(state.newest, SECOND)
        if self._oldest_stamp[0] is not None:
            self._oldest_stamp[0][0], self._oldest_stamp[1][0] = divmod(state.oldest, SECOND)
        for view, value in zip(self._views, values.values(), strict=True):
            if view is not None:
                view[...] = value
        return self._template.encoded()
