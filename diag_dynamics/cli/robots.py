# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics robots`: names of the example robots."""

from diag_dynamics.exceptions import InputError
from diag_dynamics.model.catalog import example_urdfs

EPILOG = "Robots of the package example-robot-data, by the names that load_robot and all commands accept."


def add_arguments(parser):
    """Declare no arguments."""


def run(chosen):
    """Print the names; return the exit status."""
    urdfs = example_urdfs()
    if not urdfs:
        raise InputError("The package example-robot-data is not installed: pip install example-robot-data")
    print("\n".join(urdfs))
    return 0
