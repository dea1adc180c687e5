# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The simulator's compiled steps against loops in Python of the same order, with and without damping."""

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

    def euler(self, steps, h=STEP):
        """Semi-implicit Euler: one aba and one integrate a step. Returns q and q̇."""
        model, data, (q, v), tau, damping = (
            self._model,
            self._data,
            self._start,
            self._tau,
            self._damping,
        )
        for _ in range(steps):
            v = v + h * pin.aba(model, data, q, v, tau - damping * v if damping else tau, WORLD)
            q = pin.integrate(model, q, h * v)
        return q, v

    def runge_kutta(self, steps, h=STEP):
        """The classical method of order 4: four of each a step. Returns q and q̇."""
        model, data, (q, v), tau, damping = (
            self._model,
            self._data,
            self._start,
            self._tau,
            self._damping,
        )

        def acceleration(q, v):
            return pin.aba(model, data, q, v, tau - damping * v if damping else tau, WORLD)

        for _ in range(steps):
            a1 = acceleration(q, v)
            v2 = v + 0.5 * h * a1
            a2 = acceleration(pin.integrate(model, q, 0.5 * h * v), v2)
            v3 = v + 0.5 * h * a2
            a3 = acceleration(pin.integrate(model, q, 0.5 * h * v2), v3)
            v4 = v + h * a3
            a4 = acceleration(pin.integrate(model, q, h * v3), v4)
            q = pin.integrate(model, q, h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4))
            v = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        return q, v


METHODS = {1: Loop.euler, 4: Loop.runge_kutta}
"""Loops by their order."""


def check(case, pinocchio):
    """20 short steps of methods of one order end at the same state; as :func:`agreement.check`.

    At order 4 with damping, too; at order 1 ours takes damping implicitly and theirs does not.
    """
    errors = []
    for order, damping in ((4, 0.0), (4, DAMPING), (1, 0.0)):
        ours = _simulation(case, damping, 0.1 * STEP, order)
        ours.reset(case.q, case.qd)
        ours.advance(case.tau, 20)
        q, v = METHODS[order](Loop(pinocchio, case, damping), 20, 0.1 * STEP)
        for name, actual, expected in (
            ("q", pinocchio.positions(ours.q), q),
            ("q̇", ours.qd, v[pinocchio.order]),
        ):
            quantity = f"{name} of Simulation of order {order}"
            errors.append(
                (compare(case.label, quantity, actual, expected), f"{case.label}: {quantity}")
            )
    return max(errors)


def rows(pairs, steps, rounds):
    """The lines of the table."""
    by_order = {1: {}, 4: {}}
    for case, pinocchio in pairs:
        for damping in (0.0, DAMPING):
            label = f"{case.label}, {'damped' if damping else 'undamped'}"
            loop = Loop(pinocchio, case, damping)
            for order, method in METHODS.items():
                ours = _simulation(case, damping, STEP, order)
                times = interleaved(
                    {
                        "ours": lambda s=ours, c=case: (
                            s.reset(c.q, c.qd),
                            s.advance(c.tau, steps),
                        ),
                        "theirs": lambda loop=loop, method=method: method(loop, steps),
                    },
                    rounds,
                )
                by_order[order][label] = ratio(times["ours"], times["theirs"])
    over = ", ".join(case.label for case, _ in pairs)
    return [
        Row(
            "`Simulation.advance` per step, order 1",
            "Python loop of semi-implicit Euler, one `pin.aba` a step",
            over,
            None,
            by_order[1],
        ),
        Row(
            "`Simulation.advance` per step, order 4, six stages",
            "Python loop of Runge–Kutta of order 4, four `pin.aba` a step",
            over,
            None,
            by_order[4],
        ),
    ]


def _simulation(case, damping, step, order):
    # The loops know no limits and no friction either.
    return dd.Simulation(
        case.model,
        step=step,
        damping=np.full(case.dof, damping),
        friction=np.zeros(case.dof),
        limits=False,
        effort_limits=False,
        order=order,
    )
