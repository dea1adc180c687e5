# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Threads for sweeps over many states, which run without the interpreter's lock."""

import functools
import itertools
import os
from concurrent.futures import ThreadPoolExecutor, wait

import numpy as np

CHUNKS_PER_THREAD = 4
"""A delayed thread leaves its share to the others."""

MIN_CHUNK = 256
"""Smaller chunks are done before another thread has started."""

MAX_THREADS = 1024
"""Maximum of helper threads in a process; they start on demand and stay."""


def cores():
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class Workspaces:
    """Idle workspaces of one robot; creating one takes as long as some hundred states."""

    def __init__(self, model):
        self._model = model
        self._idle = []

    def acquire(self):
        """Return a workspace for the calling thread alone."""
        try:
            return self._idle.pop()
        except IndexError:
            return self._model.new_workspace()

    def release(self, workspace):
        """Return a workspace to the idle ones."""
        self._idle.append(workspace)


def run_chunks(workspaces, count, sweep, threads):
    """Sweep over chunks of `count` states in threads, of which the calling one is one.

    `sweep` takes a robot, the first state of a chunk and its end, and returns the end of the states
    that it has completed. Return the range of states that the first failing chunk has left; it is
    empty without a failure.
    """
    number = min(CHUNKS_PER_THREAD * threads, count // MIN_CHUNK) if threads > 1 else 1
    chunks = itertools.pairwise(np.linspace(0, count, max(1, number) + 1, dtype=int).tolist())
    failures = []
    helpers = []

    def work():
        # Chunks before a failing one are all in work.
        while not failures and (chunk := next(chunks, None)):
            first, last = chunk
            workspace = workspaces.acquire()
            end = sweep(workspace.robot, first, last)
            workspaces.release(workspace)
            if end < last:
                failures.append(range(end, last))

    try:
        for _ in range(min(threads, number) - 1):
            helpers.append(_executor().submit(work))
        work()
        for helper in helpers:
            if not helper.cancel():
                helper.result()
    finally:
        for _ in chunks:  # after an error no thread starts another chunk
            pass
        _wait_for(helpers)
    return min(failures, key=lambda states: states[0], default=range(0))


def _wait_for(helpers):
    """Wait for helpers, which write to the caller's memory, even if Ctrl-C interrupts it again."""
    try:
        if helpers:
            wait(helpers)
    finally:
        if not all(helper.done() for helper in helpers):
            _wait_for(helpers)


@functools.cache
def _executor():
    """Return the helper threads of this process, because starting one takes long."""
    return ThreadPoolExecutor(MAX_THREADS, thread_name_prefix="diag_dynamics")


if hasattr(os, "register_at_fork"):
    # Threads do not survive a fork. Without this line a child would wait for its parent's.
    os.register_at_fork(after_in_child=_executor.cache_clear)
