# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics robots`: names of the example robots."""

import sys

from diag_dynamics.model.example_robots import example_urdfs


def run(name, arguments):
    """Print them; returns the exit status."""
    if arguments and arguments[0] not in ("-h", "--help"):
        print(f"{name} takes no arguments.", file=sys.stderr)
        return 2
    if arguments:
        print(
            "usage: diag-dynamics robots\n\nNames of the robots of example-robot-data: of dd.load_robot and of --robot."
        )
        return 0
    urdfs = example_urdfs()
    if not urdfs:
        print("The package example-robot-data is not installed: pip install example-robot-data", file=sys.stderr)
        return 1
    print("\n".join(urdfs))
    return 0
