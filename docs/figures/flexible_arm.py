# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A flexible arm and its rigid twin follow one motion of their motors: the tip swings, springs exchange energy with it."""

import numpy as np
from rods import points, urdf
from style import COLOURS, INK, figure

import diag_dynamics as dd

STIFFNESS, INERTIA = (600.0, 250.0, 60.0), (0.3, 0.1, 0.02)
"""k [N m/rad] and B [kg m²] of the three joints."""


def robots():
    """Return the models of the flexible arm and of its rigid twin, whose armature is B."""
    names = [f"joint{k}" for k in (1, 2, 3)]
    springs = {
        name: {"stiffness": k, "damping": 5e-4 * k, "rotor_inertia": B, "effort": "spring"}
        for name, k, B in zip(names, STIFFNESS, INERTIA, strict=True)
    }
    options = {"gravity": (0.0, 0.0, 0.0)}
    flexible = dd.load_urdf(urdf(), parameters={"flexible_joints": springs}, **options)
    return flexible, dd.load_urdf(
        urdf(), armature=dict(zip(names, INERTIA, strict=True)), **options
    )


def run(model):
    """Return the tip (T, 2) [m], and energies of links, motors and springs (T, 3) [J]; motors turn by 1 rad in 0.4 s."""
    simulation, dynamics, rows = (
        dd.Simulation(model, q=[0.0, 0.4, 0.4]),
        dd.FlexibleDynamics(model),
        [],
    )
    B = np.array(INERTIA)
    for t in np.arange(1200) * 1e-3:
        s = min(t / 0.4, 1.0)
        wanted = np.array([0.0, 0.4, 0.4]) + np.array([1.0, -0.5, 0.5]) * s**3 * (
            10 - 15 * s + 6 * s * s
        )
        theta, rate = (
            (simulation.theta, simulation.thetad)
            if dynamics.names
            else (simulation.q, simulation.qd)
        )
        simulation.advance(4000.0 * B * (wanted - theta) - 120.0 * B * rate)
        motors, springs = (
            0.5 * (dynamics.rotor_inertia @ simulation.thetad**2),
            simulation.elastic_energy,
        )
        rows.append(
            [*points(simulation.q)[-1], simulation.kinetic_energy - motors, motors, springs]
        )
    rows = np.array(rows)
    return rows[:, :2], rows[:, 2:]


def draw():
    """Return the figure."""
    (tip, energies), (rigid, _) = map(run, robots())
    t, picture = np.arange(len(tip)) * 1e-3, figure(6.6, 3.6)
    above, below = picture.subplots(2, 1, sharex=True)
    above.plot(t, rigid[:, 1], color=INK, label="rigid twin")
    above.plot(t, tip[:, 1], color=COLOURS[0], label="flexible arm")
    above.set(ylabel="tip y [m]")
    above.legend(loc="lower right")
    below.stackplot(
        t,
        energies.T,
        colors=COLOURS,
        alpha=0.75,
        labels=("links", "motors", "springs"),
        linewidth=0,
    )
    below.set(xlabel="time [s]", ylabel="energy [J]", xlim=(t[0], t[-1]))
    below.legend(loc="upper right")
    return picture
