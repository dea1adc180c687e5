# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Commands that need a ROS 2: executables of nodes, and a look at the graph."""

import argparse
import sys
from importlib import import_module, util

from diag_dynamics.cli.common import INTERRUPTED, terminable
from diag_dynamics.exceptions import DiagDynamicsError
from diag_dynamics.text import plain

TOOLS = {
    "topic": ("graph_commands", "add_topic_arguments"),
    "service": ("graph_commands", "add_service_arguments"),
}
"""Module in diag_dynamics.nodes.tools, and its function that declares the arguments of each."""

OWN_MAIN = {
    "demo": "demo",
    "top": "top.top",
}
"""Module in diag_dynamics.nodes of each executable that has options of its own."""


def missing():
    """Why nothing of ROS 2 can run, or None."""
    if util.find_spec("rclpy") is None:
        return (
            "needs a ROS 2, and python finds no rclpy. In a checkout: make setup, then source scripts/env.bash. "
            "In a workspace: source install/setup.bash."
        )
    if util.find_spec("diag_dynamics.msg") is None:
        return (
            "needs the messages of diag_dynamics, which the ROS 2 build makes: make setup, or colcon build; then source "
            "scripts/env.bash or install/setup.bash."
        )
    return None


def run_executable(name, arguments):
    """Run an executable as `ros2 run` does; return the exit status."""
    if reason := missing():
        print(f"diag-dynamics {name} {reason}", file=sys.stderr)
        return 1
    sys.argv = [f"diag-dynamics {name}", *arguments]
    executable = name.replace("-", "_")
    if module := OWN_MAIN.get(executable):
        return import_module(f"diag_dynamics.nodes.{module}").main()
    import_module("diag_dynamics.nodes.support.runner").main(executable)
    return 0


def run_tool(name, arguments):
    """Run a command that looks at the graph; returns the exit status."""
    if reason := missing():
        print(f"diag-dynamics {name} {reason}", file=sys.stderr)
        return 1
    module, function = TOOLS[name]
    parser = argparse.ArgumentParser(prog=f"diag-dynamics {name}")
    getattr(import_module(f"diag_dynamics.nodes.tools.{module}"), function)(parser)
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
