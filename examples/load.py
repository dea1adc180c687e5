# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A load that an arm picks up: mass and centre while it moves, from the external torque, without accelerations."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("ur5")
loaded = model.with_payload("tool0", mass=1.5, com=(0.0, 0.0, 0.06))
dyn, truth = dd.DiagonalDynamics(model), dd.DiagonalDynamics(loaded)
robot = dd.Simulation(loaded, q=[0.0, -1.2, 1.4, -1.0, 1.2, 0.3])  # replace by your robot
deviation = [0.5, 0.5, 0.4, 0.1, 0.1, 0.1]  # of the external torque without contact [N m]
covariance = np.diag(deviation) ** 2
observer = dd.DisturbanceObserver(dyn, gain=25.0, effort="held")
estimator = dd.LoadEstimator(dyn, "tool0", 25.0, covariance)
tau = truth.gravity_torque(robot.q)
for k in range(500):  # 2 s
    t, q, qd = 4e-3 * k, robot.q, robot.qd
    load = estimator.update(t, q, qd, observer.update(t, q, qd, tau).external_torque)
    tau = truth.inverse_dynamics(q, qd, 10.0 * (0.5 * np.sin(2.0 * t) - qd))
    robot.advance(tau, steps=4)
model = model.with_payload("tool0", *estimator.payload())
print(
    f"{load.mass:.2f} ± {load.mass_deviation:.2f} kg at "
    f"{load.center.round(3)} ± {load.center_deviation.round(3)} m; is_load: {load.is_load}"
)
