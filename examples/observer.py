# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""External torque of a simulated arm that is pushed: no force sensor, no accelerations."""

import diag_dynamics as dd

model = dd.load_robot("ur5")
dyn = dd.DiagonalDynamics(model)
simulation = dd.Simulation(model, q=[0.0, -1.0, 1.2, 0.0, 0.5, 0.0])
observer = dd.DisturbanceObserver(dyn, gain=25.0)
detector = dd.Detector(model.dof_names, dd.Thresholds({"norm": 8.0}))

alarms = []
for k in range(1000):
    time = 1e-3 * k
    q, qd = simulation.q, simulation.qd
    tau = dyn.gravity_torque(q) - 5.0 * qd
    pushed = 0.4 <= time < 0.6
    simulation.advance(
        tau, f_ext={"wrist_3_link": [0, 0, -20, 0, 0, 0]} if pushed else None, frame="world"
    )
    observed = observer.update(time, q, qd, tau)
    if not observed.valid:
        continue  # the first sample has nothing to compare with
    if detector.update(time, observed.residual, observed.external_torque).alarm[0]:
        alarms.append(time)
print(f"pushed from 0.4 to 0.6 s; alarm from {alarms[0]:.3f} to {alarms[-1]:.3f} s")
