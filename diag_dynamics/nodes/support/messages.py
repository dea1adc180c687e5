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
from diag_dynamics.sweeps import evaluation
from diag_dynamics.sweeps import workspace as ws
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
        fields = {
            "torque_threshold": self.limits[:-2],
            "torque_norm_threshold": float(self.limits[-2]),
        }
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
ROWS |= {
    "total": ws.KINETIC_ENERGY,
    "power": ws.EFFORT_POWER,
    "position": ws.POSITIONS,
    "velocity": ws.RATES,
}
"""Rows of an Evaluation's memory that fields of these messages are read from."""

OF_EFFORT = (ws.EPSILON, ws.KAPPA, ws.EFFORT_POWER)
"""Rows that are empty without effort."""

SECONDS = struct.Struct("<iI")
"""A builtin_interfaces/Time."""

FLAGS = "stamp_is_receive_time", "velocity_estimated"
"""Fields of most messages that a RobotState has, too."""


class MessageMaker:
    """Makes messages about one model, whose names and frame they share."""

    def __init__(self, model, revision):
        self._model, self._revision, self._frame, self._nv = (
            model,
            revision,
            model.root_link,
            model.nv,
        )
        self._dofs = {"dof_names": list(model.dof_names)}
        positions = (
            [] if model.coordinate_names == model.dof_names else list(model.coordinate_names)
        )
        self._texts, self._places = dict.fromkeys(EVALUATED, self._dofs), {}
        self._texts["kinetic_energy"] = self._dofs | {"link_names": list(model.link_names)}
        self._texts["state"] = self._dofs | {
            "position_names": positions,
            "model_revision": revision,
        }
        self._link_energy, self._workspace = np.empty(len(model.link_names)), model.new_workspace()

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
        kind, with_effort, with_friction = (
            EVALUATED[topic],
            s.epsilon is not None,
            s.friction is not None,
        )
        if (topic, with_effort) not in self._places:
            self._places[topic, with_effort] = self._places_of(kind, with_effort)
        places, flags = self._places[topic, with_effort]
        valid = {
            "effort_valid": with_effort,
            "power_valid": with_effort,
            "friction_valid": with_friction,
        }
        values = {field: s.rows.item(at) if at[1] == 0 else s.rows[at] for field, at in places}
        values |= {flag: valid[flag] if flag in valid else getattr(state, flag) for flag in flags}
        values |= self._beside(topic, s, state)
        return self.make(
            topic, kind, state, self._texts[topic], values, (with_effort, with_friction)
        )

    def _places_of(self, kind, with_effort):
        """Return the fields of a message with their places in the rows of an Evaluation, and its flags."""
        fields, counts = kind.get_fields_and_field_types(), {ws.POSITIONS: self._model.nq}
        rows = [(field, ROWS[field]) for field in fields if field in ROWS]
        places = [
            (field, (row, slice(counts.get(row, self._nv)) if "sequence" in fields[field] else 0))
            for field, row in rows
            if with_effort or row not in OF_EFFORT
        ]
        return places, [
            flag
            for flag in (*FLAGS, "effort_valid", "power_valid", "friction_valid")
            if flag in fields
        ]

    def _beside(self, topic, s, state):
        """Return the fields that are no rows; None for those that are unknown."""
        if topic == "kinetic_energy":
            energies = self._link_energy
            if not evaluation.link_energy(
                self._workspace.robot, self._model.links, s.rows, energies
            ):
                raise InputError("velocity is too large: the kinetic energy of a link overflows.")
            return {"link_energy": energies, "base_energy": s.base_energy}
        if topic == "coriolis":
            return {"friction": s.friction}
        if topic != "state":
            return {}
        sec, nanosec = divmod(state.oldest, SECOND)
        oldest = {"oldest_stamp.sec": sec, "oldest_stamp.nanosec": nanosec}
        return {"effort": state.effort, "friction": s.friction} | oldest

    def matrix(self, topic, dynamics, state, with_inverse=False):
        """Return one of topics.MATRICES at a RobotState: m, D and, if requested, ℓ; or M, c and g."""
        q, qd = state.position, state.velocity
        if topic == "mass_matrix_factors":
            m, l_inverse, _, D = dynamics.factors(q)
            values = {"model_revision": self._revision, "nv": self._nv, "m": m, "d": D}
            values |= {"l": l_inverse if with_inverse else None, "l_valid": with_inverse}
            values["stamp_is_receive_time"] = state.stamp_is_receive_time
            return self.make(topic, MassMatrixFactors, state, self._dofs, values, (with_inverse,))
        values = _flags(state) | {"mass_matrix": dynamics.mass_matrix(q)}
        values |= {"bias": dynamics.bias(q, qd), "gravity": dynamics.gravity_torque(q)}
        return self.make(topic, JointSpaceDynamics, state, self._dofs, values)

    def external_torque(self, seen, observation, state, alarming=None, contact=None, touched=None):
        """What an observer has seen: a Disturbance, by these thresholds, at a RobotState; empty where it is not valid.

        `alarming` are CollisionThresholds, `contact` ContactThresholds, `touched` is a TouchedLink.
        """
        values = _flags(state) | {
            "valid": seen.valid,
            "norm": seen.norm,
            "collision": seen.collision,
        }
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
        return self.make(
            "external_wrench", WrenchStamped, state, texts, _wrench_values(found.wrench), (frame,)
        )

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
        deviations = (
            (load.mass_deviation, load.center_deviation)
            if load.valid
            else (math.inf, np.full(3, math.inf))
        )
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

    def __init__(self, model, revision):
        super().__init__(model, revision)
        self._layouts, self.unlike = {}, set()

    def make(self, topic, kind, state, texts, values, shape=()):
        """Return the bytes of a message about a RobotState."""
        layout = self._layouts.get((topic, shape))
        if layout is None:
            message = super().make(topic, kind, state, texts, values)
            if (template := self._template(topic, message)) is None:
                return message
            layout = self._keep((topic, shape), template, values)
        for field, view in layout.views:
            view[...] = values[field]
        return layout.stamped(state)

    def evaluated(self, topic, s, state):
        """Return the bytes of a message about an Evaluation and the RobotState that it is of."""
        layout = self._layouts.get((topic, (s.epsilon is not None, s.friction is not None)))
        if layout is None:
            return super().evaluated(topic, s, state)
        layout.template.doubles[layout.target] = s.rows.take(layout.source)
        for place, flag in layout.flags:
            layout.template.data[place] = getattr(state, flag)
        if layout.beside:
            values = self._beside(topic, s, state)
            for field, view in layout.beside:
                view[...] = values[field]
        return layout.stamped(state)

    def _template(self, topic, message):
        """Return the template of a message; None if rclpy makes other bytes."""
        template = None if topic in self.unlike else Template(message)
        if template and not template.holds(serialize_message(message)):
            self.unlike.add(topic)
            return None
        return template

    def _keep(self, key, template, values):
        if len(self._layouts) >= MAX_LAYOUTS:
            self._layouts.clear()
        places = self._places[key[0], key[1][0]][0] if key[0] in EVALUATED else ()
        self._layouts[key] = _Layout(template, values, places, (ws.N_ROWS, max(self._model.nq, 1)))
        return self._layouts[key]


class _Layout:
    """The bytes of a message, and views of its fields in the shape of their values.

    Fields with `places` in the rows of an Evaluation, whose shape follows, are at `target` among the doubles of the message
    and at `source` among those of the rows. `beside` are the other fields that change, `flags` those of the state.
    """

    def __init__(self, template, values, places, shape):
        self.template, self._stamp = template, template.place("header.stamp.sec")
        numbers = {
            field: view for field, view in template.numbers.items() if values.get(field) is not None
        }
        self.views = [
            (field, view.reshape(np.shape(values[field]) or 1)) for field, view in numbers.items()
        ]
        self.flags = [(template.place(flag), flag) for flag in FLAGS if flag in numbers]
        places = {field: place for field, place in places if field in numbers}
        self.beside = [
            (field, view)
            for field, view in self.views
            if field not in places and view.dtype != bool
        ]
        rows, at = np.arange(math.prod(shape)).reshape(shape), np.arange(len(template.data)) // 8
        target = [
            at[: view.nbytes : 8] + template.place(field) // 8
            for field, view in numbers.items()
            if field in places
        ]
        self.source = np.concatenate(
            [np.ravel(rows[places[field]]) for field in numbers if field in places] or [at[:0]]
        )
        self.target = np.concatenate(target or [at[:0]])

    def stamped(self, state):
        """Return the bytes with the stamp of a RobotState."""
        SECONDS.pack_into(self.template.data, self._stamp, *divmod(state.newest, SECOND))
        return self.template.encoded()
