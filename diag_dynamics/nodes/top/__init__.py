# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view `top`: the joints of robots by energy, torque or velocity, with peaks, limits and alarms."""
