# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a process that hangs is at: the Python of all its threads, and where there is gdb, what is below that."""

import os
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import psutil

DUMP = signal.SIGABRT
"""At this Python says where its threads are, and dies: faulthandler, which :data:`ENVIRONMENT` enables."""

ENVIRONMENT = {"PYTHONFAULTHANDLER": "1"}
"""For processes whose stacks may be asked for."""


def family(pid):
    """A process and all that it has started, as far as they are alive, youngest first."""
    with suppress(psutil.NoSuchProcess):
        process = psutil.Process(pid)
        return [*reversed(process.children(recursive=True)), process]
    return []


def of_threads(process):
    """State and name of each thread of a process, and where in the kernel it waits; Fast DDS names its own."""
    lines = []
    for task in sorted(Path(f"/proc/{process.pid}/task").glob("*")):
        with suppress(OSError):
            name, place = ((task / file).read_text().strip() for file in ("comm", "wchan"))
            state = (task / "stat").read_text().rpartition(")")[2].split()[0]
            lines.append(f"  thread {task.name} {state} {name}: {place}")
    return "\n".join(lines)


def below_python(process):
    """What gdb says of a process; empty where there is none, or where it may not."""
    if not shutil.which("gdb"):
        return ""
    command = ["gdb", "-p", str(process.pid), "-batch", "-nx", "-ex", "thread apply all bt 25"]
    with suppress(subprocess.SubprocessError):
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=60, env=os.environ | {"DEBUGINFOD_URLS": ""}
        )
        return "\n".join(line for line in done.stdout.splitlines() if line.startswith(("Thread", "#")))
    return ""


def known_of(process):
    """What can be told of a process without its help."""
    with suppress(psutil.NoSuchProcess):
        command = " ".join(process.cmdline()[:6])
        return f"{process.pid}, {process.status()}: {command}\n{of_threads(process)}\n{below_python(process)}"
    return ""


def _wait_for_end(process, longest=5.0):
    """Wait until a process is over, for a time [s]: one that is stopped in the kernel says nothing."""
    end = time.monotonic() + longest
    while process.status() != psutil.STATUS_ZOMBIE and time.monotonic() < end:
        time.sleep(0.01)  # nothing tells of another's child


def asked_for(pid):
    """Have a process and those it has started say where they are, which ends them; and return what is known besides.

    Their own words go to where their errors go, one after the other: two at once would be mixed letter by letter.
    """
    processes = family(pid)
    found = [known_of(process) for process in processes]
    for process in processes:
        with suppress(psutil.NoSuchProcess):
            process.send_signal(DUMP)
            _wait_for_end(process)
    return "\n".join(found)
