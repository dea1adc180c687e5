# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A log of ten thousand states, evaluated on all cores."""

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("ur5")
dyn = dd.DiagonalDynamics(model)
t = np.arange(10_000)[:, None] * 1e-3
frequency = np.linspace(0.1, 0.5, model.nv)
Q, QD = np.sin(frequency * t), frequency * np.cos(frequency * t)
TAU = dyn.gravity_torque(Q)

batch = dyn.evaluate(Q, QD, TAU)
peak = batch.kinetic_energy.argmax()
print(f"{len(t)} states; K is highest after {t[peak, 0]:.3f} s: {batch.kinetic_energy[peak]:.3f} J")
