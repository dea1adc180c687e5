# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics launch`: the launch files of this package without `launch`, which PyPI lacks."""

import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager, suppress
from queue import Empty, SimpleQueue

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.children import ends_with
from diag_dynamics.nodes.support.launches import LAUNCHES, arguments_of, misspelt, started
from diag_dynamics.nodes.support.start import KINDLY

LAST_WORDS = 1.0
"""Time [s] for what a node has said at last to be passed on."""

ENDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that end a launch: SIGHUP comes when the terminal is closed."""


def add_arguments(parser):
    """Declare the arguments: the launch, and its own as ``name:=value``."""
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.epilog = "\n".join(
        f"{name}:\n" + "\n".join(f"  {one:26}{text}" for one, (_, text) in arguments_of(launch).items())
        for name, launch in LAUNCHES.items()
    )
    parser.add_argument("launch", choices=sorted(LAUNCHES))
    parser.add_argument("values", nargs="*", metavar="name:=value", help="arguments of that launch")
    parser.set_defaults(run=run)


def command_of(node):
    """Command line that starts a node; what config/ has are the defaults of its parameters anyway."""
    command = [sys.executable, "-m", "diag_dynamics.nodes.support.start", node.executable, "--ros-args"]
    command += ["-r", f"__node:={node.name}"]
    command += ["-r", f"__ns:=/{node.namespace.lstrip('/')}"] if node.namespace else []
    command += ["--params-file", node.params_file] if node.params_file else []
    for name, (kind, text) in node.parameters.items():
        value = f"'{text.replace(chr(39), 2 * chr(39))}'" if kind is str else text
        command += ["-p", f"{name}:={value}"]
    for name, other in node.remappings.items():
        command += ["-r", f"{name}:={other}"]
    return command


def run(chosen):
    """Start the nodes of a launch, and end when all have ended, or all at a Ctrl-C.

    Raises
    ------
    InputError
        An argument makes no sense, or a node has ended by itself with another status than 0, or had to be killed.
    """
    launch = LAUNCHES[chosen.launch]
    typed = {}
    for text in chosen.values:
        name, given, value = text.partition(":=")
        if not given:
            raise InputError(f"argument '{text}' is not of the form name:=value.")
        typed[name] = value
    for text in misspelt(launch, typed):
        print(text, file=sys.stderr)
    values = {name: typed.get(name, default) for name, (default, _) in arguments_of(launch).items()}
    running, asked = {}, False
    with _signals() as signals:
        try:
            for node in started(launch, values):
                running[node.executable] = _process(command_of(node))
            # Threads come after all processes: a process that is forked from one with threads may hang before it is a node.
            readers = [
                threading.Thread(target=_pass_on, args=(name, process.stdout), daemon=True)
                for name, process in running.items()
            ]
            for reader in readers:
                reader.start()
            asked = _attend(running.values(), signals)
        finally:
            for process in running.values():
                process.kill()  # nothing where it has ended
    for reader in readers:
        reader.join(LAST_WORDS)
    fine = (0, -signal.SIGTERM) if asked else (0,)  # one that has not begun yet dies of the signal itself
    failed = [
        f"{name} has been killed" if one.returncode == -9 else f"{name} has ended with status {one.returncode}"
        for name, one in running.items()
        if one.returncode not in fine
    ]
    if failed:
        raise InputError(f"{'; '.join(failed)}.")


@contextmanager
def _signals():
    """Context in which signals, those of ended processes among them, break nothing off but go to a queue, which it gives."""
    queue, before = SimpleQueue(), {}
    for number in (*ENDS, signal.SIGCHLD):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # nohup
            before[number] = signal.signal(number, lambda number, _: queue.put(number))
    try:
        yield queue
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _process(command):
    """A process in a session of its own, where a terminal's signals do not reach it: it is told to end by us alone."""
    return subprocess.Popen(
        command,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        errors="replace",
        start_new_session=True,
        preexec_fn=ends_with(os.getpid()),
    )


def _attend(processes, signals):
    """Wait until all processes have ended. The first signal asks them to; a Ctrl-C after it, or :data:`KINDLY`, kills them.

    Others do not: a terminal that is closed may send its SIGHUP twice.

    Returns
    -------
    bool
        Whether they were asked.
    """
    deadline = None
    while left := [process for process in processes if process.poll() is None]:
        try:
            number = signals.get(timeout=None if deadline is None else max(0.0, deadline - time.monotonic()))
        except Empty:
            number = None
        if number in ENDS and deadline is None:
            deadline = time.monotonic() + KINDLY
            for process in left:
                process.send_signal(signal.SIGTERM)
        elif number in (None, signal.SIGINT):
            for process in left:
                process.kill()
                process.wait()
    return deadline is not None


def _pass_on(name, lines):
    """Say what a node says, and read on where nobody hears us any more: a full pipe would hold the node up."""
    for line in lines:
        with suppress(OSError, ValueError):
            print(f"[{name}] {line}", end="", flush=True)
