# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Curves of the external torque that models predict where there was none."""

import numpy as np

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.identification.dataset import Dataset
from diag_dynamics.recordings.observer import Observer

MAX_STEPS = 6000  # of a curve: ten times the pixels that they are drawn on


def residual_curves(models, pieces, gain):
    """Return times [s], shape (P,), and observed external torques of each model [N m, N], (P, nv).

    `pieces` returns the pieces of a recording, `gain` is the observer's [1/s]. Of more than MAX_STEPS
    states a curve has the smallest and the largest value of each step; rows of NaN are gaps.
    """
    dataset = Dataset("recording", pieces, models[0])
    observers = [Observer(DiagonalDynamics(model), gain, friction=True) for model in models]
    each = -(-sum(len(one.t) for one in dataset.segments) // MAX_STEPS)
    times, curves = [], []
    for t, states in dataset.portions():
        torques = np.hstack([_observed(one, states) for one in observers])
        first = np.arange(0, len(t), each)
        extremes = [one.reduceat(torques, first, axis=0) for one in (np.fmin, np.fmax)]
        gap = np.full((int(states.jumped[0]), torques.shape[1]), np.nan)
        curves += [gap, np.stack(extremes, axis=1).reshape(-1, torques.shape[1])]
        times += [t[: len(gap)], np.repeat(t[first], 2)]
    return np.concatenate(times), np.split(np.concatenate(curves), len(models), axis=1)


def _observed(observer, states):
    return np.concatenate([torque for _, (_, torque, *_) in observer.observe_states(states)])
