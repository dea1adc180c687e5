# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Rejection of an input."""

from diag_dynamics.exceptions import DiagDynamicsError, shown


class RejectedError(Exception):
    """Unusable message, or unusable state that it would complete; `cause` is a short key to count by."""

    def __init__(self, cause, message):
        super().__init__(message)
        self.cause = cause

    def __str__(self):
        return shown(self)


def cause_of(error):
    """A short key to count by what has kept a message from making a state."""
    if isinstance(error, RejectedError):
        return error.cause
    return type(error).__name__ if isinstance(error, DiagDynamicsError) else "internal error"
