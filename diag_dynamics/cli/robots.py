# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""`diag-dynamics robots`: names of the example robots."""

from diag_dynamics.description.catalog import example_urdfs

EPILOG = (
    "load_robot and all commands accept these names. "
    "The robots of the package example-robot-data are listed if it is installed."
)


def add_arguments(parser):
    """Declare no arguments."""


def run(chosen):
    """Print the names; return the exit status."""
    print("\n".join(example_urdfs()))
    return 0
