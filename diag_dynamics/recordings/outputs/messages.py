# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pieces as serialized messages of the monitor, a row of bytes each."""

from functools import cache

import numpy as np

from diag_dynamics.assembly.stamps import SECOND
from diag_dynamics.exceptions import InputError
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import message_type
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
"""Topics that can be written, and their types."""

OF_EFFORTS = {"effort", "epsilon", "kappa"}
OF_RESULT = {"residual", "external_torque", "joint_collision"}
OF_ALARMS = {"torque_threshold", "joint_collision"}
"""Fields that are empty in messages about states without effort, without a result of the observer, without alarms."""

REVISION = 1


class MessageRows:
    """Makes the messages of one topic about pieces.

    Parameters
    ----------
    topic : str
    dynamics : DiagonalDynamics
    friction : bool
        Whether evaluations have it.
    thresholds : tuple
        Threshold and release threshold of the observer [J^½/s].
    limits : ndarray, shape (nv + 2,), optional
        Thresholds of alarms, as an AlarmDetector has them.

    Raises
    ------
    InputError
        There is no such topic.
    """

    def __init__(self, topic, dynamics, friction=False, thresholds=(np.inf, np.inf), limits=None):
        if topic not in TOPICS:
            raise InputError(f"there is no topic '{topic}' to write, expected some of {', '.join(TOPICS)}.")
        self.topic, self.type = topic, f"diag_dynamics/msg/{TOPICS[topic]}"
        self._dynamics, self._model, self._friction, self._thresholds = dynamics, dynamics.model, friction, thresholds
        self._limits = limits
        self._template = cache(self._made)

    def rows(self, piece):
        """Messages about all states of a piece.

        Yields
        ------
        which : ndarray of int
            Indices of states.
        rows : ndarray of uint8, shape (number of them, bytes of a message)
        """
        states, valid = piece.states, piece.observed[3]
        groups = valid if self.topic == "external_torque" else states.effort_known
        for group in (True, False):
            which = np.flatnonzero(groups == group)
            if len(which):
                yield which, self._written(piece, which, group)

    def _written(self, piece, which, group):
        template = self._template(group)
        rows = np.tile(template.data, (len(which), 1))
        for path in template.numbers:
            values = self._values(piece, which, path) if group or path != "power" else None
            if values is not None:
                begin = template.place(path)
                size = template.numbers[path].nbytes
                values = np.ascontiguousarray(values.reshape(len(which), -1), template.numbers[path].dtype)
                rows[:, begin : begin + size] = values.view(np.uint8)
        return rows

    def _values(self, piece, which, path):
        """What is written in a field, a row for each message; None where the template has it."""
        states, s, (residual, torque, norm, _, collision), _, judged = piece
        if path in ("header.stamp.sec", "header.stamp.nanosec", "oldest_stamp.sec", "oldest_stamp.nanosec"):
            stamp = (states.stamp if path.startswith("header") else states.oldest_stamp)[which]
            return stamp // SECOND if path.endswith(".sec") else stamp % SECOND
        if path in ("position", "velocity", "effort"):
            return getattr(states, path)[which]
        if path == "link_energy":
            energy = np.empty((len(states), len(self._model.link_names)))
            s.write_link_energy(energy)
            return energy[which]
        if path in ("mass_matrix", "bias", "gravity", "m", "d", "l") and self.topic in (
            "joint_space_dynamics",
            "mass_matrix_factors",
        ):
            return self._matrix(states, which, path)
        if path in ("power", "kinetic_energy", "total", "base_energy"):
            name = {"power": "effort_power", "total": "kinetic_energy"}.get(path, path)
            return getattr(s, name)[which]
        beside = {
            "stamp_is_receive_time": states.stamp_received,
            "velocity_estimated": states.velocity_estimated,
            "residual": residual,
            "external_torque": torque,
            "norm": norm,
            "collision": collision,
        }
        if path == "joint_collision":
            return judged.joints[which]
        if path == "torque_norm":
            return np.nan_to_num(np.linalg.norm(torque[which], axis=1))
        if path in beside:
            return np.nan_to_num(beside[path][which])
        if path in ("model_revision", "nv") or path.endswith(("valid", "threshold")):
            return None
        return getattr(s, path)[which]

    def _matrix(self, states, which, path):
        """Field of a message of matrices, which are of no evaluation."""
        q, qd, dynamics = states.position[which], states.velocity[which], self._dynamics
        if path == "mass_matrix":
            return dynamics.mass_matrix_batch(q)
        if path == "bias":
            return dynamics.bias_batch(q, qd)
        if path == "gravity":
            return dynamics.gravity_torque_batch(q)
        name = {"d": "D"}.get(path, path)
        return np.array([getattr(dynamics.factors(one), name) for one in q])

    def _made(self, group):
        """Template of messages about states with effort or without, or with a result of the observer or without."""
        model, definitions = self._model, our_definitions()
        message = message_type(self.type, definitions)()
        message.header.frame_id, message.dof_names = model.root_link, list(model.dof_names)
        nv, square = model.nv, model.nv**2
        widths = {
            "position": model.nq,
            "link_energy": len(model.link_names),
            "mass_matrix": square,
            "m": square,
            "l": square,
        }
        empty = set() if group else (OF_RESULT if self.topic == "external_torque" else OF_EFFORTS)
        if not self._friction:
            empty = empty | {"friction"}
        if self._limits is None:
            empty = empty | OF_ALARMS
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
            "effort_valid": group,
            "power_valid": group,
            "valid": group,
            "l_valid": True,
            "friction_valid": self._friction,
            "threshold": self._thresholds[0],
            "release_threshold": self._thresholds[1],
            "torque_norm_threshold": np.inf if self._limits is None else self._limits[-2],
            "torque_threshold": [] if self._limits is None else self._limits[:-2].tolist(),
        }
        for field, value in constants.items():
            if hasattr(message, field):
                setattr(message, field, value)
        return Template(message)
