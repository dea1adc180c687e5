# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor: joint_states and robot_description in, diagonalized dynamics out."""
