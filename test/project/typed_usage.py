# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A user's program for mypy, which `make lint` runs. Nobody runs it.

mypy must accept each line, call only typed functions, and reject each line with an ignored error:
an error that does not occur is a warning of `warn_unused_ignores`.
"""

import numpy as np

import diag_dynamics as dd

model = dd.load_urdf("arm.urdf", mimic="free", armature={"joint1": 0.1}, gravity=[0.0, 0.0, -1.62])
dyn = dd.DiagonalDynamics(model.with_payload("hand", 1.0))
q, qd, tau = model.neutral, np.zeros(model.nv), [0.0] * model.nv
s = dyn.evaluate(q, qd, tau, {"hand": np.ones(6)}, frame="world", friction=True)
energy: float = dyn.evaluate(q, qd).kinetic_energy
if s.epsilon is not None and s.power is not None:
    moments = s.epsilon - s.coriolis
    energy += s.power
nu = dyn.evaluate(np.tile(q, (10, 1)), np.tile(qd, (10, 1))).nu.mean(axis=0)
factor = dyn.factors(q).m @ qd
law = dd.JointTracking(dyn, gain=2.0, convergence=np.ones(model.nv))
limits = dd.Limits(dyn, energy_limit=0.5, effort_limit=np.ones(model.nv))
command = limits.filter(q, qd, law.command(q, qd, q), 1e-3).command
simulation = dd.Simulation(model, limits=dd.CompliantLimits(1e4))
simulation.advance(command.tau, steps=10)
residual = simulation.audit.residual
observer = dd.DisturbanceObserver(dyn, gain=25.0)
torque = observer.update(0.0, q, qd, tau).external_torque
recording = dd.read_recording("run.mcap", model)
dd.identify([recording], model).save("arm.yaml")
dd.calibrate([recording], dyn, gain=25.0, false_alarms=1 / 60).save("alarms.yaml")
dd.observe(dyn, recording, gain=25.0)
dd.excite(model, duration=20.0)

dd.load_urdff("arm.urdf")  # type: ignore[attr-defined]
dd.load_urdf("arm.urdf", mimic="embedded")  # type: ignore[arg-type]
model.dof_name  # type: ignore[attr-defined]  # noqa: B018
dyn.evaluate(q)  # type: ignore[call-arg]
dyn.evaluate("q", qd)  # type: ignore[arg-type]
s.nu = q  # type: ignore[misc]
s.epsilon + s.coriolis  # type: ignore[operator]
dyn.forward_dynamics(q, qd, tau, friktion=True)  # type: ignore[call-arg]
dd.Simulation(model, step="1e-3")  # type: ignore[arg-type]
