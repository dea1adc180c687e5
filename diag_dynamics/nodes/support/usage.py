"""What `--help` of a node says: its topics, its services and its parameters."""

import argparse
from textwrap import fill

from diag_dynamics.nodes.support.interfaces import INTERFACES, TITLES
from diag_dynamics.parameters.spec import as_yaml


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
        usage=f"{executable} [--help] [--ros-args [-p NAME:=VALUE] [--params-file FILE] [-r FROM:=TO] ...]",
        description=description,
        epilog="\n".join(lines),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )


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
