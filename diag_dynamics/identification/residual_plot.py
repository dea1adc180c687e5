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

    `pieces` returns the pieces of a recording, `gain` is the observer's [1/s]. Of more than MAX_STEPS states
    a curve has the smallest and the largest value of each step; rows of NaN are gaps.
    """
    dataset = Dataset("recording", pieces, models[0])
    dynamics = [DiagonalDynamics(model) for model in models]
    observers = [Observer(one, gain, friction=True) for one in dynamics]
    each, times, curves = -(-len(dataset.t) // MAX_STEPS), [], []
    for part in dataset.portions():
        states, torques = dataset.states[part], []
        for one, observer in zip(dynamics, observers, strict=True):
            s = one.evaluate_batch(states.position, states.velocity, states.effort, friction=True)
            torques.append(observer.observe_batch(states, s)[1])
        torques, first = np.hstack(torques), np.arange(0, part.stop - part.start, each)
        low, high = (extreme.reduceat(torques, first, axis=0) for extreme in (np.fmin, np.fmax))
        if states.jumped[0]:
            times.append(dataset.t[part][:1])
            curves.append(np.full((1, torques.shape[1]), np.nan))
        curves.append(np.stack([low, high], axis=1)[:, : 1 + (each > 1)].reshape(-1, torques.shape[1]))
        times.append(np.repeat(dataset.t[part][first], 1 + (each > 1)))
    return np.concatenate(times), np.split(np.concatenate(curves), len(models), axis=1)
