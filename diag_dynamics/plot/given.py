# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What plots are given: a recording, results of one state or of many; what they draw of it: numbers by joint."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from diag_dynamics.arrays import Array, VectorLike
from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import RobotModel
from diag_dynamics.recordings.recording import Recording
from diag_dynamics.results import Evaluation


class Shares(NamedTuple):
    """Energy shares of joints over time."""

    model: RobotModel
    t: Array | None
    """Times from the first state on [s], shape (T,); None where nothing is known of them."""
    joints: tuple[str, ...]
    energy: Array
    """Sums of ½ν_k² over the degrees of freedom of each joint [J], shape (T, joints)."""


def shares_of(given: Recording | Evaluation, t: VectorLike | None = None) -> Shares:
    """Energy shares of a recording, a batch, or one state.

    Of a joint of several degrees of freedom, and so of a floating base, their sum is taken: what each of them has depends on
    their order.

    Parameters
    ----------
    given : Recording, BatchEvaluation or Evaluation
    t : array_like, shape (T,), optional
        Times of a batch [s].

    Raises
    ------
    InputError
        It is none of these, has no states, or the times are not as many.
    """
    if isinstance(given, Recording):
        require_states(given)
        model, energy = given.model, _of_recording(given)
        times: Array | None = given.t
    elif not isinstance(given, Evaluation):
        raise InputError(
            f"what is plotted is {given!r}, expected a Recording or what evaluate or evaluate_batch returned."
        )
    else:
        model, energy = given.model, np.atleast_2d(given.energy_share)
        times = None if t is None else np.asarray(t, dtype=float)
        if not len(energy):
            raise InputError("the batch has no states.")
        if times is not None and times.shape != (len(energy),):
            raise InputError(f"t has shape {times.shape}, expected ({len(energy)},): a time for each state.")
    joints, owner = joints_of(model)
    summed = np.zeros((len(energy), len(joints)))
    for k, joint in enumerate(owner):
        summed[:, joint] += energy[:, k]
    return Shares(model, None if times is None else times - times[0], joints, summed)


def joints_of(model: RobotModel) -> tuple[tuple[str, ...], list[int]]:
    """Joints that are degrees of freedom, base to tip; and for each degree of freedom which of them it belongs to."""
    followers = set(model.mimics)
    joints = tuple(joint for joint in model.joint_names if joint not in followers)
    of = {joint: k for k, joint in enumerate(joints)}
    return joints, [of[name if name in of else name.rpartition("/")[0]] for name in model.dof_names]


def require_states(recording: Recording) -> None:
    """Refuse a recording without states.

    Raises
    ------
    InputError
    """
    if not len(recording):
        raise InputError("the recording has no states: its findings say why.")


def _of_recording(recording: Recording) -> Array:
    stream = DiagonalDynamics(recording.model).evaluate_stream(recording.q, recording.qd)
    return np.concatenate([s.energy_share for s in stream])
