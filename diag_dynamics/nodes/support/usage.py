# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What `--help` of a node says: its topics, its services and its parameters; and which of these are options."""

import argparse
from textwrap import fill

from diag_dynamics.nodes.support.interfaces import INTERFACES, TITLES
from diag_dynamics.yaml_files import as_yaml


def parser_of(executable, description, specs, required=None):
    """Parser of what is no ROS argument: there is none but --help.

    Parameters
    ----------
    executable : str
    description : str
        What the node is.
    specs : dict
        Its table of parameters.
    required : dict, optional
        Description of parameters without default, by name.

    Returns
    -------
    argparse.ArgumentParser
    """
    lines = [*_interfaces(executable), "", "parameters, each with its default:"]
    for name, text in (required or {}).items():
        lines += [f"  {name}", _indented(f"Required: {text}.")]
    for name, spec in specs.items():
        lines += [f"  {name}: {as_yaml(spec.default)}", _indented(spec.description)]
    return argparse.ArgumentParser(
        prog=executable,
        usage=f"{executable} [--help] [--PARAMETER VALUE] [--namespace NAME] [--name NAME] [--params-file FILE] "
        "[--remap FROM:=TO] [--log-level LEVEL] ... [--ros-args ...]",
        description=f"{description}\n\nEvery parameter is an option, too: --rate 500, or --ros-args -p rate:=500.0.",
        epilog="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


def defaults_of(specs):
    """Default of each parameter that is an option; use_sim_time, which every node of ROS has, among them."""
    return {"use_sim_time": False, **{name: spec.default for name, spec in specs.items()}}


def _interfaces(executable):
    """Lines that list a node's topics and services."""
    for kind, title in TITLES.items():
        names = [
            f"{one.name} (with {one.condition})" if one.condition else one.name
            for one in INTERFACES[executable]
            if one.kind == kind
        ]
        yield fill(", ".join(names), 110, initial_indent=f"{title:13}", subsequent_indent=" " * 13)


def _indented(text):
    return fill(text, 100, initial_indent=" " * 6, subsequent_indent=" " * 6)
