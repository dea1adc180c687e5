# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch files run without the packages `launch` and `launch_ros`, which PyPI lacks: their actions keep their arguments."""

import runpy
import sys
from pathlib import Path
from types import ModuleType, SimpleNamespace
from unittest import mock

FOLDER = Path(__file__).resolve().parents[2] / "launch"
LAUNCH_FILES = sorted(path.name.removesuffix(".launch.py") for path in FOLDER.glob("*.launch.py"))


def module(name, **attributes):
    """Return a module with these attributes."""
    made = ModuleType(name)
    vars(made).update(attributes)
    return made


def parameter_value(value, value_type):
    """Stand for ParameterValue."""
    assert isinstance(value, value_type)
    return value


STAND_INS = {
    "launch": module("launch", LaunchDescription=list),
    "launch.actions": module(
        "launch.actions",
        DeclareLaunchArgument=lambda name, default_value: (name, default_value),
        OpaqueFunction=lambda function: function,
    ),
    "launch_ros": module("launch_ros"),
    "launch_ros.actions": module("launch_ros.actions", Node=SimpleNamespace),
    "launch_ros.parameter_descriptions": module("launch_ros.parameter_descriptions", ParameterValue=parameter_value),
}


def launched(name, **arguments):
    """Return the nodes that a launch file starts, by executable; `files` and `parameters` are apart."""
    with mock.patch.dict(sys.modules, STAND_INS):
        *declared, start = runpy.run_path(str(FOLDER / f"{name}.launch.py"))["generate_launch_description"]()
    assert set(arguments) <= {argument for argument, _ in declared}
    nodes = start(SimpleNamespace(launch_configurations=dict(declared) | arguments))
    for node in nodes:
        node.files = [one for one in node.parameters if isinstance(one, str)]
        node.parameters = {key: value for one in node.parameters if isinstance(one, dict) for key, value in one.items()}
    return {node.executable: node for node in nodes}
