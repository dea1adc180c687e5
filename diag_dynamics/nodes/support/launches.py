# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the launch files start: their arguments, and what each node is given by these. ``launching`` has `launch` do it."""

import os
from typing import NamedTuple

from diag_dynamics.nodes.support.names import NODES, nearest

MIMIC = {"mimic": (str, "mimic joints: coupled to their leaders (embed), independent (free) or locked (lock)")}
TIME = {"use_sim_time": (bool, "take time from clock_topic; not for a simulator that publishes it")}

ARGUMENTS = {
    "simulator": {
        "robot_description": (str, "URDF of the robot, or its path"),
        **MIMIC,
        "motion": (str, "as commands and wrenches move it (free), or each joint along a sine wave (wave)"),
        "without_command": (str, "drives without a command: no effort (zero) or brake"),
        "command_timeout": (float, "how long one holds [s]; 0: for ever"),
        "compensates_gravity": (bool, "drives add what carries the robot to the efforts they are sent"),
        "publish_clock": (bool, "simulated time goes out on clock_topic"),
        **TIME,
    },
    "controller": {
        # Without a default, as the parameter: who launches has to know.
        "robot_compensates_gravity": (
            bool,
            "whether the robot adds what carries its weight to the efforts it is sent; required",
        ),
        "autostart": (bool, "configure and activate at once"),
        "controlled_link": (str, "link whose pose is regulated"),
        "check_time": (float, "how long the effort controller may take to say its joints [s]; 0: it is not asked"),
        **MIMIC,
        **TIME,
    },
    "monitor": MIMIC | TIME,
    "view": TIME,
}
"""Parameters of each node that are arguments of a launch, with their types and descriptions."""

ALIASES = {"urdf": ("robot_description", "robot_description, where that is not given")}
"""Arguments that are another name, the first one, for a parameter; they count where that one is not given."""


class Launch(NamedTuple):
    """What a launch file starts.

    Attributes
    ----------
    given : dict
        For each node the parameters that it is given whatever the user says, as texts: ``$name`` is that argument's.
    defaults : dict
        Arguments whose defaults are others than nothing, with a description; they count whatever params_file says.
    clock : str
        Default of the topic of simulated time. Not a global one where the simulator is part of the launch: two robots in two
        namespaces have two times.
    optional : dict
        As `given`, of nodes that are started where the argument of their name says so.
    """

    given: dict
    defaults: dict = {}  # noqa: RUF012
    clock: str = "clock"
    optional: dict = {}  # noqa: RUF012


VIEW, YES = {"view": {}}, ("true", "1")

OPTIONAL = {"view": "whether to serve the page that shows the robot, true or false"}
"""Arguments of nodes that need not be started, with their descriptions; none is, unless told to."""

LAUNCHES = {
    "monitor": Launch({"monitor": {}}, clock="/clock", optional=VIEW),
    "controller": Launch({"controller": {}}, clock="/clock"),
    "simulator": Launch({"simulator": {}}),
    # A robot that nothing drives falls, until it is faster than the monitor believes.
    "demo": Launch(
        {"simulator": {}, "monitor": {}},
        {"motion": ("wave", "each joint along a sine wave (wave), or as commands and wrenches move it (free)")},
        optional=VIEW,
    ),
    "control": Launch(
        # The simulator lets time go where the machine is busy. All go by its own clock, which stands still then: by the
        # machine's, states would be too old at once.
        {
            "simulator": {
                "motion": "free",
                "publish_clock": "true",
                "use_sim_time": "false",
                "compensates_gravity": "$robot_compensates_gravity",
            },
            "controller": {"use_sim_time": "true"},
            "monitor": {"use_sim_time": "true"},
        },
        # Brakes hold the robot until the controller's first command, and after its last one.
        {
            "robot_compensates_gravity": (
                "false",
                "whether the simulator adds gravity itself, and the controller leaves it out",
            ),
            "autostart": ("true", "of the controller"),
            "check_time": (
                "0.0",
                "how long the controller asks who takes its commands for its joints: the simulator does not say [s]",
            ),
            "without_command": ("brake", "drives without a command: no effort (zero) or brake"),
            "command_timeout": ("0.5", "how long one holds [s]; 0: for ever"),
        },
        optional={"view": {"use_sim_time": "true"}},
    ),
}
"""By the name of the launch file."""


class Started(NamedTuple):
    """One node as a launch starts it; its own files of parameters come first, then `parameters`: kind and text of each."""

    executable: str
    name: str
    namespace: str
    params_file: str
    parameters: dict
    remappings: dict


def arguments_of(launch):
    """All arguments of a launch that have an effect: default and description by name."""
    arguments = {
        "namespace": ("", "namespace of the robot"),
        "params_file": ("", "parameters (YAML); empty: those in config/"),
        "clock_topic": (launch.clock, "topic of simulated time; without a / at its beginning, in the namespace"),
    }
    free = {}
    for node, given in launch.given.items():
        free |= {name: text for name, (_, text) in ARGUMENTS[node].items() if name not in given}
    free |= {alias: text for alias, (name, text) in ALIASES.items() if name in free}
    arguments |= {name: ("", f"{text}; empty: as in params_file") for name, text in free.items()}
    arguments |= {node: ("false", OPTIONAL[node]) for node in launch.optional}
    return arguments | launch.defaults


def started(launch, values):
    """The nodes of a launch for the values of all its arguments, which are texts, empty where nothing is said.

    Returns
    -------
    list of Started
        In their order.
    """
    values = dict(values)
    for alias, (name, _) in ALIASES.items():
        values[name] = values.get(name) or values.get(alias, "")
    nodes = []
    asked = {node: given for node, given in launch.optional.items() if values.get(node, "").lower() in YES}
    for executable, given in {**launch.given, **asked}.items():
        texts = {name: values.get(name, "") for name in ARGUMENTS[executable]}
        texts |= {name: values[text[1:]] if text.startswith("$") else text for name, text in given.items()}
        parameters = {name: (ARGUMENTS[executable][name][0], text) for name, text in texts.items() if text}
        nodes.append(
            Started(
                executable,
                NODES[executable],
                values["namespace"],
                os.path.expanduser(values["params_file"]),
                parameters,
                {"/clock": values["clock_topic"] or launch.clock},
            )
        )
    return nodes


def misspelt(launch, typed):
    """What to say of arguments, texts by name, that somebody has given, but that the launch does not know: a list of str.

    A launch that is part of another one sees that one's arguments, too: only what is nearly one of its own is told of.
    """
    known, said = arguments_of(launch), []
    for name in sorted(set(typed) - set(known)):
        fixed = [given[name] for given in launch.given.values() if name in given]
        if fixed:
            if typed[name].lower() not in fixed:
                said.append(f"argument '{name}' has no effect: this launch says itself what it is.")
        elif meant := nearest(name, known):
            said.append(f"argument '{name}' is not known, and has no effect: is '{meant}' meant?")
    return said
