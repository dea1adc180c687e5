"""Rejection of an input."""

from diag_dynamics.exceptions import shown


class RejectedError(Exception):
    """Unusable message, or unusable state that it would complete; `cause` is a short key to count by."""

    def __init__(self, cause, message):
        super().__init__(message)
        self.cause = cause

    def __str__(self):
        return shown(self)
