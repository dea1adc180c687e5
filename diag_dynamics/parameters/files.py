# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the monitor without a monitor: from its YAML files, and from a command line."""

from collections.abc import Mapping
from dataclasses import fields
from difflib import get_close_matches
from fnmatch import fnmatch

from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Parameters
from diag_dynamics.parameters import controller, simulator, view
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.yaml_files import parsed_yaml, read_yaml

MONITOR = "diag_dynamics"
"""Name of the node, whose sections of a file count."""

QOS = "qos_overrides."
"""Begins the names of parameters that every publisher and subscription has: how it is connected."""

OF_ANY_NODE = {"use_sim_time", "start_type_description_service"}
"""Parameters that rclpy gives every node: of its clock and of a service, which a recording has not."""

OF_OTHERS = {*controller.PARAMETERS, controller.COMPENSATES, *simulator.PARAMETERS, *view.PARAMETERS} - {*PARAMETERS}
"""Parameters that only other nodes of this package have, which may share a section (``/**``) with the monitor."""


def parameters_of(files=(), assignments=()):
    """Values by parameter of the monitor, of files in their order, and then of assignments.

    Parameters
    ----------
    files : sequence of str or Path
        As ROS 2 has them: ``/**: {ros__parameters: {…}}``. Sections of other nodes count for nothing, nor do parameters of
        this package's other nodes in a section that they share. A file of the robot's own parameters (:class:`Parameters`)
        is the value of `parameters_file`.
    assignments : sequence of str
        Each ``parameter=value``, the value in YAML, but for a text that begins with ``*``, as ``effort_scale=*=0.5``: YAML
        would look for something of that name.

    What every ROS node has (``qos_overrides.…``, `use_sim_time`) is taken and has no effect: it says how a node is connected
    and what its clock is, and changes nothing that is computed of a state.

    Raises
    ------
    InputError
        It names the file, the parameter, and what was expected.
    """
    values = {}
    for path in files:
        for name, value in _of_file(path).items():
            values |= _checked(name, value, f"'{path}'")
    for entry in assignments:
        name, equals, value = entry.partition("=")
        if not equals:
            raise InputError(f"'{entry}' sets nothing, expected parameter=value.")
        given = value if value.startswith("*") else parsed_yaml(value, f"'{entry}'")
        values |= _checked(name, given, f"'{entry}'")
    return values


def _of_file(path):
    """Parameters in a file that the monitor would take."""
    content = read_yaml(path, f"'{path}'")
    if not isinstance(content, Mapping):
        raise InputError(f"'{path}' is no file of parameters, expected /**: {{ros__parameters: {{…}}}}.")
    if content and set(content) <= {field.name for field in fields(Parameters)}:
        return {"parameters_file": str(path)}
    found = {}
    for node, section in content.items():
        if not isinstance(section, Mapping) or not isinstance(section.get("ros__parameters"), Mapping):
            raise InputError(f"'{path}': section '{node}' has no ros__parameters.")
        own = str(node).split("/")[-1]
        if fnmatch(MONITOR, own):
            passed = OF_OTHERS if own != MONITOR else ()
            found |= {name: value for name, value in _flat(section["ros__parameters"], "") if name not in passed}
    return found


def _flat(section, prefix):
    """Parameters of nested groups, with their names in full."""
    for name, value in section.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _checked(name, value, source):
    """The value by its name, of the type of the parameter; nothing of what any node has."""
    if name in OF_ANY_NODE or name.startswith(QOS):
        return {}
    if name not in PARAMETERS:
        near = get_close_matches(name, PARAMETERS, n=1)
        raise InputError(f"{source}: the monitor has no parameter '{name}'.{f' Is {near[0]!r} meant?' if near else ''}")
    default = PARAMETERS[name].default
    if isinstance(default, list):
        kind = type(default[0])
        value = [kind(entry) if kind is float and type(entry) is int else entry for entry in _entries(value)]
        value = value or [""] if kind is str else value
        wrong = next((entry for entry in value if type(entry) is not kind), None)
    else:
        kind = type(default)
        value = float(value) if kind is float and type(value) is int else value
        wrong = None if type(value) is kind else value
    if wrong is not None:
        raise InputError(f"{source}: parameter '{name}' has {wrong!r}, expected {kind.__name__}.")
    return {name: value}


def _entries(value):
    return value if isinstance(value, list) else [value]
