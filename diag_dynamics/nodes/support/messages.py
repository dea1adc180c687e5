# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages of results. Dense numbers go through array('d'), the fast legal way."""

import math
from array import array
from functools import reduce

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import WrenchStamped
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.msg import (
    ContactLimits,
    CoriolisTerm,
    DiagonalizedState,
    ExternalTorque,
    ExternalWrench,
    JointSpaceDynamics,
    KineticEnergy,
    MassMatrixFactors,
    TotalJointRates,
    WorkingMoments,
)
from diag_dynamics.msg import Load as LoadMessage
from diag_dynamics.sweeps import evaluation
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.fields import (
    evaluated_fields,
    flags_of,
    matrix_fields,
    texts_of,
    torque_fields,
)


def doubles(values):
    """float64[] of a vector or, row-major, a matrix; empty for None."""
    if values is None:
        return array("d")
    return array("d", np.ascontiguousarray(values, dtype=np.float64).tobytes())


def to_time(nanoseconds):
    """builtin_interfaces/Time of nanoseconds since the epoch."""
    sec, nanosec = divmod(nanoseconds, SECOND)
    return Time(sec=sec, nanosec=nanosec)


MATRICES = {
    "mass_matrix_factors": MassMatrixFactors,
    "joint_space_dynamics": JointSpaceDynamics,
}
"""Messages of matrices."""

EVALUATED = {
    "kinetic_energy": KineticEnergy,
    "state": DiagonalizedState,
    "total_joint_rates": TotalJointRates,
    "working_moments": WorkingMoments,
    "coriolis": CoriolisTerm,
}
"""Messages about an Evaluation."""

ORDER = *EVALUATED, *MATRICES
"""Topics about a state, in the order in which they are published: matrices last."""

MOMENTS = "ixx", "ixy", "ixz", "iyy", "iyz", "izz"
"""Fields of a geometry_msgs/Inertia."""

TOPICS = *ORDER, "external_torque"
"""Topics whose fields recordings have, too."""


def _stamp(field, nanoseconds):
    """Return the values of a builtin_interfaces/Time by path."""
    return dict(zip((f"{field}.sec", f"{field}.nanosec"), divmod(nanoseconds, SECOND), strict=True))


class MessageMaker:
    """Makes messages about one model, whose names and frame they share."""

    def __init__(self, model, revision):
        self._model = model
        self._frame = model.root_link
        self._texts = {topic: texts_of(topic, model, revision) for topic in TOPICS}
        self._dofs = self._texts["external_torque"]
        self._names = {
            topic: kind.get_fields_and_field_types().keys()
            - {*self._texts[topic], "header", "oldest_stamp"}
            for topic, kind in EVALUATED.items()
        }
        self._link_energy = np.empty((1, len(model.link_names)))
        self._workspace = model.new_workspace()

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
            Numbers and arrays by the path of their field; None for those that are unknown, which
            are empty or zero.
        shape : tuple
            What tells apart messages of this topic that have other texts, or other fields that are
            empty.
        """
        values = values | _stamp("header.stamp", state.newest)
        return self._encode(topic, kind, texts, values, shape)

    def _encode(self, topic, kind, texts, values, shape):
        message = kind(**({"header": Header(frame_id=self._frame)} | texts))
        for path, value in values.items():
            *parts, field = path.split(".")
            if isinstance(value, np.ndarray):
                value = value.ravel().tolist() if value.dtype == bool else doubles(value)
            if isinstance(value, np.floating):
                value = value.item()
            if value is not None:
                setattr(reduce(getattr, parts, message), field, value)
        return message

    def evaluated(self, topic, s, state):
        """Return a message of :data:`EVALUATED` about an Evaluation and its RobotState."""
        kind = EVALUATED[topic]
        texts = self._texts[topic]
        computed = {"friction": s.friction}
        if topic == "kinetic_energy":
            energies = self._link_energy
            computed["link_energy"] = energies[0]
            robot = self._workspace.robot
            motion = s.rows[None, ws.POSITIONS], s.rows[None, ws.RATES]
            if not evaluation.link_energies(robot, self._model.links, *motion, energies):
                raise InputError("velocity is too large: the kinetic energy of a link overflows.")
        with_effort = s.epsilon is not None
        values = evaluated_fields(self._names[topic], s, state, with_effort, **computed)
        if topic == "state":
            values |= _stamp("oldest_stamp", state.oldest)
        return self.make(topic, kind, state, texts, values, (with_effort, s.friction is not None))

    def matrix(self, topic, dynamics, state, with_inverse=False):
        """Return a message of :data:`MATRICES` at a RobotState: m, D, perhaps ℓ; or M, c, g."""
        values = matrix_fields(topic, dynamics, state, with_inverse)
        return self.make(topic, MATRICES[topic], state, self._texts[topic], values, (with_inverse,))

    def external_torque(self, seen, state, alarming, touched=None):
        """Return the message of a Disturbance at a RobotState; empty where it is not valid.

        `alarming` is its Alarming, `touched` the TouchedLink, None if it is unknown.
        """
        is_touched = bool(touched and touched.link)
        links = list(touched.links) if is_touched else []
        probability = touched.probability if is_touched else None
        values = torque_fields(seen, seen.valid, state, alarming, probability)
        texts = self._dofs | {"touched_links": links}
        shape = (seen.valid, tuple(links))
        return self.make("external_torque", ExternalTorque, state, texts, values, shape)

    def external_wrench(self, frame, estimate, state):
        """Return a dynamics.ExternalWrench at the origin of a link, in its axes."""
        texts = {"header": Header(frame_id=frame)}
        return self.make(
            "external_wrench",
            WrenchStamped,
            state,
            texts,
            _wrench_values(estimate.wrench),
            (frame,),
        )

    def external_wrench_estimates(self, frame, estimate, state):
        """Return the same with its covariance; None: no result."""
        values = flags_of(state) | {"valid": estimate is not None}
        count = 0
        if estimate:
            unobserved = estimate.directions[~estimate.observed]
            values |= _wrench_values(estimate.wrench) | {"covariance": estimate.covariance.ravel()}
            values |= {"unobserved": unobserved.ravel(), "chi_square": float(estimate.chi_square)}
            count = len(unobserved)
        texts = {"header": Header(frame_id=frame)}
        shape = (frame, estimate is None, count)
        return self.make("external_wrench_estimates", ExternalWrench, state, texts, values, shape)

    def load(self, link, load, payload, state):
        """Return a Load at a link and the payload of the model there."""
        deviation = load.center_deviation if load.valid else np.full(3, math.inf)
        values = flags_of(state) | {
            "valid": load.valid,
            "mass": load.mass,
            "mass_deviation": load.mass_deviation if load.valid else math.inf,
            "explained": load.explained,
            "is_load": load.is_load,
            "payload.m": float(payload.mass),
            **_components("center_of_mass", "xyz", load.center),
            **_components("center_of_mass_deviation", "xyz", deviation),
            **_components("payload.com", "xyz", payload.com),
            **_components("payload", MOMENTS, np.asarray(payload.inertia)[np.triu_indices(3)]),
        }
        texts = {"header": Header(frame_id=link)}
        return self.make("load", LoadMessage, state, texts, values, (link,))

    def contact_limits(self, contact, state):
        """Return the message of a PredictedContact at a RobotState."""
        texts = {"point_names": list(contact.names), "link_names": list(contact.links)}
        values = flags_of(state) | {
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
        return self.make("contact_limits", ContactLimits, state, texts, values, (contact.points,))


def _components(field, names, numbers):
    """Return numbers by the path of their field."""
    return {f"{field}.{name}": float(x) for name, x in zip(names, numbers, strict=True)}


def _wrench_values(wrench):
    force = _components("wrench.force", "xyz", wrench[:3])
    return force | _components("wrench.torque", "xyz", wrench[3:])


class BytesMaker(MessageMaker):
    """Makes the same messages as bytes: rclpy lays each out once, then its numbers are replaced.

    Should rclpy serialize a message otherwise than :class:`Template` does, the message itself is
    returned.

    Attributes
    ----------
    unlike : set of str
        Topics of which rclpy makes other bytes.
    """

    def __init__(self, model, revision):
        super().__init__(model, revision)
        self._layouts = {}
        self.unlike = set()

    def _encode(self, topic, kind, texts, values, shape):
        if (topic, shape) not in self._layouts:
            message = super()._encode(topic, kind, texts, values, shape)
            if topic in self.unlike or not self._lay_out((topic, shape), message, values):
                self.unlike.add(topic)
                return message
        template, views = self._layouts[topic, shape]
        for field, view in views:
            view[...] = values[field]
        return template.encoded()

    def _lay_out(self, key, message, values):
        """Store the template of a message; return whether rclpy makes the same bytes."""
        template = Template(message)
        if not template.holds(serialize_message(message)):
            return False
        self._layouts[key] = (
            template,
            [
                (field, view.reshape(np.shape(values[field]) or 1))
                for field, view in template.numbers.items()
                if values.get(field) is not None
            ],
        )
        return True
