# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What people look at: the terminal view and pictures, of numbers that others give them. No ROS."""
