"""The simulator's compiled steps against loops in Python, with and without damping."""

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
        model, data, (q, v), tau, damping = self._model, self._data, self._start, self._tau, self._damping
        for _ in range(steps):
            v = v + h * pin.aba(model, data, q, v, tau - damping * v if damping else tau, WORLD)
            q = pin.integrate(model, q, h * v)
        return q, v

    def runge_kutta(self, steps, h=STEP):
        """The classical method of order 4: four of each a step. Returns q and q̇."""
        model, data, (q, v), tau, damping = self._model, self._data, self._start, self._tau, self._damping

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


def check(case, pinocchio):
    """20 short steps of either method of order 4 end at the same state; as :func:`agreement.check`."""
    errors = []
    for damping in (0.0, DAMPING):
        ours = _simulation(case, damping, 0.1 * STEP)
        ours.reset(case.q, case.qd)
        ours.advance(case.tau, 20)
        q, v = Loop(pinocchio, case, damping).runge_kutta(20, 0.1 * STEP)
        for name, actual, expected in (("q", pinocchio.positions(ours.q), q), ("q̇", ours.qd, v[pinocchio.order])):
            quantity = f"{name} of Simulation"
            errors.append((compare(case.label, quantity, actual, expected), f"{case.label}: {quantity}"))
    return max(errors)


def rows(pairs, steps, rounds):
    """The lines of the table."""
    euler, runge_kutta = {}, {}
    for case, pinocchio in pairs:
        for damping in (0.0, DAMPING):
            label = f"{case.label}, {'damped' if damping else 'undamped'}"
            loop = Loop(pinocchio, case, damping)
            ours = _simulation(case, damping, STEP)
            times = interleaved(
                {
                    "ours": lambda s=ours, c=case: (s.reset(c.q, c.qd), s.advance(c.tau, steps)),
                    "euler": lambda loop=loop: loop.euler(steps),
                    "runge_kutta": lambda loop=loop: loop.runge_kutta(steps),
                },
                rounds,
            )
            euler[label] = ratio(times["ours"], times["euler"])
            runge_kutta[label] = ratio(times["ours"], times["runge_kutta"])
    subject, over = "`Simulation.advance` per step, order 4", ", ".join(case.label for case, _ in pairs)
    return [
        Row(subject, "Python loop of semi-implicit Euler, one `pin.aba` a step", over, 0.15, euler),
        Row(subject, "Python loop of Runge–Kutta of order 4, four `pin.aba` a step", over, None, runge_kutta),
    ]


def _simulation(case, damping, step):
    # The loops know no position limits either.
    return dd.Simulation(case.model, step=step, damping=np.full(case.dof, damping), limits=False)
