# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Starting an executable so that a Ctrl-C is heard from the first moment on.

The libraries below import for a second, and some of them swallow a KeyboardInterrupt meanwhile. So the signals are
listened to before anything else is imported: ``python -m diag_dynamics.nodes.support.start monitor``.
"""

import gc
import os
import signal
import sys
import threading
from contextlib import contextmanager
from importlib import import_module

EXECUTABLES = {
    "monitor": "monitor.monitor",
    "simulator": "simulator.simulator",
    "controller": "controller.controller",
    "view": "view.view",
    "demo": "demos.demo",
    "demo_control": "demos.demo_control",
    "energy_view": "demos.energy_view",
    "top": "top.top",
}
"""Where in diag_dynamics.nodes the main function of each executable is."""

KINDLY = 20.0
"""Time [s] that nodes have to end before who has started them kills them: on a busy machine they take theirs."""

UNSAID = 120
"""Status where all went well, but not all that was said could be written, as to a full disk: it is Python's own."""

_SIGNALS = (signal.SIGINT, signal.SIGTERM)

PATIENCE = 0.5
"""How long a process that was asked to end may take to begin with it before what may be left is left [s]."""

RITES = 0.5
"""How long it may then take to let go of what others see of it [s]."""


class _Stop:
    """Whether the process has been asked to end, and what a thread calls when it is.

    Python hears a signal between two of its own steps, and the compiler does one that takes ten seconds. So a thread hears
    it, too: from a section that :meth:`may_be_left` it ends the process itself. A signal's handler would run in the middle
    of whatever the main thread does, and wait for ever for a lock that this holds; the thread may wait.
    """

    asked = False
    callback = None

    def __init__(self):
        self._lock, self._sections, self._heard, self._begun = threading.Lock(), [], None, threading.Event()

    def __call__(self, *_):
        self.asked = True

    def listen(self):
        """Have a thread hear signals."""
        if self._heard is None:
            self._heard, wake = os.pipe()
            os.set_blocking(wake, False)
            signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
            threading.Thread(target=self._watch, name="signals", daemon=True).start()

    def ends(self):
        """Say that the process has begun to end in the ordinary way."""
        self._begun.set()

    @contextmanager
    def may_be_left(self, let_go=None, status=0):
        """A section in which nothing is lost if the process ends, after `let_go` was called in a thread, with a status."""
        with self._lock:
            self._sections.append((let_go, status))
        try:
            yield
        finally:
            with self._lock:  # never had again by a process that is being left
                self._sections.pop()

    def _watch(self):
        while os.read(self._heard, 1)[0] not in _SIGNALS:  # a terminal tells of its size by one, too
            pass
        self.asked = True
        if self.callback:
            self.callback()
        while not self._begun.wait(PATIENCE):
            with self._lock:
                if self._sections:
                    self._leave()

    def _leave(self):
        for let_go, _ in reversed(self._sections):
            if let_go:
                rites = threading.Thread(target=let_go, daemon=True)
                rites.start()
                rites.join(RITES)
        leave(self._sections[-1][1])


stop = _Stop()


def leave(status):
    """End the process where it stands, all that was said being written out; None is success, as to :func:`sys.exit`."""
    status = status or 0
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (BrokenPipeError, ValueError):
            continue  # nobody reads it any more
        except OSError:
            status = status or UNSAID
    os._exit(status)


def listen():
    """Take SIGINT and SIGTERM as a wish to end, to be looked at between two callbacks."""
    for number in _SIGNALS:
        signal.signal(number, stop)
    stop.listen()


def deafen():
    """Ignore further signals: a launcher's Ctrl-C arrives twice, and the process is ending already."""
    stop.ends()
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def start(executable):
    """Import and run one of this package's executables.

    The garbage collector waits until a node has settled, for it would look through the node's libraries again and again; and
    the process is left when its node has been let go of, for Python would take all of them apart. Together that is a sixth of
    the processor time of a monitor that is started and ended.
    """
    gc.disable()
    listen()
    with stop.may_be_left():
        module = import_module(f"diag_dynamics.nodes.{EXECUTABLES[executable]}")
    leave(module.main())


if __name__ == "__main__":
    # As a module of the package, not as __main__, lest there be two `stop`.
    import_module("diag_dynamics.nodes.support.start").start(sys.argv.pop(1))
