# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A robot that falls for a second, and where its energy went."""

import diag_dynamics as dd

model = dd.load_robot("panda")
simulation = dd.Simulation(model)
simulation.advance(steps=1000)
K = 0.5 * simulation.nu @ simulation.nu
print(f"{simulation.time:.1f} s: q = {simulation.q.round(3)}, K = {K:.3f} J; {simulation.audit}")
