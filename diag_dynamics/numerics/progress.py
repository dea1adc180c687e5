# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Messages while kernels compile: one callback, which prints to stderr unless it is set."""

import logging
import sys
import threading
import time
from contextlib import contextmanager, suppress

logger = logging.getLogger("diag_dynamics")

DELAY = 2.0
"""Time [s] of compiling, of one kernel or of several in a row, before the first message."""

MAX_PAUSE = 1.0
"""Time [s] without compiling after which the delay begins again."""

PERIOD = 5.0
"""Time [s] between two messages."""

RULE = "for this machine and Python, once (in advance: diag-dynamics compile)"


def print_message(text):
    """Print a message to stderr."""
    with suppress(OSError, ValueError):  # stderr is closed
        print(f"diag_dynamics: {text}", file=sys.stderr, flush=True)


class Progress:
    """Times of a row of compilations and of the last message, and the receiver of messages."""

    def __init__(self):
        self.callback = print_message
        self.loads = False  # what begins is loaded from the cache, as far as is known
        self._begun = 0.0
        self._ended = -MAX_PAUSE
        self._sent = None
        self._lock = threading.Lock()

    def begin(self, now):
        """Return the time [s] of the first message of a kernel that begins to compile `now`."""
        if now - self._ended >= MAX_PAUSE:
            self._begun = now
        due = self._begun + DELAY
        return due if self._sent is None else max(due, self._sent + PERIOD)

    def end(self, now):
        """Store the end of a compilation."""
        self._ended = now

    def send(self, name, begun, now):
        """Send a message; return the time [s] of the next one."""
        with self._lock:
            first = self._sent is None
            self._sent = now
        self.callback(
            f"compiling {name} {RULE}" if first else f"compiling {name}, for {now - begun:.0f} s"
        )
        return now + PERIOD


_progress = Progress()


def set_progress_callback(callback=None):
    """Pass messages to a function in a thread of its own; None prints them to stderr."""
    _progress.callback = callback or print_message


def send_message(text):
    """Pass a message to the receiver."""
    _progress.callback(text)


def begin_compilation():
    """Note that the compiler works: the cache lacks the kernel."""
    _progress.loads = False


@contextmanager
def report_compilation(name, loads):
    """Send messages while a kernel compiles, if that takes long; log its time at the end.

    With `loads` it does not compile until :func:`begin_compilation`.
    """
    begun = time.perf_counter()
    done = threading.Event()
    _progress.loads = loads
    threading.Thread(
        target=_report, args=(name, begun, done), name="compiling", daemon=True
    ).start()
    try:
        yield
    finally:
        done.set()
        now = time.perf_counter()
        _progress.end(now)
        logger.info("%s was compiled, or loaded, in %.1f s", name, now - begun)


def _report(name, begun, done):
    due = _progress.begin(begun)
    while not done.wait(max(0.1, due - time.perf_counter())):
        if not _progress.loads:
            due = _progress.send(name, begun, time.perf_counter())
