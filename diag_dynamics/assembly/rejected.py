"""How an input says that it is not usable."""

from diag_dynamics.exceptions import shown


class RejectedError(Exception):
    """A message, or what would have been assembled from it, is not usable; `cause` is a short key to count by."""

    def __init__(self, cause, message):
        super().__init__(message)
        self.cause = cause

    def __str__(self):
        return shown(self)
