# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Parameters of the monitor without a node: from YAML files, and from a command line."""

import re
from collections import Counter
from collections.abc import Mapping
from dataclasses import fields
from fnmatch import fnmatch

from diag_dynamics.description.constraints import COUPLINGS
from diag_dynamics.entries import ALL
from diag_dynamics.exceptions import InputError
from diag_dynamics.model import Parameters
from diag_dynamics.parameters import controller, simulator, view
from diag_dynamics.parameters.monitor import PARAMETERS
from diag_dynamics.parameters.spec import nearest
from diag_dynamics.yaml_files import parsed_yaml, read_yaml

MONITOR = "diag_dynamics"
EXPONENT = re.compile(r"[-+]?\d+(\.\d*)?[eE][-+]?\d+")  # of a number
"""Name of the node, whose sections of a file count."""

OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters of every node, or how their names start.

They have no effect on what is computed of a state.
"""

OF_OTHERS = {
    *controller.PARAMETERS,
    controller.COMPENSATES,
    *simulator.PARAMETERS,
    *view.PARAMETERS,
} - {*PARAMETERS}
"""Parameters of this package's other nodes.

They may share a section (``/**``) with the monitor.
"""


def parameters_of(files=(), assignments=()):
    """Return values by parameter of the monitor, of files in their order, and then of assignments.

    Parameters
    ----------
    files : sequence of str or Path
        As of ROS 2: ``/**: {ros__parameters: {…}}``. Sections of other nodes are ignored. A file of
        the robot's own parameters (:class:`Parameters`) is the value of `parameters_file`, one of
        its loops that of `loops_file`.
    assignments : sequence of str
        Each ``parameter=value`` with the value in YAML, or a text that begins with ``*``, as
        ``effort_scale=*=0.5``. Commas separate entries of a list, ``locked_joints=a=0,b=0``;
        another assignment of the list adds entries.

    Raises
    ------
    InputError
        It has the file, the parameter, and the expectation.
    """
    values = {}
    for path in files:
        for name, value in _read_file(path).items():
            values |= _check(name, value, f"'{path}'")
    lists = {}
    for entry in assignments:
        name, equals, value = entry.partition("=")
        if not equals:
            raise InputError(f"'{entry}' has no '='; expected parameter=value.")
        value = value if value.startswith(ALL) else parsed_yaml(value, f"'{entry}'")
        parts = value.split(",") if isinstance(value, str) else []
        if len(parts) > 1 and all("=" in item for item in parts):
            value = [item.strip() for item in parts]
        for key, checked in _check(name, value, f"'{entry}'").items():
            if isinstance(checked, list) and all(isinstance(item, str) for item in checked):
                checked = lists[key] = [*lists.get(key, []), *checked]
            values[key] = checked
    return values


def _read_file(path):
    """Return the values in a file that a monitor would receive."""
    content = read_yaml(path, f"'{path}'")
    if not isinstance(content, Mapping):
        raise InputError(
            f"'{path}' is not a parameter file; expected /**: {{ros__parameters: {{…}}}}."
        )
    if content and set(content) <= {field.name for field in fields(Parameters)}:
        return {"parameters_file": str(path)}
    if content and set(content) <= set(COUPLINGS):
        return {"loops_file": str(path)}
    values = {}
    for node, section in content.items():
        if not isinstance(section, Mapping) or not isinstance(
            section.get("ros__parameters"), Mapping
        ):
            raise InputError(f"'{path}': section '{node}' has no ros__parameters; expected them.")
        node_name = str(node).split("/")[-1]
        if fnmatch(MONITOR, node_name):
            ignored = OF_OTHERS if node_name != MONITOR else ()
            entries = [*_flatten(section["ros__parameters"])]
            for name, count in Counter(name for name, _ in entries).items():
                if count > 1:
                    raise InputError(f"'{path}': '{name}' is there {count} times; expected once.")
            values |= {name: value for name, value in entries if name not in ignored}
    return values


def _flatten(section, prefix=""):
    """Yield full names and values of nested groups."""
    for name, value in section.items():
        if isinstance(value, Mapping):
            yield from _flatten(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def _as_float(value):
    """Return a whole number or a text such as 1e6 as float.

    YAML 1.1 reads 1e6 as text. Other values stay as they are.
    """
    is_number = type(value) is int or (isinstance(value, str) and EXPONENT.fullmatch(value))
    return float(value) if is_number else value


def _check(name, value, source):
    """Return the value by name, with the type of the parameter.

    The result is empty for a parameter of rclpy.
    """
    if name.startswith(OF_RCLPY):
        return {}
    if name not in PARAMETERS:
        meant = nearest(name, PARAMETERS)
        question = f" Is {meant!r} meant?" if meant else ""
        raise InputError(f"{source}: the monitor has no parameter '{name}'.{question}")
    default = PARAMETERS[name].default
    is_list = isinstance(default, list)
    kind = type(default[0] if is_list else default)
    entries = value if is_list and isinstance(value, list) else [value]
    entries = [_as_float(entry) if kind is float else entry for entry in entries]
    for entry in entries:
        if type(entry) is not kind:
            raise InputError(
                f"{source}: parameter '{name}' has {entry!r}; expected {kind.__name__}."
            )
    if not is_list:
        return {name: entries[0]}
    return {name: entries or ([""] if kind is str else [])}
