# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP: messages of the monitor about every state, by the library mcap."""

from contextlib import suppress
from functools import cache
from io import BufferedWriter, FileIO

import numpy as np

import diag_dynamics
from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.optional import require
from diag_dynamics.recordings.atomic_file import AtomicFile
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts, message_type
from diag_dynamics.wire.ours import our_definitions

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
NODE = "/diag_dynamics"
"""Name of the monitor whose topics they are."""

EFFORT_FIELDS = {"effort", "epsilon", "kappa"}
RESULT_FIELDS = {"residual", "external_torque", "joint_collision"}
ALARM_FIELDS = {"torque_threshold", "joint_collision"}
"""Fields that are empty without effort, without a result of the observer, and without alarms."""
MATRIX_TOPICS = "joint_space_dynamics", "mass_matrix_factors"
MATRICES = {
    "mass_matrix": lambda dynamics, q, _: dynamics.mass_matrix_batch(q),
    "bias": lambda dynamics, q, qd: dynamics.bias_batch(q, qd),
    "gravity": lambda dynamics, q, _: dynamics.gravity_torque_batch(q),
    "m": lambda dynamics, q, _: np.array([dynamics.factors(one).m for one in q]),
    "d": lambda dynamics, q, _: np.array([dynamics.factors(one).D for one in q]),
    "l": lambda dynamics, q, _: np.array([dynamics.factors(one).l for one in q]),
}
"""Fields of these, which no evaluation has."""
VALUES = {
    "position": lambda piece: piece.states.position,
    "velocity": lambda piece: piece.states.velocity,
    "effort": lambda piece: piece.states.effort,
    "stamp_is_receive_time": lambda piece: piece.states.stamp_received,
    "velocity_estimated": lambda piece: piece.states.velocity_estimated,
    "power": lambda piece: piece.s.effort_power,
    "total": lambda piece: piece.s.kinetic_energy,
    "residual": lambda piece: piece.observed[0],
    "external_torque": lambda piece: piece.observed[1],
    "norm": lambda piece: piece.observed[2],
    "collision": lambda piece: piece.observed[4],
    "torque_norm": lambda piece: np.linalg.norm(piece.observed[1], axis=1),
    "joint_collision": lambda piece: piece.judged.joints,
}
"""Other fields that are not named as those of the evaluation."""
REVISION = 1


class McapOutput:
    """Writes messages about pieces, at the log time of the message that completed each state.

    Parameters
    ----------
    path : str or Path
    reading : Reading
    friction : bool
        Whether evaluations have it.
    topics : sequence of str

    Raises
    ------
    InputError
        A topic is unknown, or the file cannot be written.
    """

    def __init__(self, path, reading, friction=False, topics=WRITTEN):
        for topic in topics:
            if topic not in TOPICS:
                raise InputError(f"there is no topic '{topic}' to write, expected some of {', '.join(TOPICS)}.")
        self._target, definitions, self._count = AtomicFile(path), our_definitions(), 0
        library = require("mcap.writer", "writing MCAP")
        with self._target.errors():
            self._file = CountedFile(self._target.name)
            self._writer = library.Writer(self._file, compression=library.CompressionType.LZ4)
            self._writer.start("ros2", f"diag_dynamics {diag_dynamics.__version__}")
        self._topics = {}  # by channel
        for topic in topics:
            rows = TopicRows(topic, reading, friction)
            definition = definition_with_parts(rows.type, definitions).encode()
            schema = self._writer.register_schema(rows.type, "ros2msg", definition)
            # Releases of rosbag2 write QoS profiles in two ways; all read none.
            metadata = {"offered_qos_profiles": ""}
            self._topics[self._writer.register_channel(f"{NODE}/{topic}", "cdr", schema, metadata)] = rows

    def write(self, piece):
        """Write messages about a piece."""
        times = piece.states.log_time  # those of a table may restart
        numbers = self._count + np.argsort(np.argsort(times, kind="stable"), kind="stable")
        self._count += len(times)
        for channel, topic in self._topics.items():
            for which, rows in topic.make_rows(piece):
                data, size = memoryview(rows.reshape(-1)), rows.shape[1]
                columns = range(0, len(data), size), times[which].tolist(), numbers[which].tolist()
                with self._target.errors():
                    for at, time, number in zip(*columns, strict=True):
                        message = data[at : at + size]
                        self._writer.add_message(channel, time, message, time, number)

    def close(self):
        """Complete the file."""
        with self._target.errors():
            self._writer.finish()
            self._file.close()
        self._target.commit()

    def drop(self):
        """Delete the file."""
        with suppress(OSError):  # the disk may be full
            self._file.close()
        self._target.discard()


class CountedFile(BufferedWriter):
    """A file that is written from its beginning, of which pipes, too, know the place."""

    def __init__(self, path):
        super().__init__(FileIO(path, "wb"))
        self._size = 0

    def write(self, data):
        """Write bytes."""
        self._size += len(data)
        return super().write(data)

    def tell(self):
        """Return the number of bytes that were written."""
        return self._size


class TopicRows:
    """Makes the messages of one topic about pieces, each a row of bytes."""

    def __init__(self, topic, reading, friction=False):
        observation = reading.settings.observation
        self.type, self._topic, self._friction = f"diag_dynamics/msg/{TOPICS[topic]}", topic, friction
        self._dynamics, self._model = DiagonalDynamics(reading.model), reading.model
        self._thresholds = (observation.threshold, observation.release) if observation else (np.inf, np.inf)
        alarms = observation.alarms if observation else None
        self._limits = alarms.limits(reading.model.dof_names) if alarms else None
        self._template = cache(self._make_template)

    def make_rows(self, piece):
        """Yield indices of states, and their messages as uint8 of shape (number of states, bytes)."""
        known = piece.observed[3] if self._topic == "external_torque" else piece.states.effort_known
        for is_known in (True, False):
            which = np.flatnonzero(known == is_known)
            if not len(which):
                continue
            template = self._template(is_known)
            rows = np.tile(template.data, (len(which), 1))
            for path, numbers in template.numbers.items():
                values = self._values(piece, which, path) if is_known or path != "power" else None
                if values is not None:
                    begin = template.place(path)
                    values = np.ascontiguousarray(values.reshape(len(which), -1), numbers.dtype)
                    rows[:, begin : begin + numbers.nbytes] = values.view(np.uint8)
            yield which, rows

    def _values(self, piece, which, path):
        """Return the values of a field, a row for each message; None if they are constant."""
        states, field = piece.states, path.rpartition(".")[2]
        if field in ("sec", "nanosec"):
            stamp = (states.stamp if path.startswith("header") else states.oldest_stamp)[which]
            return stamp // SECOND if field == "sec" else stamp % SECOND
        if path in ("model_revision", "nv") or path.endswith(("valid", "threshold")):
            return None
        if self._topic in MATRIX_TOPICS and path in MATRICES:
            return MATRICES[path](self._dynamics, states.position[which], states.velocity[which])
        if path == "link_energy":
            energy = np.empty((len(states), len(self._model.link_names)))
            piece.s.write_link_energy(energy)
            return energy[which]
        if path in VALUES:
            return np.nan_to_num(VALUES[path](piece)[which])
        return getattr(piece.s, path)[which]

    def _make_template(self, is_known):
        """Return the template of messages with or without efforts, or with or without a result of the observer."""
        model, message = self._model, message_type(self.type, our_definitions())()
        message.header.frame_id, message.dof_names = model.root_link, list(model.dof_names)
        nv, limits = model.nv, self._limits
        widths = {"position": model.nq, "link_energy": len(model.link_names)} | dict.fromkeys(
            ("mass_matrix", "m", "l"), nv**2
        )
        empty = set() if is_known else (RESULT_FIELDS if self._topic == "external_torque" else EFFORT_FIELDS)
        empty = empty | (set() if self._friction else {"friction"}) | (ALARM_FIELDS if limits is None else set())
        for field, kind in message.get_fields_and_field_types().items():
            if kind == "sequence<double>" and field not in empty:
                setattr(message, field, [1.0] * widths.get(field, nv))
            elif kind == "sequence<boolean>" and field not in empty:
                setattr(message, field, [False] * nv)
        constants = {
            "link_names": list(model.link_names),
            "position_names": [] if model.coordinate_names == model.dof_names else list(model.coordinate_names),
            "model_revision": REVISION,
            "nv": nv,
            "effort_valid": is_known,
            "power_valid": is_known,
            "valid": is_known,
            "l_valid": True,
            "friction_valid": self._friction,
            "threshold": self._thresholds[0],
            "release_threshold": self._thresholds[1],
            "torque_norm_threshold": np.inf if limits is None else limits[-2],
            "torque_threshold": [] if limits is None else limits[:-2].tolist(),
        }
        for field, value in constants.items():
            if hasattr(message, field):
                setattr(message, field, value)
        return Template(message)
