# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An arm with flexible links and its rigid twin with the same motion of the joints: links lag, and swing on after it."""

import numpy as np
from rods import model, points, urdf
from style import COLOURS, INK, figure

import diag_dynamics as dd

TIP = (
    '<link name="tip"/><joint name="tip" type="fixed"><parent link="rod3"/><child link="tip"/>'
    '<origin xyz="0.3 0 0"/></joint></robot>'
)
BENDING = {"EI": [34.0, 34.0], "modes": [2, 0, 0], "damping_ratio": 0.02}
STIFFNESS, DAMPING = np.array([900.0, 400.0, 50.0]), np.array([40.0, 12.0, 1.0])
START, TURN, TIME = np.array([-0.6, 0.4, 0.4]), np.array([1.2, 0.3, -0.3]), 0.8


def robot():
    """Return the flexible arm; the torques are those that turn its rigid twin from rest to rest."""
    links = {
        f"rod{k}": BENDING | {"tip": tip} for k, tip in ((1, "joint2"), (2, "joint3"), (3, "tip"))
    }
    text = urdf().replace("</robot>", TIP)
    return dd.load_urdf(text, loops={"flexible_links": links}, gravity=(0.0, 0.0, 0.0))


def curve(dynamics, q):
    """Return points along the links (n, 2) [m]."""
    at = {name: k for k, name in enumerate(dynamics.model.dof_names)}
    points = []
    for name, link in dynamics.model.flexible_links.items():
        X = dynamics.placement(q, name)
        eta = q[[at[mode] for mode in link.modes]]
        bent = [section.at + section.shape @ eta for section in link.sections]
        points += [X[:2, 3], *(X[:2, :3] @ point + X[:2, 3] for point in bent)]
    return np.array([*points, dynamics.placement(q, "tip")[:2, 3]])


def run():
    """Return the flexible arm, and positions of both arms (T, …)."""
    arm, twin = robot(), model()
    joints = [arm.dof_names.index(name) for name in twin.dof_names]
    q = np.zeros(arm.nv)
    q[joints] = START
    damping, rigid = np.zeros(arm.nv), dd.DiagonalDynamics(twin)
    damping[joints] = DAMPING
    sims = dd.Simulation(arm, q, damping=damping), dd.Simulation(twin, START, damping=DAMPING)
    rows = []
    for t in np.arange(1500) * 1e-3:
        s = min(t / TIME, 1.0)
        side = np.sign(0.5 - s) if 0.0 <= t < TIME else 0.0
        way = 2.0 * s * s if s < 0.5 else 1.0 - 2.0 * (1.0 - s) ** 2
        rate, pull = 4.0 * min(s, 1.0 - s) / TIME, 4.0 * side / TIME**2
        torque = rigid.inverse_dynamics(START + TURN * way, TURN * rate, TURN * pull)
        rows.append((sims[0].q, sims[1].q))
        for sim, own in zip(sims, (joints, slice(None)), strict=True):
            tau = np.zeros(sim.model.nv)
            tau[own] = (
                torque + STIFFNESS * (START + TURN * way - sim.q[own]) + DAMPING * TURN * rate
            )
            sim.advance(tau)
    return arm, [np.array(part) for part in zip(*rows, strict=True)]


def draw():
    """Return the figure."""
    arm, (q, rigid) = run()
    dynamics = dd.DiagonalDynamics(arm)
    picture = figure(6.6, 3.2)
    left, right = picture.subplots(1, 2)
    for n, k in enumerate((0, 380, 600, 850)):
        left.plot(*points(rigid[k]).T, color=INK, linestyle=":", label=None if n else "rigid twin")
        left.plot(*curve(dynamics, q[k]).T, color=COLOURS[0], label=None if n else "flexible arm")
    left.set(xlabel="x [m]", ylabel="y [m]", ylim=(-0.75, 1.05), aspect="equal")
    left.legend(loc="lower left")
    t = np.arange(len(q)) * 1e-3
    apart = [
        1e3 * (curve(dynamics, one)[-1] - points(other)[-1])
        for one, other in zip(q, rigid, strict=True)
    ]
    for part, name, colour in zip(np.transpose(apart), "xy", COLOURS, strict=False):
        right.plot(t, part, color=colour, label=name)
    right.set(xlabel="time [s]", ylabel="tip less that of the rigid twin [mm]", xlim=(t[0], t[-1]))
    right.legend(loc="upper right")
    return picture
