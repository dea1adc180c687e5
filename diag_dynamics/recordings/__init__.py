# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a robot: read, judged by the rules of the monitor, evaluated, and written."""
