# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the nodes: their tables, and the checks on values that belong together. No ROS."""
