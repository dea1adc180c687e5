# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor under another executor than it has by itself: ``python -m graph.monitor <executor> --ros-args …``."""

import sys

from diag_dynamics.nodes.support import runner
from graph.executors import EXECUTORS

if __name__ == "__main__":
    runner.Executor = EXECUTORS[sys.argv.pop(1)]
    runner.main("monitor")
