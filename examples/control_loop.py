# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""An arm that follows a moving target, in total joint rates, with its kinetic energy bounded."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("panda")
dyn = dd.DiagonalDynamics(model)
middle = 0.5 * (model.lower + model.upper)
amplitude = np.minimum(0.1, 0.4 * (model.upper - model.lower))  # the fingers have 0.04 m
simulation = dd.Simulation(model, q=middle)
law = dd.JointTracking(dyn, gain=20.0, convergence=5.0)
limits = dd.Limits(dyn, energy_limit=0.1)  # [J]

largest = 0.0
for _ in range(2000):
    t = simulation.time
    target = middle + amplitude * np.sin(2 * t)
    rate = 2 * amplitude * np.cos(2 * t)
    command = law.command(simulation.q, simulation.qd, target, rate)
    limited = limits.filter(simulation.q, simulation.qd, command, simulation.step_size)
    simulation.advance(limited.effort)
    largest = max(largest, 0.5 * float(simulation.nu @ simulation.nu))
print(
    f"error {np.abs(simulation.q - target).max():.4f} rad, largest kinetic energy {largest:.3f} J"
)
