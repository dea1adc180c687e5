# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Control in (ν, ε) without ROS: laws, filters of their commands, and the control loop.

A law returns a Command for a state, filters return changed commands. A wrong argument raises an
InputError that names it.

laws: laws and their commands. limits, tank: filters. filters: all filters and rates in their
order. observer: external torque. references: desired motions. by_dof: parameters. modes,
supervisor, loop: the control loop.
"""
