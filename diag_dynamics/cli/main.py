# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""All commands by name, and the way to each: nothing else is imported before it is known which one is wanted."""

import os
import sys
import warnings
from difflib import get_close_matches
from importlib import import_module
from typing import NamedTuple

import diag_dynamics

PROGRAM = "diag-dynamics"

INTERRUPTED = 130
"""Status at a Ctrl-C, as shells have it."""


class Command(NamedTuple):
    """One command: what it is, and the function that runs it, called with its name and its arguments."""

    about: str
    run: str


def _node(about):
    return Command(about, "diag_dynamics.cli.ros:run_executable")


def _tool(about):
    return Command(about, "diag_dynamics.cli.ros:run_tool")


GROUPS = {
    "library": {
        "compile": Command(
            "compile everything ahead: nothing waits for the compiler later", "diag_dynamics.cli.compile:run"
        ),
        "analyse": Command(
            "a recording: energies, balance of power, external torque, quality", "diag_dynamics.cli.analyse:run"
        ),
        "identify": Command(
            "friction, rotor inertias, payloads and inertias from recordings", "diag_dynamics.cli.identify:run"
        ),
        "excite": Command("a trajectory that moves a robot for identify", "diag_dynamics.cli.excite:run"),
        "calibrate": Command(
            "thresholds of alarms, from recordings without contact", "diag_dynamics.cli.calibrate:run"
        ),
        "demo-identify": Command(
            "from a wrong model to alarms that work, on simulated robots", "diag_dynamics.cli.demo_identify:run"
        ),
        "inspect": Command("facts about a robot, and checks of its URDF", "diag_dynamics.cli.inspect:run"),
        "layout": Command(
            "a layout of RViz, Foxglove, Lichtblick or PlotJuggler for a robot", "diag_dynamics.cli.layout:run"
        ),
        "robots": Command("names of the example robots", "diag_dynamics.cli.robots:run"),
    },
    "nodes, with a ROS 2": {
        "monitor": _node("the dynamics of the robot on the graph"),
        "simulator": _node("a robot to try things on"),
        "controller": _node("moves a robot by laws in (ν, ε)"),
        "view": _node("a page in the browser that shows robots live"),
        "top": _node("robots in this terminal: joints by energy or torque, with peaks"),
        "energy-view": _node("a running monitor's kinetic energy in this terminal"),
        "demo": _node("simulator, monitor and view of one robot"),
        "demo-control": _node("a push on an arm under control"),
    },
    "the graph, with a ROS 2 (as ros2cli, which PyPI has not)": {
        "node": _tool("list nodes"),
        "topic": _tool("list, info, echo, hz, pub"),
        "service": _tool("list, type, call"),
        "param": _tool("list, get, set"),
        "lifecycle": _tool("nodes, list, get, set"),
        "launch": _tool("the launch files of this package"),
    },
}

COMMANDS = {name: command for group in GROUPS.values() for name, command in group.items()}


def main(arguments=None):
    """Run the command that the arguments begin with; returns the exit status."""
    shows, warnings.showwarning = warnings.showwarning, _show_warning
    try:
        status = _run(arguments)
        sys.stdout.flush()
    except KeyboardInterrupt as error:
        return getattr(error, "status", INTERRUPTED)
    except BrokenPipeError:  # `… | head`: what is left would fail again when Python ends
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    finally:
        warnings.showwarning = shows
    return status


def _show_warning(message, category, *where):
    """Print a warning about a robot's file in one line; others as Python does."""
    if category.__module__ == "diag_dynamics.exceptions":
        print(f"{PROGRAM}: warning: {message}", file=sys.stderr)
    else:
        print(warnings.formatwarning(message, category, *where[:2]), end="", file=sys.stderr)


def _run(arguments):
    name, *rest = (sys.argv[1:] if arguments is None else arguments) or ["--help"]
    if name in ("-h", "--help", "help"):
        print(usage())
        return 0
    if name == "--version":
        print(f"diag_dynamics {diag_dynamics.__version__}")
        return 0
    command = COMMANDS.get(name.replace("_", "-"))
    if command is None:
        near = get_close_matches(name, COMMANDS, n=1)
        meant = f"Is '{near[0]}' meant?" if near else f"{PROGRAM} --help lists all."
        print(f"{PROGRAM}: there is no command '{name}'. {meant}", file=sys.stderr)
        return 2
    module, function = command.run.split(":")
    return getattr(import_module(module), function)(name.replace("_", "-"), rest)


def usage():
    """What `--help` says."""
    lines = [
        f"usage: {PROGRAM} COMMAND [--help] …",
        "",
        "Diagonalized dynamics of any robot (Jain and Rodriguez, 1995).",
    ]
    width = max(map(len, COMMANDS)) + 1
    for title, commands in GROUPS.items():
        lines += ["", f"{title}:", *(f"  {name:{width}}{command.about}" for name, command in commands.items())]
    return "\n".join(lines)
