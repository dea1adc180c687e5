# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Launch files run without the packages `launch` and `launch_ros`, which PyPI lacks: stand-ins for
their actions.
"""

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
    """Stand for ParameterValue, which reads numbers and flags as YAML."""
    return {"true": True, "false": False}[value] if value_type is bool else value_type(value)


def declare(name, default_value, description):
    """Stand for DeclareLaunchArgument: an argument that is given, to this file or one that includes
    it, stays.
    """
    assert description.endswith("."), name
    return lambda context: context.launch_configurations.setdefault(name, default_value) and None


def include(path, launch_arguments):
    """Stand for IncludeLaunchDescription: its arguments hold for all actions after it, too."""

    def run(context):
        values = {
            name: value if isinstance(value, str) else value(context.launch_configurations)
            for name, value in launch_arguments
        }
        context.launch_configurations.update(values)
        return perform(path, context)

    return run


def perform(path, context):
    """Run the actions of a launch file in turn, and return the nodes that they start."""
    actions = runpy.run_path(path)["generate_launch_description"]()
    return [node for action in actions for node in action(context) or () if node]


def on_process_exit(target_action, on_exit):
    """Stand for OnProcessExit after a process without error; an error ends the launch."""
    assert "failed" in on_exit(SimpleNamespace(returncode=1), None).event.reason
    if action := on_exit(SimpleNamespace(returncode=0), None):
        action.starts_after = target_action
    target_action.has_handler = True
    return action


STAND_INS = {
    "launch": module("launch", LaunchDescription=list),
    "launch.actions": module(
        "launch.actions",
        DeclareLaunchArgument=declare,
        EmitEvent=SimpleNamespace,
        ExecuteProcess=SimpleNamespace,
        IncludeLaunchDescription=include,
        OpaqueFunction=lambda function: function,
        RegisterEventHandler=lambda handler, condition: None if condition is False else handler,
    ),
    "launch.conditions": module(
        "launch.conditions", IfCondition=lambda text: text.lower() == "true"
    ),
    "launch.event_handlers": module("launch.event_handlers", OnProcessExit=on_process_exit),
    "launch.events": module("launch.events", Shutdown=SimpleNamespace),
    "launch.launch_description_sources": module(
        "launch.launch_description_sources", PythonLaunchDescriptionSource=lambda path: path
    ),
    "launch.substitutions": module(
        "launch.substitutions",
        LaunchConfiguration=lambda name: lambda configurations: configurations[name],
    ),
    "launch_ros": module("launch_ros"),
    "launch_ros.actions": module("launch_ros.actions", Node=SimpleNamespace),
    "launch_ros.parameter_descriptions": module(
        "launch_ros.parameter_descriptions", ParameterValue=parameter_value
    ),
}


def actions_of(name, **arguments):
    """Return the nodes and processes that a launch file starts, in turn."""
    context = SimpleNamespace(launch_configurations=arguments.copy())
    with mock.patch.dict(sys.modules, STAND_INS):
        return perform(str(FOLDER / f"{name}.launch.py"), context)


def launched(name, **arguments):
    """Return the nodes that a launch file starts, by executable; `files` and `parameters` are
    apart.
    """
    nodes = actions_of(name, **arguments)
    for node in nodes:
        node.files = [parameter for parameter in node.parameters if isinstance(parameter, str)]
        node.parameters = {
            key: value
            for parameter in node.parameters
            if isinstance(parameter, dict)
            for key, value in parameter.items()
        }
    return {node.executable: node for node in nodes}
