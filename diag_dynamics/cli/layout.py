# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics layout`: a layout of a viewer for one robot, with its joints' names."""

import shlex
import sys
from pathlib import Path

from diag_dynamics.cli import common
from diag_dynamics.layouts.tools import TOOLS, layout
from diag_dynamics.text import plain

EPILOG = """Give the parameters that the monitor is given: mimic, locked_joints and floating_base say which joints there are,
and entries of arrays go by their order."""


OUTPUTS = {"-o": "output"}


def add_arguments(parser):
    """Declare the arguments."""
    common.add_robot(parser)
    parser.add_argument("--tool", required=True, choices=TOOLS, help="the viewer")
    parser.add_argument(
        "--monitor", default="/diag_dynamics", help="name of the monitor on the graph (default: /diag_dynamics)"
    )
    common.add_parameters(parser)
    parser.add_argument("-o", "--output", metavar="FILE", help="where to write it (default: stdout)")


def run(chosen):
    """Write a layout; return the exit status."""
    text = layout(chosen.tool, common.chosen_model(chosen), chosen.monitor)
    tool = TOOLS[chosen.tool]
    if chosen.output in (None, "-"):
        print(text, end="")
    else:
        Path(chosen.output).expanduser().write_text(text, encoding="utf-8")
        print(
            plain(f"Wrote {chosen.output}: {tool.opened.replace('FILE', shlex.quote(chosen.output))}."), file=sys.stderr
        )
    print(
        f"It has not been tried with {tool.title} itself: it follows what {tool.title}'s source reads. That every topic, "
        "field and joint in it exists is tested.",
        file=sys.stderr,
    )
    return 0
