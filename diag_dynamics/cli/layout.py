# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics layout`: a layout of a viewer for one robot, with its joints' names."""

import re
from pathlib import Path

from diag_dynamics.cli import common
from diag_dynamics.exceptions import InputError
from diag_dynamics.layouts import foxglove, plotjuggler

EPILOG = """Name the parameters of the monitor: mimic, locked_joints and floating_base change the order of joints. The
layouts follow the sources of the viewers, and have not been tried with the viewers themselves."""

OUTPUTS = {"-o": "output"}

TOOLS = {"foxglove": foxglove, "plotjuggler": plotjuggler}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_robot(parser)
    parser.add_argument("--tool", required=True, choices=TOOLS, help="the viewer")
    text = "name of the monitor on the graph (default: /diag_dynamics)"
    parser.add_argument("--monitor", default="/diag_dynamics", help=text)
    common.add_parameters(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="the file (default: stdout)")


def run(chosen):
    """Write a layout; return the exit status."""
    if not re.fullmatch(r"(/\w+)+", chosen.monitor):
        raise InputError(f"--monitor is '{chosen.monitor}'; expected a whole name such as /arm/diag_dynamics.")
    text = TOOLS[chosen.tool](common.chosen_model(chosen), chosen.monitor)
    if chosen.output in (None, "-"):
        print(text, end="")
    else:
        Path(chosen.output).expanduser().write_text(text, encoding="utf-8")
        common.report_written(chosen.output)
    return common.DONE
