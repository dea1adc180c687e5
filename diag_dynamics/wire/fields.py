# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Fields of the monitor's messages: about one state, or with a leading axis about many."""

from typing import NamedTuple

import numpy as np

FLAGS = "stamp_is_receive_time", "velocity_estimated"
"""Fields of most messages that a RobotState has, too."""

OF_STATE = "position", "velocity", "effort", *FLAGS
"""Fields that are attributes of a RobotState."""

QUANTITIES = {"total": "kinetic_energy", "power": "effort_power"}
"""Quantities of an Evaluation by the fields that have another name."""

OF_EFFORT = "effort", "epsilon", "kappa", "power"
"""Fields that are empty or zero without effort."""


class Alarming(NamedTuple):
    """Thresholds of collision and contact, and what exceeds them, of one state or of many.

    Attributes
    ----------
    collision_limits, contact_limits : ndarray, shape (nv + 2,)
        Thresholds of joints [N m, N], of ‖m r‖ [N m] and of |r| [J^½/s]; inf for none.
    joints : ndarray of bool, shape (nv,)
        Joints whose collision lasts.
    collision, contact : bool
        Whether there is one.
    """

    collision_limits: np.ndarray
    contact_limits: np.ndarray
    joints: np.ndarray
    collision: bool
    contact: bool


def texts_of(topic, model, revision):
    """Return the fields of a topic that are the same for all states of a model."""
    texts = {"dof_names": list(model.dof_names)}
    if topic == "kinetic_energy":
        texts["link_names"] = list(model.link_names)
    if topic == "state":
        has_names = model.coordinate_names != model.dof_names
        texts["position_names"] = list(model.coordinate_names) if has_names else []
    if topic in ("state", "mass_matrix_factors"):
        texts["model_revision"] = revision
    return texts


def flags_of(state):
    """Return the flags of a RobotState by field."""
    return {field: getattr(state, field) for field in FLAGS}


def evaluated_fields(names, s, state, with_effort, **others):
    """Return values by field, of these names, from an Evaluation and its RobotState.

    Those that require efforts are None without. `others` are computed elsewhere: friction, which
    may be None, and link_energy.
    """
    values = {}
    for name in names:
        if name in others:
            values[name] = others[name]
        elif name == "friction_valid":
            values[name] = others["friction"] is not None
        elif name in ("effort_valid", "power_valid"):
            values[name] = with_effort
        elif name in OF_EFFORT and not with_effort:
            values[name] = None
        else:
            source = state if name in OF_STATE else s
            values[name] = getattr(source, QUANTITIES.get(name, name))
    return values


def matrix_fields(topic, dynamics, state, with_inverse):
    """Return values by field of m, D and, if requested, ℓ; or of M, c and g."""
    q = state.position
    if topic == "joint_space_dynamics":
        return flags_of(state) | {
            "mass_matrix": dynamics.mass_matrix(q),
            "coriolis_torque": dynamics.coriolis_torque(q, state.velocity),
            "gravity": dynamics.gravity_torque(q),
        }
    m, inverse, _, d = zip(*map(dynamics.factors, np.atleast_2d(q)), strict=True)
    return {
        "nv": dynamics.model.nv,
        "m": np.array(m),
        "d": np.array(d),
        "l": np.array(inverse) if with_inverse else None,
        "l_valid": with_inverse,
        "stamp_is_receive_time": state.stamp_is_receive_time,
    }


def torque_fields(seen, valid, state, alarming, touched):
    """Return values by field of results of an observer, empty where they are not `valid`.

    `seen` is a Disturbance or many, `alarming` their Alarming, `touched` the probabilities of
    links, None without a touched link.
    """
    values = flags_of(state) | {
        "valid": valid,
        "touched_link_probability": touched,
        "collision": alarming.collision,
        "contact": alarming.contact,
        "collision_threshold": alarming.collision_limits,
        "contact_threshold": alarming.contact_limits,
    }
    if not valid:
        return values | {"norm": 0.0, "torque_norm": 0.0}
    names = "residual", "external_torque", "norm", "torque_norm"
    values |= {name: getattr(seen, name) for name in names}
    return values | {"joint_collision": alarming.joints}
