# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions of robots: texts of URDF, xacro and MJCF, files beside them, and their checks."""
