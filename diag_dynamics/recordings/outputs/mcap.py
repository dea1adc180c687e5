# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP: messages of the monitor about every state."""

from contextlib import suppress
from importlib import import_module

import numpy as np

import diag_dynamics
from diag_dynamics.atomic_file import AtomicFile
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.optional import require
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts, message_type

TOPICS = {
    "state": "DiagonalizedState",
    "kinetic_energy": "KineticEnergy",
    "total_joint_rates": "TotalJointRates",
    "working_moments": "WorkingMoments",
    "coriolis": "CoriolisTerm",
    "external_torque": "ExternalTorque",
    "joint_space_dynamics": "JointSpaceDynamics",
    "mass_matrix_factors": "MassMatrixFactors",
}
"""Topics and their types."""
WRITTEN = "state", "kinetic_energy", "external_torque"
"""Default topics; those of matrices are large."""
NODE = "/diag_dynamics"  # name of the monitor whose topics they are

UNKNOWN = (
    {"effort", "epsilon", "kappa", "power"},
    {"residual", "external_torque", "joint_collision"},
)
"""Fields that are empty or 0 without effort, and without a result of the observer."""
VALUES = {
    "position": lambda piece, _: piece.states.position,
    "velocity": lambda piece, _: piece.states.velocity,
    "effort": lambda piece, _: piece.states.effort,
    "stamp_is_receive_time": lambda piece, _: piece.states.stamp_received,
    "velocity_estimated": lambda piece, _: piece.states.velocity_estimated,
    "power": lambda piece, _: piece.s.effort_power,
    "total": lambda piece, _: piece.s.kinetic_energy,
    "residual": lambda piece, _: piece.observed.residual,
    "external_torque": lambda piece, _: piece.observed.external_torque,
    "norm": lambda piece, _: np.where(piece.observed.valid, piece.observed.norm, 0.0),
    "collision": lambda piece, _: piece.observed.collision,
    "contact": lambda piece, _: piece.contact.alarm,
    "torque_norm": lambda piece, _: np.where(
        piece.observed.valid, np.linalg.norm(piece.observed.external_torque, axis=1), 0.0
    ),
    "joint_collision": lambda piece, _: piece.judged.joints,
    "mass_matrix": lambda piece, dynamics: dynamics.mass_matrix(piece.states.position),
    "bias": lambda piece, dynamics: dynamics.bias(piece.states.position, piece.states.velocity),
    "gravity_torque": lambda piece, dynamics: dynamics.gravity_torque(piece.states.position),
    "m": lambda piece, dynamics: np.array([dynamics.factors(q).m for q in piece.states.position]),
    "d": lambda piece, dynamics: np.array([dynamics.factors(q).D for q in piece.states.position]),
    "l": lambda piece, dynamics: np.array([dynamics.factors(q).l for q in piece.states.position]),
}
"""Values of fields, a row for each state; others are those of the evaluation with the same name."""
REVISION = 1


class McapOutput:
    """Write messages about each state on some topics, at the log time of the message that completed the state."""

    def __init__(self, path, reading, friction, topics):
        for topic in topics:
            if topic not in TOPICS:
                raise InputError(f"topics has '{topic}'; expected any of {', '.join(TOPICS)}.")
        for library in ("mcap", "lz4.frame"):
            require(library, "writing MCAP")
        chunks = import_module("diag_dynamics.recordings.outputs.chunks")
        self._target, self._count = AtomicFile(path), 0
        with self._target.errors():
            self._file = chunks.ChunkedFile(
                self._target.name, f"diag_dynamics {diag_dynamics.__version__}"
            )
        self._topics = {}  # by channel
        for topic in topics:
            rows = TopicRows(topic, reading, friction, chunks.PREFIX)
            definition = definition_with_parts(rows.type).encode()
            self._topics[self._file.register(f"{NODE}/{topic}", rows.type, definition)] = rows

    def write(self, piece):
        """Write messages about a piece."""
        times = piece.states.log_time  # those of a table may restart
        numbers = self._count + np.argsort(np.argsort(times, kind="stable"), kind="stable")
        self._count += len(times)
        for channel, topic in self._topics.items():
            for which, rows in topic.make_rows(piece):
                with self._target.errors():
                    self._file.write_messages(channel, times[which], numbers[which], rows)

    def close(self, _summary=None):
        """Complete the file and give it its name."""
        with self._target.errors():
            self._file.finish()
        self._target.commit()

    def drop(self):
        """Delete the file."""
        with suppress(OSError):  # the disk may be full
            self._file.close()
        self._target.discard()


class TopicRows:
    """Make the messages of one topic, a row of bytes for each state."""

    def __init__(self, topic, reading, friction, prefix):
        model, observation = reading.model, reading.settings.observation
        self.type, self._topic, self._templates = f"diag_dynamics/msg/{TOPICS[topic]}", topic, {}
        self._prefix = prefix
        self._dynamics, self._message = DiagonalDynamics(model), message_type(self.type)
        limits = (
            observation.alarms.limits(model.dof_names)
            if observation and observation.alarms
            else None
        )
        low = (
            observation.contact.limits(model.dof_names)
            if observation and observation.contact
            else None
        )
        self._constants = {
            "dof_names": list(model.dof_names),
            "link_names": list(model.link_names),
            "position_names": []
            if model.coordinate_names == model.dof_names
            else list(model.coordinate_names),
            "model_revision": REVISION,
            "nv": model.nv,
            "l_valid": True,
            "friction_valid": friction,
            "threshold": observation.threshold if observation else np.inf,
            "release_threshold": observation.release if observation else np.inf,
            "torque_norm_threshold": np.inf if limits is None else limits[-2],
            "torque_threshold": [] if limits is None else limits[:-2].tolist(),
            "contact_threshold": np.inf if low is None else low[-1],
            "contact_torque_norm_threshold": np.inf if low is None else low[-2],
            "contact_torque_threshold": [] if low is None else low[:-2].tolist(),
            "touched_link": "",
            "touched_link_confidence": 0.0,
        }
        self._constants |= {"contact": False} if low is None else {}
        self._constants |= {} if friction else {"friction": []}
        self._constants |= {"joint_collision": []} if limits is None else {}

    def make_rows(self, piece):
        """Yield indices of states, and their messages as uint8 of shape (number of states, PREFIX + bytes)."""
        by_result = self._topic == "external_torque"
        known = piece.observed.valid if by_result else piece.states.effort_known
        values = self._values(piece)
        for is_known in (True, False):
            which = np.flatnonzero(known == is_known)
            if not len(which):
                continue
            kept = {
                path: x for path, x in values.items() if is_known or path not in UNKNOWN[by_result]
            }
            if is_known not in self._templates:
                self._templates[is_known] = self._make_template(kept, is_known)
            template = self._templates[is_known]
            rows = np.empty((len(which), self._prefix + len(template.data)), np.uint8)
            rows[:, self._prefix :] = template.data
            for path, column in kept.items():
                begin, numbers = self._prefix + template.place(path), template.numbers[path]
                column = np.ascontiguousarray(column[which].reshape(len(which), -1), numbers.dtype)
                rows[:, begin : begin + numbers.nbytes] = column.view(np.uint8)
            yield which, rows

    def _values(self, piece):
        """Return by the paths of fields their values, a row for each state."""
        states, values = piece.states, {}
        for field in self._message.get_fields_and_field_types():
            if field in ("header", "oldest_stamp"):
                stamp, path = (
                    (states.stamp, "header.stamp")
                    if field == "header"
                    else (states.oldest_stamp, field)
                )
                values |= {f"{path}.sec": stamp // SECOND, f"{path}.nanosec": stamp % SECOND}
            elif field not in self._constants and not field.endswith("valid"):
                name = (
                    "gravity_torque"
                    if (self._topic, field) == ("joint_space_dynamics", "gravity")
                    else field
                )
                values[field] = (
                    VALUES[name](piece, self._dynamics)
                    if name in VALUES
                    else getattr(piece.s, name)
                )
        return values

    def _make_template(self, values, is_known):
        """Return the template of messages with these values, with effort or a result of the observer or without."""
        message = self._message()
        message.header.frame_id = self._dynamics.model.root_link
        for field, kind in message.get_fields_and_field_types().items():
            if field in self._constants:
                setattr(message, field, self._constants[field])
            elif field.endswith("valid"):
                setattr(message, field, is_known)
            elif kind.startswith("sequence") and field in values:
                setattr(message, field, values[field][0].ravel().tolist())
        return Template(message)
