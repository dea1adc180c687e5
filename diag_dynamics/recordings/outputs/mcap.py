# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""MCAP: the monitor's messages about every state, as ``ros2 bag play`` plays them."""

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.recordings.outputs.mcap_writer import McapWriter
from diag_dynamics.recordings.outputs.messages import MessageRows
from diag_dynamics.wire.definitions import definition_with_parts
from diag_dynamics.wire.ours import our_definitions

WRITTEN = "state", "kinetic_energy", "external_torque"
"""Topics that are written unless others are wanted; those of matrices are large."""

NODE = "/diag_dynamics"
"""Name of the monitor whose topics they are."""


class McapOutput:
    """Writes messages about pieces, at the log time of the message that completed each state.

    Parameters
    ----------
    path : str or Path
    reading : Reading
    friction : bool
        Whether evaluations have it.
    topics : sequence of str
        Some of messages.TOPICS.

    Raises
    ------
    InputError
        There is no such topic, or the file cannot be written.
    """

    def __init__(self, path, reading, friction=False, topics=WRITTEN):
        wanted, dynamics = reading.settings.observation, DiagonalDynamics(reading.model)
        thresholds = (wanted.threshold, wanted.release) if wanted else (float("inf"), float("inf"))
        alarms = wanted.alarms if wanted else None
        limits = alarms.limits(reading.model.dof_names) if alarms else None
        rows = [MessageRows(topic, dynamics, friction, thresholds, limits) for topic in topics]
        self._writer, definitions = McapWriter(path), our_definitions()
        self._rows = [
            (self._writer.channel(f"{NODE}/{one.topic}", one.type, definition_with_parts(one.type, definitions)), one)
            for one in rows
        ]

    def write(self, piece):
        """Write messages about a piece."""
        times = piece.states.log_time
        self._writer.write(
            [(channel, rows, times[which]) for channel, one in self._rows for which, rows in one.rows(piece)]
        )

    def close(self):
        """Have the file be whole."""
        self._writer.close()

    def drop(self):
        """Leave nothing behind."""
        self._writer.abort()
