# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Limits of time in tests."""

HANG = 600.0
"""Longest wait for anything [s], by the clock of the test: wall time, or simulated time of nodes.

It only ends a test that hangs. A shorter limit fails on a slow machine.
"""
