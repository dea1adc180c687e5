# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Kinetic energy of a recording as a plot."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)

amplitude = np.array([8.0, 6.0, 5.0, 4.0, 1.0, 1.0, 0.5, 0.0])  # of efforts [N m]
frequency = np.array([2.1, 2.6, 3.3, 2.9, 4.0, 5.0, 6.0, 0.0])  # [rad/s]

# A recording; here of a simulated arm, written as a table.
simulation = dd.Simulation(model, q=[0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.8, 0.02])
rows = []
for k in range(6000):
    q, qd, time = simulation.q, simulation.qd, 1e-3 * k
    swing = amplitude * np.sin(frequency * time)
    tau = dyn.gravity_torque(q) + swing - np.array([8, 8, 6, 6, 1, 1, 0.5, 0.5]) * qd
    rows.append([time, *q, *qd, *tau])
    simulation.advance(tau)
names = [
    "time",
    *(f"{kind}_{name}" for kind in ("position", "velocity", "effort") for name in model.dof_names),
]
np.savetxt("swing.csv", rows, delimiter=",", header=",".join(names), comments="")
recording = dd.read_recording("swing.csv", model)

batch = dyn.evaluate(recording.q, recording.qd)
dd.plot.energy(batch, recording.t).figure.savefig("energy.png")
print(recording, "as energy.png")
