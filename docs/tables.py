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

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from diag_dynamics.entries import LARGEST  # noqa: E402
from diag_dynamics.nodes.support.interfaces import INTERFACES, MANAGED, TITLES  # noqa: E402
from diag_dynamics.nodes.support.names import NODES  # noqa: E402
from diag_dynamics.parameters.controller import COMPENSATES, WHY_REQUIRED  # noqa: E402
from diag_dynamics.yaml_files import as_yaml  # noqa: E402

COMMAND = "make docs-tables"

CHANGES = {
    "monitor": "Values are judged together: a wrong one is refused with the reason, and changes nothing. `~/set_payload` "
    "changes `payloads` too. Why the bounds `absurd.*` are what they are: [drivers.md](drivers.md#what-cannot-be); how "
    "to choose `external_torque.*` and `alarm.*`: [alarms.md](alarms.md).",
    "simulator": "`gravity` and `payloads` may change while the robot moves, all others while the node is unconfigured.",
    "controller": "All may change while the node is unconfigured only. What the gains do: [control.md](control.md#laws).",
    "view": "All may change while the node is unconfigured only. What the page shows: [view.md](view.md).",
}
"""What a reader has to know beside a node's table."""


def parameters_of(node):
    """Specs of a node's parameters, by name."""
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


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
            "start with `--ros-args --params-file my.yaml`. A whole number stands for a number, and `[]` for an empty list "
            'of entries, whose default is `[""]`. A node warns of a parameter whose name is nearly one of its own. *Changes* '
            "says when another value is taken: at `any time`, while the node is `unconfigured`, or `never` after its start."
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
        "diag_dynamics/nodes/support/interfaces.py: edit these, not this page. -->",
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
    own = ", ".join(f"`{name}`" for name, _ in MANAGED)
    parts.append(
        paragraph(
            f"Each node is a managed node, with the services {own} of `lifecycle_msgs`, and has the parameter services of "
            "every node."
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
