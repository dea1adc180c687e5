# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pages: generated tables are complete, tables agree with the code, and blocks of Python
run.
"""

import ast
import os
import re
import runpy
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import pytest
import yaml

from diag_dynamics.joint_states.codes import CAUSES, COUNTS, EVENTS
from diag_dynamics.nodes.support.topics import NODES
from diag_dynamics.parameters.controller import COMPENSATES
from diag_dynamics.parameters.files import parameters_of
from pages import blocks_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
TABLES = SimpleNamespace(**runpy.run_path(str(DOCS / "tables.py")))
IN, OUT, SERVICE, INTERFACES, LIFECYCLE = (
    getattr(TABLES, name) for name in ("IN", "OUT", "SERVICE", "INTERFACES", "LIFECYCLE")
)
PAGES = [ROOT / "README.md", *sorted(DOCS.rglob("*.md"))]


def node_parameters(node):
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


# --- Generated files ---


def test_generated_files_are_fresh():
    stale = [
        path.name
        for path, text in TABLES.files().items()
        if path.read_text(encoding="utf-8") != text
    ]
    assert stale == [], "run make docs-tables"


def test_pages_have_a_table_of_every_node():
    """Every parameter, topic, service and key of diagnostics stands in a page."""
    names = ("parameters", "interfaces", "troubleshooting")
    pages = {name: (DOCS / f"{name}.md").read_text(encoding="utf-8") for name in names}
    for node in NODES:
        assert [
            name for name in node_parameters(node) if f"| `{name}` |" not in pages["parameters"]
        ] == []
        assert [
            interface.name
            for interface in INTERFACES[node]
            if f"| `{interface.name}` |" not in pages["interfaces"]
        ] == []
        keys = [key for entry in TABLES.diagnostics()[node].values() for key in entry]
        assert [
            key for key in keys if f"| {TABLES.cell(key)} |" not in pages["troubleshooting"]
        ] == []
    files = [path for folder in ("msg", "srv") for path in (ROOT / folder).iterdir()]
    assert [path.stem for path in files if f"### {path.stem}\n" not in pages["interfaces"]] == []


def keys_in(path):
    """Return the texts that a module's functions on statuses use as keys of dictionaries."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    result = set()
    for function in functions:
        if re.search("status|report|values|health|listeners", function.name):
            for node in ast.walk(function):
                keys = node.keys if isinstance(node, ast.Dict) else [getattr(node, "slice", None)]
                result |= {
                    key.value
                    for key in keys
                    if isinstance(key, ast.Constant) and isinstance(key.value, str)
                }
    return result


MONITOR = (
    "input_statistics",
    "watches",
    "collisions",
    "monitored_robot",
    "monitor",
    "reaction",
    "gravity",
)
REPORTING = {
    "monitor": [f"monitor/{name}" for name in MONITOR],
    "controller": ["controller/record", "controller/controller"],
    "simulator": ["simulator"],
    "view": ["view"],
}
"""Modules of the nodes with keys of diagnostics."""


@pytest.mark.parametrize("node", REPORTING)
def test_diagnostics_are_documented(node):
    """docs/diagnostics.yaml has every key that a node reports, and every cause of a rejection."""
    documented = [key for entry in TABLES.diagnostics()[node].values() for key in entry]
    keys = set().union(
        *(keys_in(ROOT / "diag_dynamics" / "nodes" / f"{name}.py") for name in REPORTING[node])
    )
    keys -= {*node_parameters(node), COMPENSATES}
    if node == "monitor":
        keys |= {f"rejected: {cause}" for cause in CAUSES.values()} | {
            *COUNTS.values(),
            *EVENTS.values(),
        }
    assert [key for key in sorted(keys) if not any(key in item for item in documented)] == []


def flatten(tree, prefix=""):
    """Return the leaves of nested dictionaries by dotted name."""
    leaves = {}
    for key, value in tree.items():
        leaves |= (
            flatten(value, f"{prefix}{key}.") if isinstance(value, dict) else {prefix + key: value}
        )
    return leaves


@pytest.mark.parametrize("node", NODES)
def test_installed_configuration_holds_the_defaults(node):
    """A YAML parser reads each value with its type."""
    tree = yaml.safe_load((ROOT / "config" / f"{node}.yaml").read_text(encoding="utf-8"))
    written = flatten(tree["/**"]["ros__parameters"])
    assert written == {name: spec.default for name, spec in node_parameters(node).items()}


# --- Topics, services and help ---


@pytest.mark.ros
@pytest.mark.parametrize(("argument", "status"), [("--help", 0), ("my.urdf", 2), ("--rate", 2)])
def test_arguments_of_nodes(argument, status, capsys):
    """The help names the page of the parameters; arguments that are not of ROS are refused."""
    from diag_dynamics.nodes.support.runner import parse_arguments

    with pytest.raises(SystemExit) as end:
        parse_arguments("monitor", ["monitor", argument, "--ros-args", "-p", "rate:=1.0"])
    assert end.value.code == status
    shown = "".join(capsys.readouterr())
    assert "usage: monitor" in shown and ("docs/parameters.md" if not status else argument) in shown


def test_parameters_by_task():
    """The ten parameters that people set are parameters of the monitor."""
    text = (ROOT / "docs" / "parameters.md").read_text(encoding="utf-8")
    names = re.findall(r"^\|[^|]+\| `([\w.]+)` \|", text, re.MULTILINE)
    assert len(set(names)) == 10 and set(names) <= {*node_parameters("monitor")}


@pytest.mark.ros
def test_topics_of_the_monitor_agree():
    """The lists of interfaces, of types, of rates and of the order of publishing have the same
    topics.
    """
    from diag_dynamics.nodes.monitor.outputs import TYPES
    from diag_dynamics.nodes.support.messages import ORDER
    from diag_dynamics.parameters.monitor import RATES

    listed = {
        interface.name: interface.type.rpartition("/")[2]
        for interface in INTERFACES["monitor"]
        if interface.kind == OUT and interface.name.startswith("~/")
    }
    assert listed.pop("~/collision") == "Bool"  # of the reaction, latched, without a rate
    assert listed == {f"~/{name}": kind.__name__ for name, kind in TYPES.items()}
    assert set(TYPES) == set(RATES), "RATES of parameters/monitor.py"
    assert {*ORDER} < {*TYPES}, "ORDER of nodes/support/messages.py"


OF_EVERY_NODE = {"/rosout", "/parameter_events", "~/get_type_description"}
OF_EVERY_NODE |= {f"~/{name}_parameters" for name in ("describe", "get", "list", "set")}
OF_EVERY_NODE |= {"~/get_parameter_types", "~/set_parameters_atomically"}
"""Topics and services that every node offers."""


@pytest.mark.parametrize("node", NODES)
def test_access_policy_allows_the_interfaces(node):
    """It allows no other ones; test_deployed.py compares the policy with the nodes."""
    policy = ET.parse(ROOT / "config" / "sros2_policy.xml").getroot()
    profiles = [profile for profile in policy.iter("profile") if profile.get("node") == NODES[node]]
    paths = {
        IN: "topics[@subscribe]/topic",
        OUT: "topics[@publish]/topic",
        SERVICE: "services[@reply]/service",
    }
    common = OF_EVERY_NODE | (
        {"~/transition_event", *dict(LIFECYCLE)} if node == "controller" else set()
    )
    for kind, path in paths.items():
        allowed = {element.text for profile in profiles for element in profile.findall(path)}
        assert allowed - common == {
            interface.name for interface in INTERFACES[node] if interface.kind == kind
        }


# --- Pages ---


WAYS = {"run", "run in a folder of recordings", "parameters of monitor", "columns of a table"}
WAYS_WITH_TEXT = {"run until", "run in the background", "hear", "end", "not run"}
ELSEWHERE = {"tutorial", "control"}
"""Pages whose programs test_programs.py and test_control.py run."""


def pages_with_blocks():
    """Yield pages; those with commands to run are of the full tier."""
    for page in PAGES:
        if blocks := blocks_of(page):
            commands = any(block.how == "run" and block.language == "bash" for block in blocks)
            yield pytest.param(page, id=page.stem, marks=[pytest.mark.full] if commands else [])


@pytest.mark.parametrize("page", [*pages_with_blocks()])
def test_blocks_run(page, compiled, tmp_path, monkeypatch, capsys):
    """Run the programs of a page one after the other, and read its parameter files."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(ROOT), prepend=os.pathsep)
    names = {}
    for block in blocks_of(page):
        where = f"{page.name}, line {block.line}"
        assert block.language == "text" or block.how in (WAYS_WITH_TEXT if block.what else WAYS), (
            where
        )
        if block.how == "parameters of monitor":
            path = tmp_path / "parameters.yaml"
            path.write_text(block.code, encoding="utf-8")
            assert set() < set(parameters_of([path])) <= set(node_parameters("monitor")), where
        elif block.how == "run" and page.stem not in ELSEWHERE:
            if block.language == "python":
                exec(compile("\n" * block.line + block.code, page.name, "exec"), names)
            else:
                command = (
                    f'diag-dynamics() {{ "{sys.executable}" -m diag_dynamics "$@"; }}\n{block.code}'
                )
                subprocess.run(["bash", "-euo", "pipefail", "-c", command], check=True)
    if page.stem == "README":  # its last number is the error of ν̇ + C = ε
        assert abs(float(capsys.readouterr().out.split()[-1])) < 1e-12
