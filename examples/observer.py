# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque, observed while something pushes a simulated arm: no force sensor, no derivative of the mass matrix."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("ur5")
dyn, simulation = (
    dd.DiagonalDynamics(model),
    dd.Simulation(model, q=[0.0, -1.0, 1.2, 0.0, 0.5, 0.0]),
)
observer = dd.DisturbanceObserver(dyn, gain=25.0)
detector = dd.Detector(model.dof_names, dd.Thresholds({"norm": 8.0}))

for k in range(1000):
    time = 1e-3 * k
    q, qd = simulation.q, simulation.qd
    tau = dyn.gravity_torque(q) - 5.0 * qd
    pushed = 0.4 <= time < 0.6
    simulation.advance(
        tau, f_ext={"wrist_3_link": [0, 0, -20, 0, 0, 0]} if pushed else None, frame="world"
    )
    seen = observer.update(time, q, qd, tau)
    if not seen.valid:
        continue  # the first sample has nothing to compare with
    judged = detector.update(time, seen.residual, seen.external_torque)
    if k % 100 == 50:
        collision = "  collision" if judged.alarm[0] else ""
        print(f"{time:.2f} s: external torque {np.round(seen.external_torque, 1)} N m{collision}")
