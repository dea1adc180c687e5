# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The command line: commands by name. Only the module of the chosen command is imported."""

import os
import sys
import warnings
from difflib import get_close_matches
from importlib import import_module, util

import diag_dynamics
from diag_dynamics.cli.common import run_command
from diag_dynamics.text import shortened

PROGRAM = "diag-dynamics"

LIBRARY = {
    "compile": "compile all kernels in advance",
    "analyse": "energies, power balance, external torque and quality of a recording",
    "identify": "friction, rotor inertias, payloads and inertias from recordings",
    "excite": "a trajectory that moves a robot for identify",
    "calibrate": "alarm thresholds from recordings without contact",
    "inspect": "facts about a robot, and checks of its URDF",
    "robots": "names of the example robots",
}
"""Commands that need no ROS 2; each has a module of its name in diag_dynamics.cli."""

NODES = {
    "monitor": "dynamics of the robot that publishes joint_states",
    "simulator": "a simulated robot",
    "controller": "joint-space and Cartesian control in (ν, ε)",
    "view": "browser page of all monitored robots",
    "top": "terminal view: joints by energy or torque, with peaks",
    "demo": "simulator, monitor, page and top of one robot",
}

GROUPS = {
    "library": LIBRARY,
    "nodes (require ROS 2)": NODES,
}

COMMANDS = LIBRARY | NODES

OWN_MAIN = "demo", "top"
"""Executables that have options of their own."""


def main(arguments=None):
    """Run the command that the arguments begin with; return the exit status."""
    show = warnings.showwarning
    warnings.showwarning = _show_warning
    try:
        status = _run(sys.argv[1:] if arguments is None else arguments)
        sys.stdout.flush()
    except BrokenPipeError:  # `… | head`: output that is left would fail again at the end of Python
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    finally:
        warnings.showwarning = show
    return status


def _run(arguments):
    name, *rest = arguments or ["--help"]
    if name in ("-h", "--help", "help"):
        print(usage())
        return 0
    if name == "--version":
        print(f"diag_dynamics {diag_dynamics.__version__}")
        return 0
    name = name.replace("_", "-")
    if name in LIBRARY:
        module = import_module(f"diag_dynamics.cli.{name}")
        return run_command(name, LIBRARY[name], module, rest)
    if name in COMMANDS:
        return run_with_ros(name, rest)
    near = get_close_matches(name, COMMANDS, n=1)
    hint = f"Is '{near[0]}' meant?" if near else f"{PROGRAM} --help lists all commands."
    print(f"{PROGRAM}: there is no command '{shortened(arguments[0])}'. {hint}", file=sys.stderr)
    return 2


def usage():
    """Return the text of `--help`."""
    width = max(map(len, COMMANDS)) + 1
    lines = [f"usage: {PROGRAM} COMMAND [--help] …", "", diag_dynamics.__doc__.splitlines()[0]]
    for title, commands in GROUPS.items():
        lines += [
            "",
            f"{title}:",
            *(f"  {name:{width}}{about}" for name, about in commands.items()),
        ]
    return "\n".join(lines)


def _show_warning(message, category, *where):
    """Print a warning about a robot's file in one line; others as Python does."""
    if category.__module__ == "diag_dynamics.exceptions":
        print(f"{PROGRAM}: warning: {message}", file=sys.stderr)
    else:
        print(warnings.formatwarning(message, category, *where[:2]), end="", file=sys.stderr)


# --- Commands that need ROS 2


def missing():
    """Return why no command of ROS 2 can run, or None."""
    if util.find_spec("rclpy") is None:
        return (
            "requires ROS 2, but Python finds no rclpy. In a checkout: make setup, "
            "then source scripts/env.bash. "
            "In a workspace: source install/setup.bash."
        )
    if util.find_spec("diag_dynamics.msg") is None:
        return (
            "requires the messages of diag_dynamics. Build them by make setup or colcon build; "
            "then source "
            "scripts/env.bash or install/setup.bash."
        )
    return None


def run_with_ros(name, arguments):
    """Run an executable as `ros2 run` does; return the exit status."""
    if reason := missing():
        print(f"diag-dynamics {name} {reason}", file=sys.stderr)
        return 1
    sys.argv = [f"diag-dynamics {name}", *arguments]
    if name in OWN_MAIN:
        return import_module(f"diag_dynamics.nodes.{name}").main()
    import_module("diag_dynamics.nodes.support.runner").main(name)
    return 0
