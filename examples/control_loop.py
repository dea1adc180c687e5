# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An arm that follows a moving target, in total joint rates, with its kinetic energy bounded."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
middle = np.clip(
    model.neutral, 0.9 * model.lower + 0.1 * model.upper, 0.1 * model.lower + 0.9 * model.upper
)
simulation = dd.Simulation(model, q=middle)
law = dd.JointTracking(dyn, gain=20.0, convergence=5.0)
limits = dd.Limits(dyn, energy_limit=0.5)

largest = 0.0
for _ in range(2000):
    t = simulation.time
    target, rate = middle + 0.1 * np.sin(2 * t), 0.2 * np.cos(2 * t) * np.ones(model.nv)
    command = law.command(simulation.q, simulation.qd, target, rate)
    limited = limits.filter(simulation.q, simulation.qd, command, simulation.step_size)
    simulation.advance(limited.effort)
    largest = max(largest, 0.5 * float(simulation.nu @ simulation.nu))
print(
    f"error {np.abs(simulation.q - target).max():.4f} rad, largest kinetic energy {largest:.3f} J"
)
