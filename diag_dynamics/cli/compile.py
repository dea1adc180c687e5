# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics compile`: everything compiled ahead, in several processes."""

import argparse
import multiprocessing
import os
import signal
import sys
import threading
import time
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import contextmanager
from importlib import util

from diag_dynamics.batch import cores
from diag_dynamics.cli.mark import is_marked, set_mark
from diag_dynamics.compiled.cache import cache_folder

UNITS = {
    "simulation.steps": 14,
    "sweeps.many": 12,
    "sweeps.each": 7,
    "sweeps.derivatives": 6,
    "joint_states.rules": 6,
    "sweeps.evaluation": 5,
    "sweeps.factorization": 5,
    "sweeps.factors": 3,
    "sweeps.contacts": 3,
    "sweeps.mobilities": 3,
    "sweeps.classical": 3,
    "sweeps.kinematics": 2,
    "sweeps.motions": 1,
    "identification.kernels.regressors": 1,
    "sweeps.residuals": 1,
}
"""Modules with entry kernels, in CPU-seconds, the longest first: one that is begun last keeps the others waiting."""

ROS = "nodes."
"""Begins the names of those that need a ROS 2."""


def run(name, arguments):
    """Compile what is not in the cache yet; returns the exit status."""
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}", description=__doc__)
    parser.add_argument("--jobs", type=int, default=cores(), help="processes (default: as many as there are cores)")
    parser.add_argument(
        "--if-needed", action="store_true", help="nothing where this command has compiled all, and no code has changed"
    )
    parser.add_argument("--quiet", action="store_true", help="say nothing but errors")
    chosen = parser.parse_args(arguments)
    if chosen.jobs < 1:
        parser.error(f"argument --jobs: {chosen.jobs} is not at least 1")
    if cache_folder() is None:
        print(
            f"diag-dynamics {name}: there is no folder to keep compiled code in, so nothing is done.", file=sys.stderr
        )
        return 1
    units = [unit for unit in UNITS if not unit.startswith(ROS) or util.find_spec("rclpy")]
    if chosen.if_needed and is_marked(units):
        return 0
    begun = time.perf_counter()
    with _Progress(sum(UNITS[unit] for unit in units), chosen.quiet) as advance:
        failed = _compile(units, min(chosen.jobs, len(units)), advance)
    if failed:
        print(f"diag-dynamics {name}: {failed}", file=sys.stderr)
        return 1
    set_mark(units)
    if not chosen.quiet:
        print(f"Compiled, or found compiled, in {time.perf_counter() - begun:.0f} s.", file=sys.stderr)
    return 0


def _compile(units, jobs, advance):
    """Compile units in processes, each done one told of; returns what went wrong, or None. A Ctrl-C ends them all."""
    context = multiprocessing.get_context("spawn")  # a fork would share the compiler's locks
    pool = ProcessPoolExecutor(jobs, mp_context=context, initializer=_serve)
    try:
        with _deaf():
            running = {pool.submit(compiled, unit): unit for unit in units}
        for one in as_completed(running):
            if error := one.exception():
                return f"{running[one]}: {type(error).__name__}: {error}"
            advance(running[one])
    except BaseException:
        for worker in multiprocessing.active_children():
            worker.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
    return None


@contextmanager
def _deaf():
    """Context in which a Ctrl-C is ignored, as it is for good in processes that are begun meanwhile."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _serve():
    """Begin as a process that compiles: a Ctrl-C is the first process's matter, and this one ends with it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_after, args=(multiprocessing.parent_process(),), daemon=True).start()


def _end_after(parent):
    parent.join()
    os.kill(os.getpid(), signal.SIGTERM)


def compiled(unit):
    """Compile a unit, in a process of its own; compiling is told of by this command alone."""
    from diag_dynamics.compiled.ahead import compile_ahead
    from diag_dynamics.compiled.progress import tell_by

    tell_by(lambda text: None)
    compile_ahead(f"diag_dynamics.{unit}")


class _Progress:
    """Context that gives a function to be told of each unit that is done; a bar where a terminal shows one, else lines."""

    def __init__(self, total, quiet):
        self._total, self._done, self._bar = total, 0, None
        if not quiet and sys.stderr.isatty() and util.find_spec("rich"):
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeElapsedColumn

            last = TextColumn("{task.fields[last]}")
            columns = TextColumn("Compiling"), BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), last
            self._bar = Progress(*columns, console=Console(stderr=True))
        self._tell = not quiet and self._bar is None

    def __enter__(self):
        if self._bar:
            self._bar.start()
            self._task = self._bar.add_task("", total=self._total, last="half a minute as a rule")
        elif self._tell:
            print(
                "Compiling for this machine and Python: half a minute as a rule, and kept.", file=sys.stderr, flush=True
            )
        return self._advance

    def _advance(self, unit):
        self._done += UNITS[unit]
        if self._bar:
            self._bar.update(self._task, completed=self._done, last=unit)
        elif self._tell:
            print(f"  {100 * self._done // self._total:3} %  {unit}", file=sys.stderr, flush=True)

    def __exit__(self, *_):
        if self._bar:
            self._bar.stop()
