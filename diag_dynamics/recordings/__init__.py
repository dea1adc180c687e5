# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of a robot: read, judged as the monitor judges what it receives, evaluated, and written."""
