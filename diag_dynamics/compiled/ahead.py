# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Compiling before anything is called: all entries of some modules at once."""

import importlib
import pkgutil

from diag_dynamics.compiled.kernel import ready
from diag_dynamics.compiled.progress import registered, steps


def compile_ahead(*modules, report=None):
    """Compile entry kernels, or load them from the cache.

    Parameters
    ----------
    *modules : str
        Names of modules, and of packages for all modules in them, as ``diag_dynamics.sweeps``.
    report : callable, optional
        Called with the name of the entry that is next, how many are done, and how many there are; at last with None.
    """
    for module in modules:
        package = importlib.import_module(module)
        for found in pkgutil.iter_modules(getattr(package, "__path__", ()), f"{module}."):
            importlib.import_module(found.name)
    chosen = [entry for entry in registered() if any(f"{entry.__module__}.".startswith(f"{m}.") for m in modules)]
    for done, entry in enumerate(steps(chosen)):
        if report:
            report(entry.__name__, done, len(chosen))
        ready(entry)
    if report:
        report(None, len(chosen), len(chosen))
