"""Compiling before anything is called: all entries at once, told of while it goes on, and notices where nobody asked."""

import importlib
import logging
import sys
import threading
import time
from contextlib import contextmanager

logger = logging.getLogger("diag_dynamics")

PATIENCE = 2.0
"""Time [s] for which compiling says nothing."""

NOTICE = (
    "diag_dynamics: compiling for this machine and Python, which takes up to a minute and is kept for the next time."
)

_entries = []
_told = []


def register(entry):
    """Have an entry kernel compiled by :func:`compile_ahead`."""
    _entries.append(entry)


def compile_ahead(*modules, report=None):
    """Compile entry kernels, or load them from the cache.

    Parameters
    ----------
    *modules : str
        Names of modules, and of packages for all modules in them, as ``diag_dynamics.sweeps``.
    report : callable, optional
        Called with the name of the entry that is next, how many are done, and how many there are; at last with None.
    """
    from diag_dynamics.compiled.kernel import ready  # which registers its entries here

    for module in modules:
        importlib.import_module(module)
    chosen = [entry for entry in _entries if any(f"{entry.__module__}.".startswith(f"{name}.") for name in modules)]
    for done, entry in enumerate(chosen):
        if report:
            report(entry.__name__, done, len(chosen))
        ready(entry)
    if report:
        report(None, len(chosen), len(chosen))


@contextmanager
def told(name):
    """While something is compiled: a line on stderr, once in a process, if it takes long; afterwards one in the log."""
    start, timer = time.perf_counter(), None
    if not _told:
        timer = threading.Timer(PATIENCE, _tell)
        timer.daemon = True
        timer.start()
    try:
        yield
    finally:
        if timer:
            timer.cancel()
        logger.info("%s was compiled, or loaded, in %.1f s", name, time.perf_counter() - start)


def _tell():
    if not _told and sys.stderr:
        _told.append(True)
        print(NOTICE, file=sys.stderr, flush=True)
