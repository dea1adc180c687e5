# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What is said while kernels are compiled: to whom, how far it is, and how long it takes as a rule."""

import logging
import sys
import threading
import time
from contextlib import contextmanager, suppress

logger = logging.getLogger("diag_dynamics")

PATIENCE = 2.0
"""Time [s] for which compiling says nothing, of kernels one after the other as of a single one."""

LEAST = 0.3
"""Time [s] for which a single kernel says nothing, whatever went before: one that is in the cache takes less."""

PAUSE = 1.0
"""Time [s] without a kernel after which patience begins anew."""

EVERY = 5.0
"""Least time [s] between two lines."""

RULE = "for this machine and Python, once: all kernels take about half a minute (in advance: diag-dynamics compile)"

_entries = []
_steps = threading.local()  # of each thread: how far it is
_lock = threading.Lock()


def register(entry):
    """Have an entry kernel compiled by :func:`ahead.compile_ahead`."""
    _entries.append(entry)


def registered():
    """Entry kernels of all modules that have been imported."""
    return tuple(_entries)


def on_stderr(text):
    """Say a line on stderr, where there is one."""
    with suppress(OSError, ValueError):  # nobody reads it any more
        print(f"diag_dynamics: {text}", file=sys.stderr, flush=True)


class _Teller:
    """Says lines, to whomever wants them, and no more than one in :data:`EVERY` seconds."""

    def __init__(self):
        self.say, self._last = on_stderr, None

    def line(self, what, start):
        """Say what is compiled, and since when; or return for how long [s] nothing may be said yet."""
        with _lock:
            now, first = time.perf_counter(), self._last is None
            if not first and now - self._last < EVERY:
                return self._last + EVERY - now
            self._last = now
        since = f", for {now - start:.0f} s by now" if now - start >= 1.0 else ""
        self.say(f"compiling {what} {RULE}" if first else f"compiling {what}{since}")
        return EVERY


class _Row:
    """Kernels that are compiled one after the other."""

    def __init__(self):
        self._begun, self.ended = 0.0, -PAUSE

    def before(self, now):
        """For how long [s] this has been going on."""
        if now - self.ended >= PAUSE:
            self._begun = now
        return now - self._begun


_teller, _row = _Teller(), _Row()


def tell_by(say):
    """Have lines said by a function of a text, which a thread of its own calls; None for stderr, as it is at first."""
    _teller.say = say or on_stderr


def steps(items):
    """Go through what is compiled one after the other: that is how far it is."""
    try:
        for k, item in enumerate(items, 1):
            _steps.far = f" ({k} of {len(items)})"
            yield item
    finally:
        _steps.far = ""


@contextmanager
def told(name):
    """While something is compiled: lines if it takes long, see :func:`tell_by`; afterwards one in the log."""
    start, over = time.perf_counter(), threading.Event()
    what = name + getattr(_steps, "far", "")
    wait = max(LEAST, PATIENCE - _row.before(start))
    threading.Thread(target=_tell, args=(what, start, over, wait), name="compiling", daemon=True).start()
    try:
        yield
    finally:
        over.set()
        _row.ended = time.perf_counter()
        logger.info("%s was compiled, or loaded, in %.1f s", name, time.perf_counter() - start)


def _tell(what, start, over, wait):
    while not over.wait(wait):
        wait = _teller.line(what, start)
