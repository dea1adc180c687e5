# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics compile`: all kernels compiled in advance, in several processes."""

import multiprocessing
import os
import platform
import signal
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import suppress

from diag_dynamics.atomic_file import write_text
from diag_dynamics.cli import common
from diag_dynamics.exceptions import InputError
from diag_dynamics.numerics.cache import (
    STAMP_PREFIX,
    cache_folder,
    code_folder,
    source_hash,
)
from diag_dynamics.text import Progress
from diag_dynamics.threads import cores

UNITS = {
    "sweeps.batch": 16,
    "simulation.steps": 12,
    "sweeps.derivatives": 10,
    "sweeps.couplings": 7,
    "sweeps.factorization": 7,
    "sweeps.group_steps": 6,
    "sweeps.contacts": 6,
    "joint_states.rules": 4,
    "sweeps.external": 4,
    "sweeps.regressors": 3,
    "sweeps.evaluation": 2,
    "sweeps.classical": 2,
    "sweeps.kinematics": 2,
    "sweeps.mobilities": 1,
    "sweeps.followers": 1,
    "sweeps.alarms": 1,
    "sweeps.limits": 1,
    "identification.normal_equations": 1,
}
"""Modules with entry kernels and their compile times in sequence [CPU-s], the longest first."""


def add_arguments(parser):
    """Declare the arguments."""
    text = "number of processes (default: number of processors)"
    parser.add_argument("--jobs", type=common.positive_int, default=cores(), help=text)
    text = "do nothing if this command has compiled this code on this machine"
    parser.add_argument("--if-needed", action="store_true", help=text)
    common.add_quiet(parser)


def run(chosen):
    """Compile what the cache lacks; return the exit status."""
    if cache_folder() is None:
        print(
            "diag-dynamics compile: "
            "there is no folder to keep compiled code in, so nothing is done.",
            file=sys.stderr,
        )
        return 1
    with suppress(OSError):
        if chosen.if_needed and _stamp_file().read_text(encoding="utf-8") == _stamp():
            _stamp_file().touch()  # or it is removed after a month
            return common.DONE
    start = time.perf_counter()
    with Progress(chosen.quiet, lines=True) as progress:
        progress.show(
            "Compiling all kernels for this machine and Python. This takes half a minute or more."
        )
        failure = _compile(min(chosen.jobs, len(UNITS)), progress)
    if failure:
        print(f"diag-dynamics compile: {failure}", file=sys.stderr)
        return 1
    with suppress(InputError):  # without it, the next --if-needed looks through the cache
        write_text(_stamp_file(), _stamp())
    if not chosen.quiet:
        print(
            f"Compiled, or found compiled, in {time.perf_counter() - start:.0f} s.", file=sys.stderr
        )
    return common.DONE


def _compile(jobs, progress):
    """Compile all units in processes, and return the reason of a failure or None.

    An interrupt ends the processes.
    """
    context = multiprocessing.get_context("spawn")  # a fork would share the compiler's locks
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_end_with_parent)
    done = 0
    try:
        before = signal.signal(
            signal.SIGINT, signal.SIG_IGN
        )  # for the workers: Ctrl-C is this process's matter
        running = {pool.submit(compile_unit, unit): unit for unit in UNITS}
        signal.signal(signal.SIGINT, before)
        for future in as_completed(running):
            if error := future.exception():
                return f"{running[future]}: {type(error).__name__}: {error}"
            done += UNITS[running[future]]
            progress.show(f"  {100 * done // sum(UNITS.values()):3} %  {running[future]}")
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
    return None


def _end_with_parent():
    """Have this worker end with the process that started it, also if that is killed."""

    def wait():
        multiprocessing.parent_process().join()
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=wait, daemon=True).start()


def compile_unit(unit):
    """Compile a module of kernels in a worker, silently."""
    from diag_dynamics.numerics import kernel
    from diag_dynamics.numerics.progress import set_progress_callback

    set_progress_callback(lambda text: None)
    kernel.precompile(f"diag_dynamics.{unit}")


def _stamp_file():
    return cache_folder() / (STAMP_PREFIX + sys.implementation.cache_tag)


def _stamp():
    """Return a text that changes with machine, units, sources and files of compiled code."""
    modules = [f"diag_dynamics.{unit}" for unit in UNITS]
    folders = {code_folder(module) for module in modules} - {None}
    files = sorted(path.name for folder in folders for path in folder.rglob("*.nb?"))
    return "\n".join([platform.node(), *UNITS, *map(source_hash, modules), *files])
