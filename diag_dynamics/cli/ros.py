# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands that need ROS 2: nodes, `topic` and `service`."""

import argparse
import sys
from importlib import import_module, util

from diag_dynamics.cli.common import INTERRUPTED, terminable
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.text import plain

OWN_MAIN = {"demo": "demo", "top": "top.top"}
"""Module in diag_dynamics.nodes of each executable that has options of its own."""


def missing():
    """Return why no command of ROS 2 can run, or None."""
    if util.find_spec("rclpy") is None:
        return (
            "requires ROS 2, but Python finds no rclpy. In a checkout: make setup, then source scripts/env.bash. "
            "In a workspace: source install/setup.bash."
        )
    if util.find_spec("diag_dynamics.msg") is None:
        return (
            "requires the messages of diag_dynamics. Build them by make setup or colcon build; then source "
            "scripts/env.bash or install/setup.bash."
        )
    return None


def run(name, arguments):
    """Run a command that needs ROS 2; return the exit status."""
    if reason := missing():
        print(f"diag-dynamics {name} {reason}", file=sys.stderr)
        return 1
    return (_run_tool if name in ("topic", "service") else _run_executable)(name, arguments)


def _run_executable(name, arguments):
    """Run an executable as `ros2 run` does."""
    sys.argv = [f"diag-dynamics {name}", *arguments]
    executable = name.replace("-", "_")
    if module := OWN_MAIN.get(executable):
        return import_module(f"diag_dynamics.nodes.{module}").main()
    import_module("diag_dynamics.nodes.support.runner").main(executable)
    return 0


def _run_tool(name, arguments):
    """Run a command that reads topics or calls services."""
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}")
    commands = import_module("diag_dynamics.nodes.graph_commands")
    getattr(commands, f"add_{name}_arguments")(parser)
    chosen = parser.parse_args(arguments)
    try:
        with terminable():
            chosen.run(chosen)
    except KeyboardInterrupt as error:
        return getattr(error, "status", INTERRUPTED)
    except DiagDynamicsError as error:
        print(plain(f"diag-dynamics {name}: {error}"), file=sys.stderr)
        return 1
    return 0
