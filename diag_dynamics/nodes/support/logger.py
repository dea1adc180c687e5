# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A logger that shows what others have written as it is, and lets nothing of it act on a terminal or in a file."""

import os

from rclpy.impl import rcutils_logger

from diag_dynamics.text import plain

# Throttling goes by the line that logs: it is to be found above this file, as it is above rclpy's own.
rcutils_logger._internal_callers.append(os.path.realpath(__file__))


class PlainLogger(rcutils_logger.RcutilsLogger):
    """rclpy's logger, every message of which goes through :func:`~diag_dynamics.text.plain`."""

    def log(self, message, severity, **kwargs):
        """Log a message; see rclpy."""
        return super().log(plain(str(message)), severity, **kwargs)
