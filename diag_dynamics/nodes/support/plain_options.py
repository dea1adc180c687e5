# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Plain options of a node (``--rate 500 --namespace /arm``) as ROS arguments (``-p rate:=500.0 -r __ns:=/arm``)."""

import json
import math

import yaml

from diag_dynamics.exceptions import InputError
from diag_dynamics.nodes.support.names import nearest
from diag_dynamics.yaml_files import as_yaml

OWN = {"name": "__node", "namespace": "__ns"}
"""Options that are remappings of the node itself."""

PASSED = {"params-file": "--params-file", "log-level": "--log-level", "remap": "-r"}
"""Options that ROS has, too."""

AS_THEY_ARE = ("-h", "--help")


def as_ros_arguments(arguments, defaults):
    """Arguments with every plain option made one of ROS; what comes after ``--ros-args`` stays as it is.

    Parameters
    ----------
    arguments : list of str
        Without the name of the program.
    defaults : dict
        Default, or None, of each parameter by name.

    Raises
    ------
    InputError
        An option is not known, has no value, or one of the wrong type.
    """
    before, after = list(arguments), []
    if "--ros-args" in before:
        cut = before.index("--ros-args")
        before, after = before[:cut], before[cut:]
    kept, made = [], []
    while before:
        option = before.pop(0)
        if option in AS_THEY_ARE or not option.startswith("--"):
            kept.append(option)
            continue
        name, given, value = option[2:].partition("=")
        parameter = name.replace("-", "_")
        if name not in OWN | PASSED and parameter not in defaults:
            raise InputError(f"option {option.partition('=')[0]} is not known{_meant(name, defaults)}")
        if not given:
            if before and not before[0].startswith("--"):
                value = before.pop(0)
            elif isinstance(defaults.get(parameter), bool):
                value = "true"
            else:
                raise InputError(f"option {option} has no value.")
        if name in OWN:
            if name == "namespace":  # rcl takes it with a / only
                value = f"/{value.strip('/')}"
            made += ["-r", f"{OWN[name]}:={value}"]
        elif name in PASSED:
            made += [PASSED[name], value]
        else:
            made += ["-p", f"{parameter}:={_typed(option, value, defaults[parameter])}"]
    return [*kept, *(["--ros-args"] if made else []), *made, *(["--"] if made and after else []), *after]


def _typed(option, value, default):
    """A value as rcl parses it: with the type of the default. Without a default it goes as it is."""
    name = option.partition("=")[0]
    if isinstance(default, list):
        entries = value.strip().removeprefix("[").removesuffix("]").split(",")
        texts = [one for one in (entry.strip().strip("'\"") for entry in entries) if one]
        if isinstance(default[0], str):
            return _quoted(texts or [""])
        if isinstance(default[0], float):  # rcl takes no list of integers and doubles
            return as_yaml([_number(name, one, float) for one in texts])
    if isinstance(default, str):
        return _quoted(value)
    if isinstance(default, bool):
        return _switch(name, value)
    if isinstance(default, (int, float)):
        return as_yaml(_number(name, value, type(default)))
    return value


def _quoted(texts):
    return json.dumps(texts, ensure_ascii=False)


def _switch(name, value):
    try:
        found = yaml.safe_load(value)
    except yaml.YAMLError:
        found = None
    if not isinstance(found, bool):
        raise InputError(f"option {name} is {value!r}, expected true or false.")
    return as_yaml(found)


def _number(name, text, kind):
    """A number of a kind, float or int; YAML 1.1 would take 1e-3 for text."""
    try:
        number = kind(text)
    except ValueError:
        number = math.nan
    if not math.isfinite(number):
        expected = "a finite number" if kind is float else "a whole number"
        raise InputError(f"option {name} is {text!r}, expected {expected}.")
    return number


def _meant(name, defaults):
    options = [*OWN, *PASSED, *(parameter.replace("_", "-") for parameter in defaults)]
    near = nearest(name, options)
    return f"; is --{near} meant?" if near else ". --help lists all."
