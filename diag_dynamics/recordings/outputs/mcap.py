# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP: messages of the monitor about every state."""

from contextlib import suppress
from functools import reduce
from importlib import import_module

import numpy as np

import diag_dynamics
from diag_dynamics.atomic_file import AtomicFile
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.joint_states.robot_joints import RobotState
from diag_dynamics.joint_states.stamps import SECOND
from diag_dynamics.optional import require
from diag_dynamics.recordings.external_torque import find_touched_links
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts, message_type
from diag_dynamics.wire.fields import (
    Alarming,
    evaluated_fields,
    matrix_fields,
    texts_of,
    torque_fields,
)

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

REVISION = 1


class McapOutput:
    """Write messages about each state on some topics.

    Their log time is that of the message that completed the state.
    """

    def __init__(self, path, reading, topics):
        for topic in topics:
            if topic not in TOPICS:
                raise InputError(f"topics has '{topic}'; expected any of {', '.join(TOPICS)}.")
        for library in ("mcap", "lz4.frame"):
            require(library, "writing MCAP")
        library = import_module("mcap.writer")
        self._target = AtomicFile(path)
        self._topics = {}  # by channel
        with self._target.errors():
            self._file = open(self._target.name, "wb")  # noqa: SIM115  # until close or drop
            self._writer = library.Writer(self._file, compression=library.CompressionType.LZ4)
            self._writer.start("ros2", f"diag_dynamics {diag_dynamics.__version__}")
        for topic in topics:
            rows = TopicRows(topic, reading)
            definition = definition_with_parts(rows.type).encode()
            schema = self._writer.register_schema(rows.type, "ros2msg", definition)
            name = f"{NODE}/{topic}"
            metadata = {"offered_qos_profiles": ""}
            channel = self._writer.register_channel(name, "cdr", schema, metadata)
            self._topics[channel] = rows

    def write(self, piece):
        """Write messages about a piece."""
        for channel, topic in self._topics.items():
            for places, rows in topic.make_rows(piece):
                times = piece.states.log_time[places].tolist()
                with self._target.errors():
                    for row, time in zip(rows, times, strict=True):
                        self._writer.add_message(channel, time, row.tobytes(), time)

    def close(self, _summary=None):
        """Complete the file and give it its name."""
        with self._target.errors():
            self._writer.finish()
            self._file.close()
        self._target.commit()

    def drop(self):
        """Delete the file."""
        with suppress(OSError):  # the disk may be full
            self._file.close()
        self._target.discard()


class TopicRows:
    """Make the messages of one topic, a row of bytes for each state."""

    def __init__(self, topic, reading):
        model = reading.model
        settings = reading.settings
        names = model.dof_names
        observation = settings.observation
        self.type = f"diag_dynamics/msg/{TOPICS[topic]}"
        self._topic = topic
        self._templates = {}
        self._message = message_type(self.type)
        self._dynamics = DiagonalDynamics(model)
        self._texts = texts_of(topic, model, REVISION)
        self._values = settings.values
        self._limits = np.full((2, len(names) + 2), np.inf)
        self._covariance = None
        if observation:
            self._covariance = observation.covariance_of(names)
            for row, thresholds in enumerate((observation.collision, observation.contact)):
                self._limits[row] = thresholds.of_names(names)

    def make_rows(self, piece):
        """Yield indices of states, and their messages as uint8, (number of states, bytes)."""
        is_torque = self._topic == "external_torque"
        has_values = piece.observed.valid if is_torque else piece.states.effort_known
        touched = None
        if is_torque:
            columns = piece.states.position, piece.observed, self._covariance
            touched = find_touched_links(self._dynamics, *columns)
        is_touched = touched.link != "" if touched else np.zeros(len(piece.states), bool)
        for is_known, has_links in ((True, True), (True, False), (False, False)):
            places = np.flatnonzero((has_values == is_known) & (is_touched == has_links))
            if not len(places):
                continue
            state = _state_of(piece.states[places])
            seen = piece.observed.rows(places)
            if is_torque:
                probability = touched.probability[places] if has_links else None
                alarming = self._alarming(piece, places)
                values = torque_fields(seen, is_known, state, alarming, probability)
                values["touched_links"] = list(touched.links) if has_links else []
            elif self._topic in ("mass_matrix_factors", "joint_space_dynamics"):
                values = matrix_fields(
                    self._topic, self._dynamics, state, self._values["publish_inverse_factor"]
                )
            else:
                names = self._message.get_fields_and_field_types().keys()
                names -= {"header", "oldest_stamp", *self._texts}
                friction = self._friction(piece, places)
                s = _Rows(piece.s, places)
                values = evaluated_fields(names, s, state, is_known, friction=friction)
            yield places, self._encode(values, state, (is_known, has_links))

    def _alarming(self, piece, places):
        """Return the Alarming of some states."""
        limits = (np.tile(row, (len(places), 1)) for row in self._limits)
        alarms = piece.judged.joints, piece.judged.alarm, piece.contact.alarm
        return Alarming(*limits, *(column[places] for column in alarms))

    def _friction(self, piece, places):
        """Return the term of friction; None unless the parameter publish_friction is true."""
        if not self._values["publish_friction"]:
            return None
        friction = piece.s.friction
        return np.zeros_like(piece.s.nu[places]) if friction is None else friction[places]

    def _encode(self, values, state, key):
        """Return messages of these values; a key has one layout."""
        stamps = {"header.stamp": state.newest}
        if self._topic == "state":
            stamps["oldest_stamp"] = state.oldest
        for path, stamp in stamps.items():
            values |= {f"{path}.sec": stamp // SECOND, f"{path}.nanosec": stamp % SECOND}
        if key not in self._templates:
            self._templates[key] = self._make_template(values)
        template = self._templates[key]
        count = len(state.newest)
        rows = np.tile(template.data, (count, 1))
        for path, numbers in template.numbers.items():
            if isinstance(column := values.get(path), np.ndarray):
                begin = template.place(path)
                column = np.ascontiguousarray(column.reshape(count, -1), numbers.dtype)
                rows[:, begin : begin + numbers.nbytes] = column.view(np.uint8)
        return rows

    def _make_template(self, values):
        """Return the template of messages with the texts and lengths of the first state."""
        message = self._message(**self._texts)
        message.header.frame_id = self._dynamics.model.root_link
        for path, value in values.items():
            *parts, field = path.split(".")
            value = value[0] if isinstance(value, np.ndarray) else value
            if value is not None:
                value = np.ravel(value) if isinstance(value, np.ndarray) else value
                setattr(reduce(getattr, parts, message), field, value)
        return Template(message)


class _Rows:
    """Quantities of an Evaluation at some states."""

    def __init__(self, s, places):
        self._s = s
        self._places = places

    def __getattr__(self, name):
        return getattr(self._s, name)[self._places]


def _state_of(states):
    """Return States as a RobotState of columns."""
    newest, oldest, _, *values, _, is_received, is_estimated, _ = states.columns()
    return RobotState(*values, newest, oldest, is_received, is_estimated)
