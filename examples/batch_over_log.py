# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A log of ten thousand states, evaluated on all cores, as a table."""

import time

import numpy as np

import diag_dynamics as dd

model = dd.load_robot("ur5")
dyn = dd.DiagonalDynamics(model)
t = np.arange(10_000)[:, None] * 1e-3
frequency = np.linspace(0.1, 0.5, model.nv)
Q, QD = np.sin(frequency * t), frequency * np.cos(frequency * t)
TAU = dyn.gravity_torque(Q)

dyn.compile("evaluate", rows=True)  # or the first call would, and be taken for a slow one
begun = time.perf_counter()
batch = dyn.evaluate(Q, QD, TAU)
print(f"{len(batch)} states in {1e3 * (time.perf_counter() - begun):.1f} ms")
peak = int(batch.kinetic_energy.argmax())
print(f"K is highest after {t[peak, 0]:.3f} s: {batch[peak].kinetic_energy:.3f} J")
try:
    print(batch.to_frame()["nu"].describe().round(3))
except dd.InputError as error:  # without pandas
    print(error)
