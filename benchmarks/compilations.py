# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Run the program that is the first argument; print its CPU time, and that of what it compiles, by function, as JSON."""

import json
import sys
import time

from numba.core import event


class Compilations(event.Listener):
    """CPU time of the compilation of each function, without that of functions that it calls."""

    def __init__(self):
        self.functions, self._open = {}, []

    def on_start(self, event):
        """Begin with a function."""
        self._open.append([time.process_time(), 0.0])

    def on_end(self, event):
        """Count a function, and its time as that of another one in its caller."""
        begin, inner = self._open.pop()
        seconds = time.process_time() - begin
        function = event.data["dispatcher"].py_func
        name = f"{function.__module__.removeprefix('diag_dynamics.')}.{function.__name__}"
        count, total = self.functions.get(name, (0, 0.0))
        self.functions[name] = count + 1, total + seconds - inner
        if self._open:
            self._open[-1][1] += seconds


if __name__ == "__main__":
    compilations = Compilations()
    event.register("numba:compile", compilations)
    exec(sys.argv[1])
    print(json.dumps([time.process_time(), compilations.functions]))
