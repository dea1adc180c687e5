# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator's compiled steps against a loop in Python of the same rule, with and without damping."""

import numpy as np
import pinocchio as pin
from agreement import compare
from peers import WORLD
from rows import Row
from timing import interleaved, ratio

import diag_dynamics as dd

STEP = 1e-3  # [s]
DAMPING = 0.01  # [N m s/rad, N s/m] of every joint, small enough for an explicit step
ROBOTS = ("panda", "talos_reduced")


class Loop:
    """What a user of Pinocchio writes: steps from one state with constant effort."""

    def __init__(self, pinocchio, case, damping):
        self._model, self._data = pinocchio.model, pinocchio.data
        self._start = pinocchio.positions(case.q), pinocchio.vectors(case.qd)
        self._tau, self._damping = pinocchio.vectors(case.tau), damping

    def midpoint(self, steps, h=STEP):
        """The midpoint rule: two of aba and of integrate a step. Returns q and q̇."""
        model, data, (q, v) = self._model, self._data, self._start
        tau, damping = self._tau, self._damping

        def acceleration(q, v):
            return pin.aba(model, data, q, v, tau - damping * v if damping else tau, WORLD)

        for _ in range(steps):
            middle = v + 0.5 * h * acceleration(q, v)
            place = pin.integrate(model, q, 0.5 * h * middle)
            v = v + h * acceleration(place, middle)
            q = pin.integrate(model, q, h * middle)
        return q, v


def check(case, pinocchio):
    """20 short steps end at the same state; as :func:`agreement.check`. Ours takes damping implicitly, so there is none."""
    ours = _simulation(case, 0.0, 0.1 * STEP)
    ours.reset(case.q, case.qd)
    ours.advance(case.tau, 20)
    q, v = Loop(pinocchio, case, 0.0).midpoint(20, 0.1 * STEP)
    errors = []
    for name, actual, expected in (
        ("q", pinocchio.positions(ours.q), q),
        ("q̇", ours.qd, v[pinocchio.order]),
    ):
        quantity = f"{name} of Simulation"
        error = compare(case.label, quantity, actual, expected)
        errors.append((error, f"{case.label}: {quantity}"))
    return max(errors)


def rows(pairs, steps, rounds):
    """The line of the table."""
    ratios = {}
    for case, pinocchio in pairs:
        for damping in (0.0, DAMPING):
            label = f"{case.label}, {'damped' if damping else 'undamped'}"
            loop = Loop(pinocchio, case, damping)
            ours = _simulation(case, damping, STEP)
            times = interleaved(
                {
                    "ours": lambda s=ours, c=case: (s.reset(c.q, c.qd), s.advance(c.tau, steps)),
                    "theirs": lambda loop=loop: loop.midpoint(steps),
                },
                rounds,
            )
            ratios[label] = ratio(times["ours"], times["theirs"])
    over = ", ".join(case.label for case, _ in pairs)
    peer = "Python loop of the midpoint rule, two `pin.aba` a step"
    return [Row("`Simulation.advance` per step", peer, over, None, ratios)]


def _simulation(case, damping, step):
    # The loops know no limits and no friction either.
    return dd.Simulation(
        case.model,
        step=step,
        damping=np.full(case.dof, damping),
        friction=np.zeros(case.dof),
        limits=False,
        effort_limits=False,
    )
