# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Pinocchio integrates the motions that `Simulation` integrates."""

import numpy as np
import pinocchio as pin


def start(model, seed, speed=1.0):
    """A state off every symmetry."""
    rng = np.random.default_rng(seed)
    q = model.neutral + 0.4 * rng.uniform(-1, 1, model.nq)
    for k, component in enumerate(model.orientations):
        if component == 3:
            q[k - 3 : k + 1] /= np.linalg.norm(q[k - 3 : k + 1])
    return q, speed * rng.normal(size=model.nv)


def reference(oracle, q, qd, effort, duration, h, more=lambda x, v: 0.0):
    """Runge-Kutta-Munthe-Kaas steps on Pinocchio's aba and integrate; its charts' rates by
    differences of pin.difference.

    `more` gives efforts that depend on configuration and velocity, all in Pinocchio's order. The
    chart is Pinocchio's own, so neither the exponential nor its differential is ours.
    """
    model = oracle.model
    data = oracle.data
    x = oracle.configuration(q)
    v = oracle.to_pin(qd)

    def chart_rate(x, u, v):
        at = pin.integrate(model, x, u)
        d = 1e-4
        ends = (
            pin.difference(model, x, pin.integrate(model, at, s * d * v)) for s in (1, -1, 2, -2)
        )
        f, b, ff, bb = ends
        return (8 * (f - b) - (ff - bb)) / (12 * d)

    def rates(u, v):
        at = pin.integrate(model, x, u)
        return chart_rate(x, u, v), pin.aba(model, data, at, v, oracle.to_pin(effort) + more(at, v))

    for _ in range(round(duration / h)):
        u1, a1 = rates(np.zeros(model.nv), v)
        u2, a2 = rates(h / 2 * u1, v + h / 2 * a1)
        u3, a3 = rates(h / 2 * u2, v + h / 2 * a2)
        u4, a4 = rates(h * u3, v + h * a3)
        x = pin.integrate(model, x, h / 6 * (u1 + 2 * u2 + 2 * u3 + u4))
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    return x, oracle.from_pin(v)


def distance(oracle, sim, x, qd):
    """From the simulation's state to the reference's."""
    apart = pin.difference(oracle.model, oracle.configuration(sim.q), x)
    return np.linalg.norm(apart) + np.linalg.norm(sim.qd - qd)
