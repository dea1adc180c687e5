# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a process that hangs is at is in the report of the failure."""

import subprocess
import sys

import pytest

from processes import ASKED, Process

pytestmark = [pytest.mark.full, pytest.mark.live]

HANGS = """
import signal, sys, threading

def a_function_that_hangs():
    signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    print("ready", flush=True)
    threading.Event().wait()

a_function_that_hangs()
"""

LAUNCHES = "import subprocess, sys; sys.exit(subprocess.call([sys.executable, '-c', sys.argv[1]]))"


@pytest.mark.parametrize("command", [["-c", HANGS], ["-c", LAUNCHES, HANGS]], ids=["itself", "what it has started"])
def test_stacks_of_what_does_not_end(command):
    with Process([sys.executable, *command]) as process:
        process.wait_for_text("ready")
        with pytest.raises(subprocess.TimeoutExpired):
            process.wait(0.1)
        _, _, known = process.tail(1).partition(ASKED)
        assert "in a_function_that_hangs" in known and "thread" in known


def test_stacks_of_what_does_not_say_what_is_waited_for():
    with Process([sys.executable, "-c", HANGS]) as process:
        with pytest.raises(AssertionError, match="in vain for the end"):
            process.wait_for(lambda _: False, "the end", timeout=0.1)
        assert "in a_function_that_hangs" in process.tail(1)
