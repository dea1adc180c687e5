# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy of an arm on which nothing acts: the sum stays, the shares do not."""

import numpy as np
from rods import model
from style import COLOURS, INK, figure

import diag_dynamics as dd


def data():
    """Return times (T,) [s], shares ½ν_k² (T, 3) [J] and flows −ν_k C_k (T, 3) [W]."""
    robot = model()
    simulation = dd.Simulation(robot, q=[0.0, 0.6, -1.2], qd=[2.0, -3.0, 4.0], step=1e-3)
    q, qd, t = [], [], np.arange(300) * 0.01
    for _ in t:
        q.append(simulation.q)
        qd.append(simulation.qd)
        simulation.advance(steps=10)
    batch = dd.DiagonalDynamics(robot).evaluate(np.array(q), np.array(qd))
    return t, batch.energy_share, -batch.nu * batch.coriolis


def draw():
    """Return the figure."""
    t, shares, flows = data()
    picture = figure(6.6, 3.6)
    above, below = picture.subplots(2, 1, sharex=True)
    above.stackplot(
        t, shares.T, colors=COLOURS, alpha=0.75, labels=[f"½ν{k}²" for k in "₁₂₃"], linewidth=0
    )
    above.plot(t, shares.sum(axis=1), color=INK, label="K")
    above.set(ylabel="energy [J]", ylim=(0, 1.25 * shares.sum(axis=1).max()))
    above.legend(ncols=4, loc="upper right")
    for k, flow in enumerate(flows.T):
        below.plot(t, flow, color=COLOURS[k], label=f"−ν{'₁₂₃'[k]}C{'₁₂₃'[k]}")
    below.plot(t, flows.sum(axis=1), color=INK, label="sum")
    below.set(xlabel="time [s]", ylabel="power [W]", xlim=(t[0], t[-1]))
    below.legend(ncols=4, loc="upper right")
    below.set_ylim(top=1.5 * flows.max())
    return picture
