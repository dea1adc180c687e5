# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes that end with the one that has started them."""

import ctypes
import os
import signal
import sys

PR_SET_PDEATHSIG = 1
"""Of Linux's prctl: the signal that a process gets when the one that has started it is gone."""


def ends_with(starter):
    """What a new process calls first, so that Linux ends it should its starter be killed; `starter` is the process number.

    No robot is moved by what nobody looks after.
    """
    libc = ctypes.CDLL(None) if sys.platform == "linux" else None

    def begin():
        if libc:
            libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
            if os.getppid() != starter:  # it was killed before that
                os.kill(os.getpid(), signal.SIGKILL)

    return begin
