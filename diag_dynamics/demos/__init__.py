# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Demonstrations without a ROS: a wrong model, a simulated robot that it is of, and what the library makes of both."""
