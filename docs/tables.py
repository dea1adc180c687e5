# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Write what is generated from the code: docs/parameters.md, docs/interfaces.md and config/*.yaml.

``make docs-tables`` runs it. It needs the library, and no ROS. A test says when a file is stale.
"""

import re
import sys
from importlib import import_module
from itertools import groupby
from pathlib import Path
from textwrap import fill, wrap
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from diag_dynamics.control.modes import MODES  # noqa: E402
from diag_dynamics.entries import LARGEST  # noqa: E402
from diag_dynamics.nodes.support.names import NODES  # noqa: E402
from diag_dynamics.nodes.support.topics import TOPICS  # noqa: E402
from diag_dynamics.parameters.controller import COMPENSATES, WHY_REQUIRED  # noqa: E402

COMMAND = "make docs-tables"

CHANGES = {
    "monitor": "Values are judged together: a wrong one is refused with the reason, and changes nothing. `~/set_payload` "
    "changes `payloads` too. Why the bounds `absurd.*` are what they are: [robots.md](robots.md#plausibility-limits); how "
    "to choose `external_torque.*` and `alarm.*`: [alarms.md](alarms.md).",
    "simulator": "`gravity` and `payloads` may change while the robot moves.",
    "controller": "Parameters may change while the node is unconfigured. What the gains do: [control.md](control.md#laws).",
    "view": "What the page shows: [view.md](view.md).",
}
"""What a reader has to know beside a node's table."""


def parameters_of(node):
    """Specs of a node's parameters, by name."""
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


def as_yaml(value):
    """Value of a parameter as text of a parameter file."""
    if isinstance(value, list):
        return "[" + ", ".join(f'"{entry}"' if isinstance(entry, str) else as_yaml(entry) for entry in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and "e" in repr(value) and "." not in repr(value):
        return repr(value).replace("e", ".0e")  # YAML 1.1 takes 1e-06 for text
    if isinstance(value, str) and not re.fullmatch(r"[A-Za-z_]\w*", value):
        return f'"{value}"'
    return str(value)


# --- Markdown ---


def cell(text):
    """Text as it stands in a cell of a table."""
    return re.sub(r"([|*<])", r"\\\1", text)


def paragraph(text):
    """Text in lines that can be read."""
    return fill(text, 120, break_on_hyphens=False, break_long_words=False)


def table(head, rows):
    """Table of Markdown."""
    lines = [f"| {' | '.join(head)} |", "|" + "---|" * len(head)]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows])


def allowed(spec):
    """Values that a parameter takes: choices or bounds; empty where its type says all."""
    if spec.choices:
        return ", ".join(f"`{as_yaml(choice)}`" for choice in spec.choices)
    if isinstance(spec.default, list) and spec.maximum != LARGEST:
        return f"each within ±{spec.maximum:g}"
    if spec.minimum is None:
        return ""
    return f"≥ {spec.minimum:g}" if spec.maximum == LARGEST else f"{spec.minimum:g} to {spec.maximum:g}"


def changes(spec):
    """When another value is taken."""
    return "never" if spec.read_only else "unconfigured" if spec.while_unconfigured else "any time"


def parameters_page():
    """Text of docs/parameters.md."""
    parts = [
        f"# Parameters\n\n<!-- Written by `{COMMAND}` from diag_dynamics/parameters/: edit these files, not this page. -->",
        paragraph(
            "Each node has a file of its own with all defaults in [config/](../config): copy it, change what you need, and "
            "start with `--ros-args --params-file my.yaml`. An integer stands for a number, and `[]` for an empty list "
            'of entries, whose default is `[""]`. A node warns of a parameter whose name is nearly one of its own. *Changes* '
            "says when another value is accepted: at `any time`, while the node is `unconfigured`, or `never`."
        ),
        " · ".join(f"[{node}](#{node})" for node in NODES),
    ]
    for node, name in NODES.items():
        rows = [
            (f"`{parameter}`", f"`{as_yaml(spec.default)}`", allowed(spec), changes(spec), cell(spec.description))
            for parameter, spec in parameters_of(node).items()
        ]
        if node == "controller":
            why = WHY_REQUIRED[0].upper() + WHY_REQUIRED[1:]
            rows.insert(0, (f"`{COMPENSATES}`", "none: **required**", "", "unconfigured", cell(why) + "."))
        head = ("parameter", "default", "values", "changes", "meaning")
        parts += [f"## {node}", paragraph(f"Node `{name}`. {CHANGES[node]}"), table(head, rows)]
    return "\n\n".join(parts) + "\n"


# --- Interfaces ---

IN, OUT, SERVICE = "in", "out", "service"
"""Kinds of interfaces: a topic the node subscribes to, a topic it publishes, a service it offers."""

TITLES = {IN: "listens to", OUT: "publishes", SERVICE: "services"}
"""What a list of each kind is called."""


class Interface(NamedTuple):
    """One topic or service of a node."""

    kind: str
    name: str
    """``~`` stands for the node's name, ``/`` makes the name absolute, all others are relative to the namespace."""
    type: str
    """``package/Name``; a type without package is one of this package's."""
    meaning: str
    condition: str = ""
    """Parameter without which the topic is not there."""


CLOCK = Interface(IN, "/clock", "rosgraph_msgs/Clock", "simulated time", "use_sim_time")
DESCRIPTION = Interface(
    IN, "robot_description", "std_msgs/String", "URDF, latched; not listened to where the parameter of that name is set"
)

INTERFACES = {
    "monitor": (
        Interface(IN, "joint_states", "sensor_msgs/JointState", "positions, velocities and efforts of the joints"),
        DESCRIPTION,
        Interface(
            IN,
            "odom",
            "nav_msgs/Odometry",
            "pose and twist of the base; child_frame_id is the root link or one rigidly attached to it, gravity is given "
            "in header.frame_id",
            "floating_base",
        ),
        CLOCK,
        *(Interface(OUT, f"~/{topic.name}", topic.type, topic.meaning, topic.condition) for topic in TOPICS),
        Interface(
            OUT,
            "/diagnostics",
            "diagnostic_msgs/DiagnosticArray",
            "inputs, model, numerical health, energy, external torque, contact: once a second, at once where energy rises "
            "too high, something collides or a limit of contact is exceeded",
        ),
        Interface(SERVICE, "~/forward_dynamics", "ForwardDynamics", "q̈ and ν̇ from positions, velocities, efforts"),
        Interface(
            SERVICE, "~/inverse_dynamics", "InverseDynamics", "efforts from positions, velocities, accelerations"
        ),
        Interface(
            SERVICE, "~/diagonalize", "Diagonalize", "everything the monitor publishes, for a state of your choice"
        ),
        Interface(
            SERVICE, "~/set_payload", "SetPayload", "attach a payload to a link, change it, take it off, while running"
        ),
    ),
    "simulator": (
        Interface(
            IN,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "efforts in the order of command_joints; held until the next one, or command_timeout; not with motion wave",
        ),
        Interface(
            IN,
            "external_wrench",
            "geometry_msgs/WrenchStamped",
            "pushes the link frame_id at its origin; several links at a time",
        ),
        CLOCK,
        Interface(
            OUT,
            "joint_states",
            "sensor_msgs/JointState",
            "as the sensors measure it; coupled mimic joints last, with an effort of 0; efforts as they act, weight "
            "compensation included",
        ),
        Interface(OUT, "robot_description", "std_msgs/String", "latched"),
        Interface(
            OUT,
            "odom",
            "nav_msgs/Odometry",
            "of a floating base, in `world`; delayed and lost with its joint state, without noise",
            "floating_base",
        ),
        Interface(OUT, "~/ground_truth", "DiagonalizedState", "what is, without sensors"),
        Interface(OUT, "/clock", "rosgraph_msgs/Clock", "simulated time", "publish_clock or lockstep"),
        Interface(
            OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "commands, pace and simulation: once a second"
        ),
        Interface(SERVICE, "~/pause", "std_srvs/SetBool", "the robot stands still, and goes on as it was"),
        Interface(SERVICE, "~/step", "Step", "some steps while paused, stamped from now on"),
        Interface(
            SERVICE, "~/reset", "std_srvs/Trigger", "where it began, without a command; time goes on, noise begins anew"
        ),
        Interface(SERVICE, "~/set_state", "SetState", "any other state; time and command go on"),
    ),
    "controller": (
        Interface(
            IN,
            "joint_states",
            "sensor_msgs/JointState",
            "positions and velocities of all joints, with stamps; efforts are not looked at",
        ),
        DESCRIPTION._replace(meaning=DESCRIPTION.meaning + "; another robot is taken over when deactivated"),
        Interface(
            IN,
            "target",
            "geometry_msgs/PoseStamped",
            "mode pose: where controlled_link shall be, in the axes of the link frame_id, as that link is when the target "
            "comes",
        ),
        Interface(
            IN,
            "trajectory",
            "trajectory_msgs/JointTrajectory",
            "mode tracking: interpolated as ros2_control's joint trajectory controller does; within position and velocity "
            "limits",
        ),
        Interface(
            IN,
            "set_point",
            "sensor_msgs/JointState",
            "mode tracking: positions of all joints, within their limits; gone to at set_point_speed",
        ),
        Interface(
            IN,
            "contact_scale",
            "std_msgs/Float64",
            "part, from 0 to 1, of the allowed speeds of contact that is allowed now, as of speed and separation monitoring",
            "contact.limits_file or contact.energy_limit",
        ),
        CLOCK,
        Interface(
            OUT,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "efforts in the order of command_joints, one message for each valid joint state",
        ),
        Interface(OUT, "~/status", "ControllerStatus", "law, phase, energies, V and its rate, errors, who is limited"),
        Interface(
            OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "control, commands and inputs: once a second"
        ),
        *(
            Interface(
                SERVICE,
                f"~/mode/{mode}",
                "std_srvs/Trigger",
                "puts this law in force, with the present state as its target; takes up a robot that was given up",
            )
            for mode in MODES
        ),
    ),
    "view": (
        Interface(IN, "diag_dynamics/state", "DiagonalizedState", "of each monitor that is found, whatever its name"),
        Interface(IN, "diag_dynamics/external_torque", "ExternalTorque", "likewise"),
        Interface(IN, "diag_dynamics/contact", "Contact", "of every monitor that judges contact by limits"),
        Interface(IN, "robot_description", "std_msgs/String", "URDF, in the namespace of each monitor"),
        Interface(IN, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "what each robot's nodes say"),
        CLOCK,
        Interface(OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "page and robots: once a second"),
    ),
}
"""Of each node, in the order in which they are listed."""

LIFECYCLE = (
    ("~/change_state", "lifecycle_msgs/ChangeState"),
    ("~/get_state", "lifecycle_msgs/GetState"),
    ("~/get_available_states", "lifecycle_msgs/GetAvailableStates"),
    ("~/get_available_transitions", "lifecycle_msgs/GetAvailableTransitions"),
    ("~/get_transition_graph", "lifecycle_msgs/GetAvailableTransitions"),
)
"""Services of the controller, which is a managed node."""


def anchored(kind):
    """Type of an interface: a link to its fields, if they are this package's."""
    return f"`{kind}`" if "/" in kind else f"[{kind}](#{kind.lower()})"


def conditions(interface):
    """Parameters without which a topic is not there, each as code."""
    return " or ".join(f"`{name}`" for name in interface.condition.split(" or "))


FIELD = re.compile(r"(?P<type>[\w/]+(?:\[\])?)\s+(?P<name>\w+)(?:\s*=\s*(?P<value>\w+))?\s*(?:#\s*(?P<meaning>.*))?$")


def fields_of(lines):
    """Rows of the fields in lines of an interface file; a comment that goes on belongs to the field above it."""
    rows = []
    for line in lines:
        if field := FIELD.match(line):
            name = f"{field['name']} = {field['value']}" if field["value"] else field["name"]
            kind = field["type"]
            own = kind.startswith("diag_dynamics/")
            kind = anchored(kind.removeprefix("diag_dynamics/")) if own else f"`{kind}`"
            rows.append([f"`{name}`", kind, field["meaning"] or ""])
        elif rows and line.startswith(" ") and "#" in line:
            rows[-1][2] += " " + line.split("#", 1)[1].strip()
    return [(name, kind, cell(meaning)) for name, kind, meaning in rows]


def interface_page_of(path):
    """Section of one message or service: what its file says of it and of each field."""
    lines = path.read_text(encoding="utf-8").splitlines()
    lines = lines[next(k for k, line in enumerate(lines) if line and not line.startswith("# SPDX-")) :]
    count = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    about = [line[1:].removeprefix(" ") for line in lines[:count]]
    parts = [f"### {path.stem}", f"`{path.parent.name}/{path.name}`"]
    for equation, group in groupby(about, lambda line: line.startswith("  ")):  # an equation stands by itself
        lines_of = list(group)
        parts.append("\n".join(lines_of) if equation else paragraph(cell(" ".join(lines_of))))
    head = ("field", "type", "meaning")
    sections = "\n".join(lines[count:]).split("\n---\n")
    for title, section in zip(("Request:", "Response:") if len(sections) > 1 else ("",), sections, strict=True):
        if title:
            parts.append(title)
        parts.append(table(head, fields_of(section.splitlines())))
    return "\n\n".join(parts)


def interfaces_page():
    """Text of docs/interfaces.md."""
    parts = [
        f"# Topics, services and messages\n\n<!-- Written by `{COMMAND}` from msg/, srv/ and "
        "docs/tables.py: edit these, not this page. -->",
        paragraph(
            "`~` is the node's name; it and all names without a leading `/` are relative to the namespace. `ros2 interface "
            "show diag_dynamics/msg/KineticEnergy` tells the unit and meaning of each field, too. A message that nobody "
            "subscribes to is not made."
        ),
        " · ".join(f"[{name}](#{name})" for name in NODES) + "\n· [messages](#messages) · [services](#services)",
    ]
    for node, name in NODES.items():
        parts += [f"## {node}", f"Node `{name}`."]
        for kind, title in TITLES.items():
            rows = []
            for one in INTERFACES[node]:
                if one.kind == kind:
                    meaning = cell(one.meaning) + (f" (with {conditions(one)})" if one.condition else "")
                    rows.append((f"`{one.name}`", anchored(one.type), meaning))
            parts.append(table((title, "type", ""), rows))
    own = ", ".join(f"`{name}`" for name, _ in LIFECYCLE)
    parts.append(
        paragraph(
            f"The controller is a managed node with the services {own} of `lifecycle_msgs`. Each node has the parameter "
            "services of rclpy."
        )
    )
    for title, pattern in (("Messages", "msg/*.msg"), ("Services", "srv/*.srv")):
        parts += [f"## {title}", *(interface_page_of(path) for path in sorted(ROOT.glob(pattern)))]
    return "\n\n".join(parts) + "\n"


# --- Configuration ---


def configuration(node):
    """Text of config/<node>.yaml: all defaults, each below what it means."""
    lines = [
        f"# Parameters of the {node}, with their defaults. Written by `{COMMAND}`: copy this file rather than edit it.",
        '# An empty list of entries is [""], or [].',
        "/**:",
        "  ros__parameters:",
    ]
    if node == "controller":
        lines += commented(
            f"REQUIRED, without default: {WHY_REQUIRED}. The controller refuses to be configured without.", 4
        )
        lines += [f"    # {COMPENSATES}: false"]
    group = ""
    for name, spec in parameters_of(node).items():
        head, _, last = name.rpartition(".")
        if head != group:
            group = head
            lines += [f"    {head}:"] if head else []
        indent = 6 if head else 4
        note = f" One of {', '.join(map(as_yaml, spec.choices))}." if spec.choices else ""
        lines += commented(spec.description + note, indent)
        lines.append(f"{' ' * indent}{last}: {as_yaml(spec.default)}")
    return "\n".join(lines) + "\n"


def commented(text, indent):
    """Lines of a comment."""
    return wrap(text, 118, initial_indent=" " * indent + "# ", subsequent_indent=" " * indent + "# ")


def files():
    """Text of every file that is generated, by path."""
    return {
        ROOT / "docs" / "parameters.md": parameters_page(),
        ROOT / "docs" / "interfaces.md": interfaces_page(),
        **{ROOT / "config" / f"{node}.yaml": configuration(node) for node in NODES},
    }


if __name__ == "__main__":
    for path, text in files().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
