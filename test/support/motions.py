# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Motions that excite a robot, what Pinocchio says that they need, and recordings of them."""

import numpy as np
import pinocchio as pin

import diag_dynamics as dd
from described import S
from diag_dynamics.recordings.intake import States


def fourier(rng, t, low, high, fastest=1.7, base=0.1, harmonics=5, share=0.35):
    """Positions, rates and accelerations (T, n) of a Fourier series of random coefficients about
    the middle of limits.

    Of a base frequency [Hz] and so many harmonics, its coefficients falling as 1/k; positions go as
    far as a share of the limits' range, and rates up to the fastest [rad/s].
    """
    w = 2.0 * np.pi * base * np.arange(1, harmonics + 1)
    a, b = rng.normal(size=(2, len(low), harmonics)) / np.arange(1, harmonics + 1)
    sine = np.sin(np.outer(t, w))
    cosine = np.cos(np.outer(t, w))
    q = sine @ a.T + cosine @ b.T
    qd = (cosine * w) @ a.T - (sine * w) @ b.T
    qdd = -(sine * w**2) @ a.T - (cosine * w**2) @ b.T
    scale = np.minimum(
        share * (high - low) / np.abs(q).max(axis=0), fastest / np.abs(qd).max(axis=0)
    )
    return 0.5 * (low + high) + scale * q, scale * qd, scale * qdd


def efforts(oracle, q, qd, qdd):
    """Efforts by Pinocchio's rnea, (T, nv), in the oracle's order."""
    result = np.empty_like(q)
    for t in range(len(q)):
        arguments = oracle.configuration(q[t]), oracle.to_pin(qd[t]), oracle.to_pin(qdd[t])
        result[t] = oracle.from_pin(pin.rnea(oracle.model, oracle.data, *arguments))
    return result


def recorded(model, t, q, qd, tau):
    """A Recording of columns at times [s]."""
    stamp = np.round(t * S).astype(np.int64) + S
    none = np.zeros(len(t), dtype=bool)
    is_known = none if tau is None else ~none
    tau = np.full_like(qd, np.nan) if tau is None else tau
    states = States(stamp, stamp, stamp, q, qd, tau, is_known, none, none, none)
    return dd.Recording(model, states, S, {}, [])


def changed(data, model=None, **columns):
    """Return a recording with other columns, or of another model."""
    values = (columns.get(name, getattr(data, name)) for name in ("q", "qd", "tau"))
    return recorded(model or data.model, data.t, *values)
