# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stacks of a process that hangs: Python dumps those of all its threads."""

import os
import select
import signal
from contextlib import suppress

import psutil

DUMP = signal.SIGABRT
"""At this signal Python dumps the stacks of its threads and ends: faulthandler, which :data:`ENVIRONMENT` enables."""

ENVIRONMENT = {"PYTHONFAULTHANDLER": "1"}
"""Variables of processes that dump their stacks."""


def family(pid):
    """Return a process and its descendants that are alive, youngest first."""
    with suppress(psutil.NoSuchProcess):
        process = psutil.Process(pid)
        return [*reversed(process.children(recursive=True)), process]
    return []


def known_of(process):
    """Return pid, state and command of a process."""
    with suppress(psutil.NoSuchProcess):
        command = " ".join(process.cmdline()[:6])
        return f"{process.pid}, {process.status()}: {command}\n"
    return ""


def _wait_for_end(process, longest=5.0):
    """Wait until a process has ended, for a time [s]: one that is stopped in the kernel does not end."""
    descriptor = os.pidfd_open(process.pid)
    try:
        select.select([descriptor], [], [], longest)
    finally:
        os.close(descriptor)


def asked_for(pid):
    """Have a process and those it has started say where they are, which ends them; and return what is known besides.

    Their own words go to where their errors go, one after the other: two at once would be mixed letter by letter.
    """
    processes = family(pid)
    found = [known_of(process) for process in processes]
    for process in processes:
        with suppress(psutil.NoSuchProcess, ProcessLookupError):
            process.send_signal(DUMP)
            _wait_for_end(process)
    return "\n".join(found)
