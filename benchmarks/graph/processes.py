# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Processes that answer lines of JSON with lines of JSON, and end with whoever has started them."""

import contextlib
import ctypes
import json
import os
import queue
import signal
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import psutil

FOLDER = Path(__file__).resolve().parents[1]
START = 60.0
"""Time that a process has for an answer beyond what it was asked to take [s]: a first start compiles."""

LEAVE = 5.0
"""Time that it has to end when it is asked to [s]; some rclpy miss a signal now and then."""


_DEATH_SIGNAL = 1  # PR_SET_PDEATHSIG
_prctl = getattr(ctypes.CDLL(None), "prctl", lambda *_: None)


class GraphError(RuntimeError):
    """A process has ended, or does not answer."""


class Process(contextlib.AbstractContextManager):
    """A module of this folder, running: ``Process("graph.feeder", "joint_1")``."""

    def __init__(self, module, *arguments):
        self._name = module
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed when the process is left)
        path = os.pathsep.join(filter(None, (str(FOLDER), os.environ.get("PYTHONPATH"))))
        self._process = subprocess.Popen(
            [sys.executable, "-m", module, *map(str, arguments)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=os.environ | {"PYTHONPATH": path},
            preexec_fn=_follow,
        )
        self._statistics = psutil.Process(self._process.pid)
        self._lines = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()

    def __exit__(self, *_):
        self.stop()
        try:
            self._process.wait(LEAVE)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._errors.close()

    def stop(self):
        """Ask it to leave: a process that is killed leaves files of its DDS in shared memory."""
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        self._process.terminate()

    def ask(self, method, *arguments, seconds=0.0):
        """Have a method called, which takes so long, and return what it returns.

        Raises
        ------
        GraphError
            The process has ended, or no answer comes.
        """
        try:
            self._process.stdin.write(json.dumps([method, *arguments]) + "\n")
            self._process.stdin.flush()
            line = self._lines.get(timeout=seconds + START)
        except (OSError, queue.Empty):
            line = None
        if line is None:
            raise GraphError(f"{self._name} does not answer '{method}':\n{self.errors()}")
        return json.loads(line)

    def alive(self):
        """Raise GraphError if the process has ended."""
        if self._process.poll() is not None:
            raise GraphError(
                f"{self._name} ended with {self._process.returncode}:\n{self.errors()}"
            )

    def errors(self):
        """The end of what it has written to its standard error."""
        self._errors.seek(0)
        return self._errors.read().decode(errors="replace")[-3000:]

    def cpu(self):
        """CPU time of all its threads so far [s]."""
        times = self._statistics.cpu_times()
        return times.user + times.system

    def memory(self):
        """Resident memory [B]."""
        return self._statistics.memory_info().rss

    def _read(self):
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)


def _follow():
    """Have Linux end this process with the one that has started it, even where that is killed."""
    _prctl(_DEATH_SIGNAL, signal.SIGTERM)
