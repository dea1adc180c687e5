# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""From results to messages and from requests to vectors. Dense numbers go through array('d'), the fast legal way."""

import math
import struct
from array import array
from functools import reduce
from typing import NamedTuple

import numpy as np
from builtin_interfaces.msg import Time
from geometry_msgs.msg import Inertia, Vector3, WrenchStamped
from rclpy.serialization import serialize_message
from std_msgs.msg import Header

from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.msg import (
    Contact,
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
from diag_dynamics.sweeps import evaluation, records
from diag_dynamics.sweeps import workspace as ws
from diag_dynamics.wire.cdr import HEADER, Template

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


class CollisionThresholds(NamedTuple):
    """Thresholds of external torque by joint, and the joints whose collision lasts.

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


class ContactThresholds(NamedTuple):
    """Thresholds of contact, as in CollisionThresholds, and whether there is a contact."""

    limits: np.ndarray
    on: bool

    def fields(self):
        """Fields of ExternalTorque."""
        joints, norm, r = self.limits[:-2], float(self.limits[-2]), float(self.limits[-1])
        fields = {"contact_torque_threshold": joints, "contact_torque_norm_threshold": norm}
        return fields | {"contact": self.on, "contact_threshold": r}


EVALUATED = {
    "total_joint_rates": TotalJointRates,
    "working_moments": WorkingMoments,
    "coriolis": CoriolisTerm,
    "kinetic_energy": KineticEnergy,
    "state": DiagonalizedState,
}
"""Messages about an Evaluation."""

SAME = "nu", "xi", "epsilon", "kappa", "coriolis", "coriolis_unnormalized", "gravity"
SAME += "energy_share", "articulated_inertia", "kinetic_energy"
ROWS = {field: getattr(ws, field.upper()) for field in SAME}
ROWS |= {"total": ws.KINETIC_ENERGY, "power": ws.EFFORT_POWER, "position": ws.POSITIONS, "velocity": ws.RATES}
"""Rows of an Evaluation's memory that fields of these messages are read from."""

OF_EFFORT = (ws.EPSILON, ws.KAPPA, ws.EFFORT_POWER)
"""Rows that are empty without effort."""

SECONDS = struct.Struct("<iI")
"""A builtin_interfaces/Time."""

FLAGS = "stamp_is_receive_time", "velocity_estimated"
"""Fields of most messages that a RobotState has, too."""


class MessageMaker:
    """Makes messages about one model, whose names and frame they share."""

    def __init__(self, model, revision=0):
        self._model, self._revision, self._frame, self._nv = model, revision, model.root_link, model.nv
        self._dofs = {"dof_names": list(model.dof_names)}
        positions = [] if model.coordinate_names == model.dof_names else list(model.coordinate_names)
        self._texts = {
            "kinetic_energy": {"link_names": list(model.link_names)},
            "state": {"position_names": positions, "model_revision": revision},
        }
        self._link_energy, self._work = np.empty(len(model.link_names)), np.zeros(len(model.bodies), records.WORK)

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
            Numbers and arrays by the path of their field; None for those that are unknown, which are empty or zero.
        shape : tuple
            What tells apart messages of this topic that have other texts, or other fields that are empty.
        """
        message = kind(**({"header": Header(frame_id=self._frame)} | texts))
        message.header.stamp = to_time(state.newest)
        for path, value in values.items():
            *parts, field = path.split(".")
            if isinstance(value, np.ndarray):
                value = value.ravel().tolist() if value.dtype == bool else doubles(value)
            if value is not None:
                setattr(reduce(getattr, parts, message), field, value)
        return message

    def evaluated(self, topic, s, state):
        """Return a message of :data:`EVALUATED` about an Evaluation and the RobotState that it is of."""
        kind = EVALUATED[topic]
        with_effort, with_friction = s.epsilon is not None, s.friction is not None
        valid = {"effort_valid": with_effort, "power_valid": with_effort, "friction_valid": with_friction}
        fields = kind.get_fields_and_field_types()
        values = {field: flag for field, flag in (valid | _flags(state)).items() if field in fields}
        for field, row in _rows_of(kind, with_effort).items():
            count = self._count(field, row)
            values[field] = s.rows[row, :count] if "sequence" in fields[field] else s.rows.item(row, 0)
        texts = self._dofs | self._texts.get(topic, {})
        message = MessageMaker.make(self, topic, kind, state, texts, values | self._beside(topic, s, state))
        if topic == "state":
            message.oldest_stamp = to_time(state.oldest)
        return message

    def _count(self, field, row):
        """Return how many numbers of a row a field has."""
        if row in (ws.KINETIC_ENERGY, ws.EFFORT_POWER):
            return 1
        return self._model.nq if row == ws.POSITIONS else self._nv

    def _beside(self, topic, s, state):
        """Return the fields that are no rows; None for those that are unknown."""
        if topic == "kinetic_energy":
            energies = self._link_energy
            if not evaluation.link_energy(self._model.bodies, self._model.links, self._work, s.rows, energies):
                raise InputError("velocity is too large: the kinetic energy of a link overflows.")
            return {"link_energy": energies, "base_energy": s.base_energy}
        if topic == "coriolis":
            return {"friction": s.friction}
        return {"effort": state.effort, "friction": s.friction} if topic == "state" else {}

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

    def matrix(self, topic, dynamics, state, with_inverse=False):
        """Return one of topics.MATRICES at a RobotState; the factors with ℓ, if wanted."""
        q, qd = state.position, state.velocity
        if topic == "mass_matrix_factors":
            return self.mass_matrix_factors(dynamics.factors(q), with_inverse, state)
        M, c, g = dynamics.mass_matrix(q), dynamics.bias(q, qd), dynamics.gravity_torque(q)
        return self.joint_space_dynamics(M, c, g, state)

    def external_torque(self, seen, observation, state, alarming=None, contact=None, touched=None):
        """What an observer has seen: a Disturbance, by these thresholds, at a RobotState; empty where it is not valid.

        `alarming` are CollisionThresholds, `contact` ContactThresholds, `touched` is a TouchedLink.
        """
        values = _flags(state) | {"valid": seen.valid, "norm": seen.norm, "collision": seen.collision}
        if seen.valid:
            values |= {"residual": seen.residual, "external_torque": seen.external_torque}
        values |= {"threshold": observation.threshold, "release_threshold": observation.release}
        values |= {"torque_norm": seen.torque_norm, "torque_norm_threshold": math.inf}
        values |= alarming.fields(seen.valid) if alarming else {}
        values |= {"contact_threshold": math.inf, "contact_torque_norm_threshold": math.inf}
        values |= contact.fields() if contact else {}
        link = touched.link if touched else ""
        values |= {"touched_link_confidence": touched.confidence if link else 0.0}
        shape = seen.valid, alarming is None, contact is None, link
        texts = self._dofs | {"touched_link": link}
        return self.make("external_torque", ExternalTorque, state, texts, values, shape)

    def external_wrench(self, frame, found, state):
        """Return a dynamics.ExternalWrench at the origin of a link, in its axes."""
        texts = {"header": Header(frame_id=frame)}
        return self.make("external_wrench", WrenchStamped, state, texts, _wrench_values(found.wrench), (frame,))

    def external_wrench_estimates(self, frame, found, state):
        """Return the same with its covariance; None: no result."""
        values, count = _flags(state) | {"valid": found is not None}, 0
        if found:
            unobserved = found.directions[~found.observed]
            values |= _wrench_values(found.wrench) | {"covariance": found.covariance.ravel()}
            values |= {"unobserved": unobserved.ravel(), "chi_square": float(found.chi_square)}
            count = len(unobserved)
        texts, shape = {"header": Header(frame_id=frame)}, (frame, found is None, count)
        return self.make("external_wrench_estimates", ExternalWrench, state, texts, values, shape)

    def load(self, link, load, payload, state):
        """Return a Load at a link and the payload of the model there."""
        deviations = (load.mass_deviation, load.center_deviation) if load.valid else (math.inf, np.full(3, math.inf))
        ixx, ixy, ixz, _, iyy, iyz, _, _, izz = map(float, np.ravel(payload.inertia))
        moments = {"ixx": ixx, "ixy": ixy, "ixz": ixz, "iyy": iyy, "iyz": iyz, "izz": izz}
        return LoadMessage(
            header=Header(stamp=to_time(state.newest), frame_id=link),
            valid=load.valid,
            mass=load.mass,
            mass_deviation=deviations[0],
            center_of_mass=_vector(load.center),
            center_of_mass_deviation=_vector(deviations[1]),
            explained=load.explained,
            is_load=load.is_load,
            payload=Inertia(m=payload.mass, com=_vector(payload.com), **moments),
            **_flags(state),
        )

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


def _rows_of(kind, with_effort):
    """Return the rows of fields of a message that are not empty."""
    rows = {field: ROWS[field] for field in kind.get_fields_and_field_types() if field in ROWS}
    return {field: row for field, row in rows.items() if with_effort or row not in OF_EFFORT}


def _vector(numbers):
    x, y, z = map(float, numbers)
    return Vector3(x=x, y=y, z=z)


def _flags(state):
    return {field: getattr(state, field) for field in FLAGS}


def _wrench_values(wrench):
    paths = [f"wrench.{part}.{axis}" for part in ("force", "torque") for axis in "xyz"]
    return dict(zip(paths, wrench.tolist(), strict=True))


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
            if (template := self._template(topic, message)) is None:
                return message
            layout = self._keep((topic, shape), _Layout([(topic, template, values, {})]))
        layout.write(state, lambda _: values)
        return layout.parts[0].tobytes()

    def evaluated(self, topic, s, state):
        """Return the bytes of a message about an Evaluation and the RobotState that it is of."""
        return self.evaluated_all((topic,), s, state)[0]

    def evaluated_all(self, topics, s, state):
        """Return the bytes of several such messages."""
        key = topics, s.epsilon is None, s.friction is None
        layout = self._layouts.get(key)
        if layout is None:
            messages = [MessageMaker.evaluated(self, topic, s, state) for topic in topics]
            templates = list(map(self._template, topics, messages))
            if None in templates:
                alone = len(topics) == 1
                return messages if alone else [self.evaluated(topic, s, state) for topic in topics]
            parts = zip(topics, templates, strict=True)
            layout = self._keep(key, _Layout([self._part(topic, one, s, state) for topic, one in parts]))
        layout.write(state, lambda topic: self._beside(topic, s, state), s.rows)
        return [part.tobytes() for part in layout.parts]

    def _template(self, topic, message):
        """Return the template of a message; None if rclpy makes other bytes."""
        template = None if topic in self.unlike else Template(message)
        if template and not template.holds(serialize_message(message)):
            self.unlike.add(topic)
            return None
        return template

    def _part(self, topic, template, s, state):
        """Return the part of a layout for a message about an Evaluation."""
        rows = _rows_of(EVALUATED[topic], s.epsilon is not None)
        places = {field: (row * s.rows.shape[1], self._count(field, row)) for field, row in rows.items()}
        return topic, template, self._beside(topic, s, state), places

    def _keep(self, key, layout):
        if len(self._layouts) >= MAX_LAYOUTS:
            self._layouts.clear()
        self._layouts[key] = layout
        return layout


class _Layout:
    """Bytes of messages about one state, one after the other, and where their numbers are in them.

    Parameters
    ----------
    messages : sequence of tuple
        For each the topic, the Template, values by field, and the first place and the number of values of each field that is
        read from the rows of an Evaluation.

    Attributes
    ----------
    parts : list of ndarray
        The bytes of each message.
    """

    def __init__(self, messages):
        size = sum(len(template.data) + 16 for _, template, _, _ in messages)
        data, end = np.zeros(size // 8 + 1).view(np.uint8), len(HEADER)
        self._data, self._doubles, self.parts = data, data.view("<f8"), []
        self._stamps, self._oldest, self._flags, self._views = [], [], [], []
        source, target = [np.zeros(0, int)], [np.zeros(0, int)]
        for topic, template, values, places in messages:
            begin, end = end, end + len(template.data)
            data[begin:end] = template.data
            self.parts.append(data[begin:end])
            self._stamps.append(begin + len(HEADER))
            self._oldest += [begin + place for place in [template.place("oldest_stamp.sec")] if place >= 0]
            self._flags += [(begin + template.place(flag), flag) for flag in FLAGS if template.place(flag) >= 0]
            known = {one for one, value in values.items() if value is not None and one not in FLAGS}
            fields = [one for one in template.numbers if one in known]
            self._views.append((topic, self._views_of(fields, template, begin, values)))
            for field, (first, count) in places.items():
                if field in template.numbers:
                    source.append(first + np.arange(count))
                    target.append((begin + template.place(field)) // 8 + np.arange(count))
            end += (len(HEADER) - end) % 8  # numbers lie on multiples of eight
        self._source, self._target = np.concatenate(source), np.concatenate(target)

    def _views_of(self, fields, template, begin, values):
        """Return a view of the bytes of each field, in the shape of its value."""
        views = []
        for field in fields:
            kind, first = template.numbers[field].dtype, begin + template.place(field)
            view = self._data[first : first + template.numbers[field].nbytes].view(kind)
            views.append((field, view.reshape(np.shape(values[field]) or 1)))
        return views

    def write(self, state, beside, rows=None):
        """Write a RobotState, the values that `beside` returns by topic, and those of the rows of an Evaluation."""
        data, stamp = self._data, divmod(state.newest, SECOND)
        for place in self._stamps:
            SECONDS.pack_into(data, place, *stamp)
        for place in self._oldest:
            SECONDS.pack_into(data, place, *divmod(state.oldest, SECOND))
        for place, flag in self._flags:
            data[place] = getattr(state, flag)
        if rows is not None:
            self._doubles[self._target] = rows.take(self._source)
        for topic, views in self._views:
            if views:
                values = beside(topic)
                for field, view in views:
                    view[...] = values[field]
