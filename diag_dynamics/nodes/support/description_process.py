# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Descriptions read in a process of their own, which ends with them or with the node.

The reader of URDFs brings 80 MB of libraries that a node does not need again, and a second during
which its callbacks would wait. What a hostile file does to the reader, it does not do to the node.
"""

import os
import pickle
import subprocess
import sys
import threading
import time
from contextlib import redirect_stdout

from diag_dynamics.description.catalog import describe
from diag_dynamics.description.check_table import handle_warnings, warn
from diag_dynamics.exceptions import DiagDynamicsError, UrdfError

PERIOD = 0.5
"""How often the process looks whether its parent has ended [s]."""


def described(source):
    """Return the description of a URDF; warnings and errors are those of :func:`describe`."""
    if "yourdfpy" in sys.modules:  # this process has the libraries already
        return describe(source)
    command = [sys.executable, "-m", __name__, str(os.getpid())]
    environment = os.environ | {"PYTHONSAFEPATH": "1"}  # no modules of the working directory
    process = subprocess.run(
        command, input=pickle.dumps(source), capture_output=True, env=environment
    )
    if process.returncode != 0:
        end = process.stderr.decode(errors="replace").strip().rpartition("\n")[2]
        text = f"the reader of the URDF ended with {process.returncode}; expected 0: {end}"
        raise UrdfError(f"{text} Try diag-dynamics inspect with the same file.")
    description, warnings, error = pickle.loads(process.stdout)
    for warning in warnings:
        warn(warning.args[0], type(warning))
    if error is not None:
        raise error
    return description


def answer(source):
    """Return the description of a source, the warnings about it, and None; or an error as third."""
    warnings = []
    with handle_warnings(warnings.append):
        try:
            return describe(source), warnings, None
        except DiagDynamicsError as error:
            return None, warnings, error


def end_with(parent):
    """End this process when its parent, by number, has ended; some files are read for minutes."""
    while os.getppid() == parent:
        time.sleep(PERIOD)
    os._exit(1)


if __name__ == "__main__":
    threading.Thread(target=end_with, args=[int(sys.argv[1])], daemon=True).start()
    with redirect_stdout(sys.stderr):  # what libraries print is no part of the reply
        reply = pickle.dumps(answer(pickle.load(sys.stdin.buffer)))
    sys.stdout.buffer.write(reply)
