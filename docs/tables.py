# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Generate tables of parameters, topics, services, messages and diagnostics from the code.

``make docs-tables`` writes config/*.yaml, and the tables of pages: each stands between
``<!-- table: parameters of monitor -->`` and ``<!-- end of table -->``. The library is required, ROS
is not.
"""

import re
import sys
from importlib import import_module
from itertools import groupby
from pathlib import Path
from textwrap import fill, wrap
from typing import NamedTuple

import yaml

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from diag_dynamics.control.modes import LAWS  # noqa: E402
from diag_dynamics.entries import LARGEST  # noqa: E402
from diag_dynamics.inspection.inspection_report import OF_MOTION, OF_XML  # noqa: E402
from diag_dynamics.nodes.support.topics import NODES, TOPICS  # noqa: E402
from diag_dynamics.parameters.controller import COMPENSATES, WHY_REQUIRED  # noqa: E402

COMMAND = "make docs-tables"

GROUPS = {
    "monitor": {
        "robot_description": "Robot model",
        "odom_twist_frame": "Input messages",
        "plausibility.beyond_limits": "Plausibility limits",
        "stuck_timeout": "Stuck sensors and mimic joints",
        "energy.warn": "Energy thresholds",
        "external_torque.gain": "External torque",
        "collision.threshold": "Collision detection",
        "external_wrench.frames": "External wrench",
        "reaction.service": "Reaction to a collision",
        "contact_limits.file": "Predicted contact",
        "publish_inverse_factor": "Published messages",
    },
    "simulator": {
        "robot_description": "Robot model",
        "rate": "Integration",
        "command_joints": "Commands and wrenches",
        "sensor_noise": "Sensors",
        "real_time_factor": "Time",
        "gravity": "Gravity and payloads",
    },
    "controller": {
        "autostart": "Start",
        "robot_description": "Robot model",
        "command_joints": "Commands",
        "initial_mode": "Control laws",
        "limit_margin": "Position and energy limits",
        "contact_limits.file": "Contact limits",
        "observer_gain": "Observer and effort limits",
        "max_state_age": "Timeouts and status",
    },
    "view": {"host": "Page"},
}
"""Titles of the groups of each node's parameters, by the first parameter of the group."""


def parameters_of(node):
    """Specs of a node's parameters, by name."""
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


def as_yaml(value):
    """Value of a parameter as text of a parameter file."""
    if isinstance(value, list):
        return (
            "["
            + ", ".join(
                f'"{entry}"' if isinstance(entry, str) else as_yaml(entry) for entry in value
            )
            + "]"
        )
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and "e" in repr(value) and "." not in repr(value):
        return repr(value).replace("e", ".0e")  # YAML 1.1 takes 1e-06 for text
    if isinstance(value, str) and not re.fullmatch(r"[A-Za-z_]\w*", value):
        return f'"{value}"'
    return str(value)


# --- Markdown ---


def cell(text):
    """Return text for a cell of a table; code keeps its * and <."""
    return re.sub(r"[*<](?=[^`]*(?:`[^`]*`[^`]*)*$)|\|", r"\\\g<0>", text)


def marked_up(text):
    """Text with Markdown as it stands in a cell of a table."""
    return re.sub(r"([|<])", r"\\\1", text)


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
    return (
        f"≥ {spec.minimum:g}"
        if spec.maximum == LARGEST
        else f"{spec.minimum:g} to {spec.maximum:g}"
    )


def changes(spec):
    """When a new value is accepted."""
    return "never" if spec.read_only else "unconfigured" if spec.while_unconfigured else "any time"


def parameter_tables(node):
    """Tables of a node's parameters, one for each group."""
    parts, rows = [], []
    for parameter, spec in parameters_of(node).items():
        if title := GROUPS[node].get(parameter):
            rows = []
            parts.append((title, rows))
            if parameter == "autostart":
                why = WHY_REQUIRED[0].upper() + WHY_REQUIRED[1:]
                rows.append(
                    (f"`{COMPENSATES}`", cell(why) + ".", "none: **required**", "", "unconfigured")
                )
        rows.append(
            (
                f"`{parameter}`",
                cell(spec.description),
                f"`{as_yaml(spec.default)}`",
                allowed(spec),
                changes(spec),
            )
        )
    head = ("parameter", "meaning", "default", "values", "changes")
    titles = [f"### {title} ({node})\n\n{table(head, rows)}" for title, rows in parts]
    return "\n\n".join(titles)


# --- Interfaces ---

IN, OUT, SERVICE = "in", "out", "service"
"""Kinds of interfaces: a topic the node subscribes to, a topic it publishes, a service it offers."""

TITLES = {IN: "subscribed topics", OUT: "published topics", SERVICE: "services"}
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
    """Parameter that the topic requires."""


CLOCK = Interface(IN, "/clock", "rosgraph_msgs/Clock", "simulated time", "use_sim_time")
DESCRIPTION = Interface(
    IN,
    "robot_description",
    "std_msgs/String",
    "URDF, transient local; not subscribed to if the parameter of that name is set",
)

INTERFACES = {
    "monitor": (
        Interface(
            IN,
            "joint_states",
            "sensor_msgs/JointState",
            "positions, velocities and efforts of the joints",
        ),
        DESCRIPTION,
        Interface(
            IN,
            "odom",
            "nav_msgs/Odometry",
            "pose and twist of the base; child_frame_id is the root link or one rigidly attached to it, gravity is given "
            "in header.frame_id",
            "floating_base",
        ),
        Interface(
            IN,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "to recognize efforts that repeat commands while the robot stands still",
        ),
        CLOCK,
        *(
            Interface(OUT, f"~/{topic.name}", topic.type, topic.meaning, topic.condition)
            for topic in TOPICS
        ),
        Interface(
            OUT,
            "~/collision",
            "std_msgs/Bool",
            "whether there is a collision, transient local; published on a change, first at the first judged state",
            "external_torque.gain",
        ),
        Interface(
            OUT,
            "/diagnostics",
            "diagnostic_msgs/DiagnosticArray",
            "inputs, model, energy, external torque, contact limits: once a second, and immediately on a "
            "threshold, a collision or an exceeded contact limit",
        ),
        Interface(
            SERVICE,
            "~/forward_dynamics",
            "ForwardDynamics",
            "q̈ and ν̇ from positions, velocities, efforts",
        ),
        Interface(
            SERVICE,
            "~/inverse_dynamics",
            "InverseDynamics",
            "joint torques from positions, velocities, accelerations",
        ),
        Interface(
            SERVICE,
            "~/diagonalize",
            "Diagonalize",
            "all quantities of the monitor for a requested state",
        ),
        Interface(
            SERVICE,
            "~/set_payload",
            "SetPayload",
            "attach, change or remove the payload of a link at run time",
        ),
        Interface(
            SERVICE,
            "~/accept_payload",
            "std_srvs/Trigger",
            "add the estimated load to the payload of `load.link`",
        ),
    ),
    "simulator": (
        Interface(
            IN,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "joint torques in the order of command_joints; held until the next one or command_timeout; not with motion wave",
        ),
        Interface(
            IN,
            "external_wrench",
            "geometry_msgs/WrenchStamped",
            "force and torque on the link frame_id, at its origin; several links at a time",
        ),
        CLOCK,
        Interface(
            OUT,
            "joint_states",
            "sensor_msgs/JointState",
            "measured state; coupled mimic joints last, with an effort of 0; efforts include the drives' gravity "
            "compensation",
        ),
        Interface(OUT, "robot_description", "std_msgs/String", "URDF, transient local"),
        Interface(
            OUT,
            "odom",
            "nav_msgs/Odometry",
            "state of a floating base in `world`; same delay and losses as joint_states, without noise",
            "floating_base",
        ),
        Interface(OUT, "~/ground_truth", "DiagonalizedState", "true state, without sensor errors"),
        Interface(
            OUT, "/clock", "rosgraph_msgs/Clock", "simulated time", "lockstep or real_time_factor"
        ),
        Interface(
            OUT,
            "/diagnostics",
            "diagnostic_msgs/DiagnosticArray",
            "commands, pace and simulation: once a second",
        ),
        Interface(SERVICE, "~/pause", "std_srvs/SetBool", "pause and resume"),
        Interface(
            SERVICE,
            "~/reset",
            "std_srvs/Trigger",
            "restore the initial state and clear the command; time continues, noise restarts",
        ),
        Interface(SERVICE, "~/set_state", "SetState", "set a state; time and command stay"),
    ),
    "controller": (
        Interface(
            IN,
            "joint_states",
            "sensor_msgs/JointState",
            "positions and velocities of all joints, with stamps; efforts are ignored",
        ),
        DESCRIPTION._replace(
            meaning=DESCRIPTION.meaning + "; another robot replaces it only while inactive"
        ),
        Interface(
            IN,
            "target",
            "geometry_msgs/PoseStamped",
            "mode pose: target of controlled_link, in the axes of a link at the time of reception",
        ),
        Interface(
            IN,
            "~/joint_trajectory",
            "trajectory_msgs/JointTrajectory",
            "tracking, regulation: interpolated like ros2_control's controller; within position and velocity limits",
        ),
        Interface(
            IN,
            "set_point",
            "sensor_msgs/JointState",
            "tracking, regulation: positions of all joints, within their limits; approached at set_point_speed",
        ),
        Interface(
            IN,
            "contact_scale",
            "std_msgs/Float64",
            "fraction from 0 to 1 of the allowed contact speeds, for speed and separation monitoring",
            "contact_limits.file or contact_limits.energy",
        ),
        CLOCK,
        Interface(
            IN,
            "controller_manager/activity",
            "controller_manager_msgs/ControllerManagerActivity",
            "latched: state of the effort controller",
            "controller_manager_msgs",
        ),
        Interface(
            OUT,
            "effort_controller/commands",
            "std_msgs/Float64MultiArray",
            "joint torques in the order of command_joints, one message for each valid joint state",
        ),
        Interface(
            OUT,
            "~/status",
            "ControllerStatus",
            "mode, phase, energies, V and its rate, desired and actual motion, last trajectory, limited joints",
        ),
        Interface(
            OUT,
            "~/controller_state",
            "control_msgs/JointTrajectoryControllerState",
            "desired and actual motion, their difference and the efforts",
            "control_msgs",
        ),
        Interface(
            OUT,
            "/diagnostics",
            "diagnostic_msgs/DiagnosticArray",
            "control, commands and inputs: once a second",
        ),
        *(
            Interface(
                SERVICE,
                f"~/mode/{mode}",
                "std_srvs/Trigger",
                "activate this law with the present state as its target",
            )
            for mode in LAWS
        ),
    ),
    "view": (
        Interface(IN, "diag_dynamics/state", "DiagonalizedState", "of every monitor on the graph"),
        Interface(
            IN, "diag_dynamics/external_torque", "ExternalTorque", "of every monitor on the graph"
        ),
        Interface(
            IN,
            "diag_dynamics/contact_limits",
            "ContactLimits",
            "of every monitor with contact limits",
        ),
        Interface(
            IN, "robot_description", "std_msgs/String", "URDF, in the namespace of each monitor"
        ),
        Interface(
            IN, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "statuses of each robot's nodes"
        ),
        CLOCK,
        Interface(
            OUT, "/diagnostics", "diagnostic_msgs/DiagnosticArray", "page and robots: once a second"
        ),
    ),
}
"""Interfaces by node."""

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


FIELD = re.compile(
    r"(?P<type>[\w/]+(?:\[\d*\])?)\s+(?P<name>\w+)(?:\s*=\s*(?P<value>\w+))?\s*(?:#\s*(?P<meaning>.*))?$"
)


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
    lines = lines[
        next(k for k, line in enumerate(lines) if line and not line.startswith("# SPDX-")) :
    ]
    count = next(k for k, line in enumerate(lines) if not line.startswith("#"))
    about = [line[1:].removeprefix(" ") for line in lines[:count]]
    parts = [f"### {path.stem}", f"`{path.parent.name}/{path.name}`"]
    for equation, group in groupby(
        about, lambda line: line.startswith("  ")
    ):  # an equation stands by itself
        lines_of = list(group)
        parts.append("\n".join(lines_of) if equation else paragraph(cell(" ".join(lines_of))))
    head = ("field", "type", "meaning")
    sections = "\n".join(lines[count:]).split("\n---\n")
    for title, section in zip(
        ("Request:", "Response:") if len(sections) > 1 else ("",), sections, strict=True
    ):
        if title:
            parts.append(title)
        parts.append(table(head, fields_of(section.splitlines())))
    return "\n\n".join(parts)


def interface_tables(node):
    """Tables of a node's topics and services."""
    parts = []
    for kind, title in TITLES.items():
        rows = []
        for one in INTERFACES[node]:
            if one.kind == kind:
                meaning = cell(one.meaning) + (
                    f" (with {conditions(one)})" if one.condition else ""
                )
                rows.append((f"`{one.name}`", anchored(one.type), meaning))
        if rows:
            parts.append(table((title, "type", ""), rows))
    if node == "controller":
        own = ", ".join(f"`{name}`" for name, _ in LIFECYCLE)
        parts.append(
            paragraph(
                f"The controller is a managed node with the services {own} of `lifecycle_msgs`."
            )
        )
        action = "`~/follow_joint_trajectory` (`control_msgs/FollowJointTrajectory`)"
        parts.append(
            paragraph(f"Where `control_msgs` is installed, it serves the action {action}.")
        )
    return "\n\n".join(parts)


def interface_pages(folder):
    """Sections of all messages or services."""
    return "\n\n".join(interface_page_of(path) for path in sorted((ROOT / folder).iterdir()))


# --- Diagnostics ---


def diagnostics():
    """Meanings of the keys on /diagnostics, by node, entry and key."""
    return yaml.safe_load((ROOT / "docs" / "diagnostics.yaml").read_text(encoding="utf-8"))


def diagnostic_tables(node):
    """Tables of a node's diagnostics, one for each entry."""
    parts = []
    for entry, keys in diagnostics()[node].items():
        rows = []
        for key, text in keys.items():
            meaning, _, action = text.partition(" → ")
            rows.append((cell(key), marked_up(meaning), marked_up(action)))
        parts.append(f"### {node}: {entry}\n\n" + table(("key", "meaning", "action"), rows))
    return "\n\n".join(parts)


# --- Inspection ---


def checks_table(_):
    """Table of the checks of `diag-dynamics inspect`: the first sentence of each docstring."""
    rows = [("`loading`", "errors, and warnings about the start of loops and ball joints")]
    for check in (*OF_XML, *OF_MOTION):
        finds = check.__doc__.split("\n\n")[0].removeprefix("Find ").removesuffix(".")
        rows.append((f"`{check.__name__}`", cell(" ".join(finds.split()))))
    return table(("check", "finds"), rows)


# --- Markers in pages ---

END = "<!-- end of table -->"
TABLE = re.compile(
    rf"(?P<begin><!-- table: (?P<kind>\w+)(?: of (?P<name>[\w ]+))? -->).*?{END}", re.DOTALL
)
PAGES = sorted((ROOT / "docs").rglob("*.md"))

KINDS = {
    "parameters": parameter_tables,
    "interfaces": interface_tables,
    "diagnostics": diagnostic_tables,
    "checks": checks_table,
    "messages": lambda _: interface_pages("msg"),
    "services": lambda _: interface_pages("srv"),
}
"""Function of each kind of table; its argument is the name in the marker."""


def with_tables(text):
    """Return the text of a page with its tables."""

    def generate(marked):
        return f"{marked['begin']}\n\n{KINDS[marked['kind']](marked['name'])}\n\n{END}"

    return TABLE.sub(generate, text)


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
        lines += commented(f"REQUIRED, without default: {WHY_REQUIRED}.", 4)
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
    return wrap(
        text, 118, initial_indent=" " * indent + "# ", subsequent_indent=" " * indent + "# "
    )


POLICY = ROOT / "config" / "sros2_policy.xml"


def policy():
    """Text of the access policy: topics of the monitor and modes are those of its nodes."""
    text = POLICY.read_text(encoding="utf-8")
    for node, kind, tag, prefix in (
        ("monitor", OUT, "topic", "~/"),
        ("controller", SERVICE, "service", "~/mode/"),
    ):
        lines = [
            f"\n{12 * ' '}<{tag}>{interface.name}</{tag}>"
            for interface in INTERFACES[node]
            if interface.kind == kind and interface.name.startswith(prefix)
        ]
        text = re.sub(rf"(\s+<{tag}>{prefix}\w+</{tag}>)+", "".join(lines), text, count=1)
    return text


def files():
    """Text of every file that is generated or has generated tables, by path."""
    texts = {path: with_tables(path.read_text(encoding="utf-8")) for path in PAGES}
    texts[POLICY] = policy()
    return texts | {ROOT / "config" / f"{node}.yaml": configuration(node) for node in NODES}


if __name__ == "__main__":
    for path, text in files().items():
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
