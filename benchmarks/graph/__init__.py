# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The nodes on a graph: the monitor against what rclpy alone costs, all of it in processes of their own."""
