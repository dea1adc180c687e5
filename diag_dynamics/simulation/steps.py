# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Steps of the simulation, with friction by the state at their begin."""

import math
from collections import namedtuple

from diag_dynamics.numerics.kernel import (
    COUNT,
    FLAG,
    NUMBER,
    ROBOT,
    VECTOR,
    entry_kernel,
    large_kernel,
)
from diag_dynamics.simulation import midpoint
from diag_dynamics.simulation.step_memory import opened
from diag_dynamics.sweeps import classical, factorization, records
from diag_dynamics.sweeps import workspace as ws

Load = namedtuple("Load", ["tau", "wrenches", "in_world"])
"""Joint efforts [N m, N] and wrenches of a step, and whether wrenches are in world axes."""


@large_kernel
def _update_friction(address):
    """Set damping and Coulomb friction of the step by the state at its begin; return a status."""
    sim = opened(address)
    bodies, _, work, _ = ws.opened(sim.robot)
    status = classical.inverse_dynamics(sim.robot, sim.q, sim.zeros, sim.zeros, 1.0, sim.needed)
    for k in range(len(sim.qd)):
        sim.friction[k] = sim.coulomb[k] + sim.load_friction[k] * abs(sim.needed[k])
        rate = max(abs(sim.qd[k]), sim.slowest[k])
        sim.damping[k] = sim.viscous[k] + sim.root_friction[k] / math.sqrt(rate)
    for i in range(1, len(bodies)):
        k = bodies[i].dof
        ratio = work[i].multiplier
        sim.friction[k] += sim.follower_friction[i] * abs(ratio)
        sim.damping[k] += sim.follower_damping[i] * ratio * ratio
    return status


@entry_kernel(ROBOT, NUMBER, COUNT, VECTOR, records.WRENCHES, FLAG, FLAG, nogil=True)
def advance(address, h, steps, tau, wrenches, in_world, geared):
    """Take `steps` steps of the simulation at an address; a failure leaves the last good state.

    Friction of `geared` joints depends on load, the root of the rate, or a changing ratio.
    """
    sim = opened(address)
    load = Load(tau, wrenches, in_world)
    _, _, work, _ = ws.opened(sim.robot)
    ws.copy(sim.state, sim.last)
    status = 0
    count = 0
    if steps > 0 and midpoint.is_beyond_hard_limit(address):
        status = midpoint.resolve_impacts(address, h)
    while status == 0 and count < steps:
        ws.copy(sim.state, sim.last)
        status = _update_friction(address) if geared else 0
        if status == 0:
            status = midpoint.midpoint_step(address, h, load)
        count += 1
    if status == 0 and steps > 0:
        status = factorization.transform(sim.robot, sim.q, sim.qd, factorization.NU_FROM_QD, sim.nu)
    if status == 0 and steps > 0 and not math.isfinite(midpoint.kinetic_energy(sim.nu)):
        status = -1
    if status != 0:
        failing = work[status].D if status > 0 else 0.0
        ws.copy(sim.last, sim.state)
        count -= 1
        factorization.transform(sim.robot, sim.q, sim.qd, factorization.NU_FROM_QD, sim.nu)
        if status > 0:
            work[status].D = failing  # for the error message
    sim.steps[0] += max(count, 0)
    return status
