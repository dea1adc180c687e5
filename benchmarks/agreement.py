# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nothing is timed before its outputs agree: the library's with those of every peer."""

import numpy as np
from peers import QUANTITIES, Parallel

TOLERANCE = 1e-10
"""Largest error, relative to the norm of a quantity. What is found is 1e-12 at most."""


class DisagreementError(RuntimeError):
    """Two that are to compute the same do not."""


def compare(robot, quantity, actual, expected):
    """Relative error of a quantity.

    Raises
    ------
    DisagreementError
        It is larger than :data:`TOLERANCE`, or not a number.
    """
    actual, expected = np.asarray(actual), np.asarray(expected)
    if actual.shape != expected.shape:
        raise DisagreementError(
            f"{robot}: {quantity} has shape {actual.shape}; expected {expected.shape}."
        )
    error = float(
        np.linalg.norm(actual - expected) / max(np.linalg.norm(expected), np.finfo(float).tiny)
    )
    if not error <= TOLERANCE:
        raise DisagreementError(
            f"{robot}: {quantity} differs by {error:.1e} of its norm; expected <= {TOLERANCE:g}."
        )
    return error


def check(case, pinocchio, mujoco):
    """Largest relative error over all quantities of one robot, and the quantity that has it."""
    dyn, label, order = case.dynamics, case.label, pinocchio.order
    errors = {}

    def same(quantity, actual, expected):
        errors[quantity] = compare(label, quantity, actual, expected)

    calls = pinocchio.calls(
        pinocchio.positions(case.q), pinocchio.vectors(case.qd), pinocchio.vectors(case.tau)
    )
    s = dyn.evaluate(case.q, case.qd, case.tau)
    for name, expected in zip(QUANTITIES, calls["dense_evaluate"](), strict=True):
        same(
            f"{name} of evaluate",
            getattr(s, name),
            expected[order] if np.ndim(expected) else expected,
        )

    qdd = calls["aba"]()[order]
    same("aba in its default convention", calls["aba_default"]()[order], qdd)
    same("forward_dynamics", dyn.forward_dynamics(case.q, case.qd, case.tau), qdd)
    mujoco.forward()
    same("q̈ of mj_forward", mujoco.accelerations(), qdd)

    factors, at = dyn.factors(case.q), np.ix_(order, order)
    for name, expected in zip("ml", calls["dense_factors"](), strict=True):
        same(f"{name} of factors", getattr(factors, name), expected[at])

    Q, QD, TAU = case.states(100)
    batch = dyn.evaluate(Q, QD, TAU)
    accelerations = Parallel(pinocchio, 2, Q, QD, TAU)().T[:, order]
    for name in QUANTITIES:
        same(
            f"{name} of evaluate, many states",
            getattr(batch, name),
            np.array(
                [getattr(dyn.evaluate(*state), name) for state in zip(Q, QD, TAU, strict=True)]
            ),
        )
    same(
        "nu_dot of evaluate, many states, and abaInParallel",  # ν̇ = mᵀq̈ + ṁᵀq̇
        batch.nu_dot,
        np.array(
            [
                dyn.nu_from_qd(q, a) + dyn.m_rate_transposed_times(q, v, v)
                for q, v, a in zip(Q, QD, accelerations, strict=True)
            ]
        ),
    )
    worst = max(errors, key=errors.get)
    return errors[worst], f"{label}: {worst}"
