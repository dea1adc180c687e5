"""Starting an executable so that a Ctrl-C is heard from the first moment on.

The libraries below import for a second, and some of them swallow a KeyboardInterrupt meanwhile. So the signals are
listened to before anything else is imported: ``python -m diag_dynamics.nodes.start monitor``.
"""

import signal
import sys
from importlib import import_module

_SIGNALS = (signal.SIGINT, signal.SIGTERM)


class _Stop:
    """Whether the process has been asked to end, and what to call when it is."""

    asked = False
    callback = None

    def __call__(self, *_):
        self.asked = True
        if self.callback:
            self.callback()


stop = _Stop()


def listen():
    """Take SIGINT and SIGTERM as a wish to end, to be looked at between two callbacks."""
    for number in _SIGNALS:
        signal.signal(number, stop)


def deafen():
    """Ignore further signals: a launcher's Ctrl-C arrives twice, and the process is ending already."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def start(executable):
    """Import and run one of this package's executables."""
    listen()
    sys.exit(import_module(f"diag_dynamics.nodes.{executable}").main())


if __name__ == "__main__":
    # As a module of the package, not as __main__, lest there be two `stop`.
    import_module("diag_dynamics.nodes.start").start(sys.argv.pop(1))
