# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Nanoseconds."""

SECOND = 1_000_000_000


def nanoseconds(seconds):
    """Return the nanoseconds of seconds, rounded.

    Truncated, 1.001 s would fall short of 1001 ms.
    """
    return round(seconds * SECOND)
