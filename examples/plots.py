# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plots, one line each: energy, balance of power, external torque, and the ellipsoid of a push."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)

amplitude = np.array([8.0, 6.0, 5.0, 4.0, 1.0, 1.0, 0.5, 0.0])  # of efforts [N m]
frequency = np.array([2.1, 2.6, 3.3, 2.9, 4.0, 5.0, 6.0, 0.0])  # [rad/s]

# A recording; here of a simulated arm that something pushes for a while, written as a table.
simulation = dd.Simulation(model, q=[0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8, 0.02])
rows = []
for k in range(6000):
    q, qd, time = simulation.q, simulation.qd, 1e-3 * k
    swing = amplitude * np.sin(frequency * time)
    tau = dyn.gravity_torque(q) + swing - np.array([8, 8, 6, 6, 1, 1, 0.5, 0.5]) * qd
    rows.append([time, *q, *qd, *tau])
    pushed = 3.5 <= time < 3.9
    simulation.advance(
        tau, f_ext={"panda_hand": [12.0, 25.0, 0.0, 0, 0, 0]} if pushed else None, frame="world"
    )
names = [
    "time",
    *(f"{kind}_{name}" for kind in ("position", "velocity", "effort") for name in model.dof_names),
]
np.savetxt("swing.csv", rows, delimiter=",", header=",".join(names), comments="")
recording = dd.read_recording("swing.csv", model)

dd.plot.energy(recording).figure.savefig("energy.png")
dd.plot.balance(recording).savefig("balance.png")
dd.plot.external_torque(recording, {"*": 3.0}).savefig("external_torque.png")
push = dd.plot.ellipsoid(model, recording.q[2000], "panda_hand", recording.qd[2000])
push.figure.savefig("ellipsoid.png")
print(recording, "as energy.png, balance.png, external_torque.png, ellipsoid.png")
