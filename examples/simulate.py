# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot that falls for a second, and where its energy went."""

import diag_dynamics as dd

model = dd.load_robot("panda")
simulation = dd.Simulation(model)
for _ in range(10):
    simulation.advance(steps=100)
    print(
        f"{simulation.time:.1f} s  q₂ = {simulation.q[1]:+.3f} rad  K = {0.5 * simulation.nu @ simulation.nu:7.3f} J"
    )
print(simulation.audit)
