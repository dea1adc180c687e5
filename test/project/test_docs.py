# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pages: what is generated is fresh and holds what the code does, links lead somewhere, and lines can be read."""

import importlib.util
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
import yaml
from test_package import FLOORS

from diag_dynamics.nodes.support.interfaces import IN, INTERFACES, MANAGED, OUT, SERVICE
from diag_dynamics.nodes.support.names import NODES
from diag_dynamics.nodes.support.topics import TOPICS
from diag_dynamics.parameters.files import parameters_of
from pages import blocks_of

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [*sorted(ROOT.glob("*.md")), *sorted(DOCS.rglob("*.md"))]
RUN = [*(DOCS / f"{name}.md" for name in ("index", "quickstart", "simulation")), *sorted((DOCS / "howto").glob("*.md"))]
"""Pages whose blocks are run by this file; others' are by test_tutorial.py and test_snippets.py, as their comments say."""


def node_parameters(node):
    return import_module(f"diag_dynamics.parameters.{node}").PARAMETERS


def text_of(name):
    return (DOCS / name).read_text(encoding="utf-8")


def section_of(page, heading):
    """Text below a heading, up to the next one of its rank."""
    return text_of(page).split(f"\n## {heading}\n")[1].split("\n## ")[0]


# --- What is generated ---


def generated():
    spec = importlib.util.spec_from_file_location("tables", DOCS / "tables.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.files()


def test_generated_files_are_fresh():
    """Whoever changes a parameter, a message or a topic runs `make docs-tables`."""
    stale = [path.name for path, text in generated().items() if path.read_text(encoding="utf-8") != text]
    assert stale == [], "run make docs-tables"


def flat(tree, prefix=""):
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        else:
            yield prefix + key, value


@pytest.mark.parametrize("node", NODES)
def test_configuration_holds_the_defaults(node):
    """The file that is installed, as a parser of YAML reads it."""
    tree = yaml.safe_load((ROOT / "config" / f"{node}.yaml").read_text(encoding="utf-8"))
    written = dict(flat(tree["/**"]["ros__parameters"]))
    assert written == {name: spec.default for name, spec in node_parameters(node).items()}
    assert {name: type(value) for name, value in written.items()} == {
        name: type(spec.default) for name, spec in node_parameters(node).items()
    }


@pytest.mark.parametrize("node", NODES)
def test_parameters_page_lists_every_parameter(node):
    """With its default, which can be copied into a parameter file, its choices, and when it changes."""
    rows = re.findall(r"^\| `([\w.]+)` \| (.*?) \| (.*?) \| (.*?) \| (.*) \|$", section_of("parameters.md", node), re.M)
    if node == "controller":
        assert rows.pop(0)[:2] == ("robot_compensates_gravity", "none: **required**")
    specs = node_parameters(node)
    assert {name: yaml.safe_load(default.strip("`")) for name, default, *_ in rows} == {
        name: spec.default for name, spec in specs.items()
    }
    for name, _, values, changes, meaning in rows:
        spec = specs[name]
        assert all(f"`{choice}`" in values for choice in spec.choices)
        assert (changes == "never") == spec.read_only
        assert (changes == "unconfigured") == spec.while_unconfigured
        assert re.sub(r"\\(.)", r"\1", meaning) == spec.description


HELP = """
import importlib, sys
for node in ("monitor", "simulator", "controller", "view"):
    sys.argv = [node, "--help", "--ros-args", "-p", "rate:=1.0"]
    try:
        importlib.import_module(f"diag_dynamics.nodes.{node}.{node}").main()
    except SystemExit as end:
        assert end.code == 0
    print(chr(12))
sys.argv = ["monitor", "my.urdf"]
importlib.import_module("diag_dynamics.nodes.monitor.monitor").main()
"""


@pytest.mark.ros
def test_help_helps():
    """It names all that the pages list of a node, and ends with status 0; no ROS argument: status 2."""
    done = subprocess.run([sys.executable, "-c", HELP], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 2 and "error: unrecognized arguments: my.urdf" in done.stderr
    for node, said in zip(NODES, done.stdout.split(chr(12)), strict=False):
        assert f"usage: {node} " in said
        pages = section_of("parameters.md", node) + section_of("interfaces.md", node)
        names = re.findall(r"^\| `([\w./~]+)` \|", pages, re.M)
        assert len(names) > (10 if node == "view" else 30)
        assert [name for name in names if name not in said] == []


# --- Topics and services ---


@pytest.mark.parametrize("node", NODES)
def test_interfaces_are_those_of_the_code(node):
    """Every topic and service of the table is made by the node's code, and its type is imported there or is ours."""
    code = "".join(
        path.read_text(encoding="utf-8")
        for room in (node, "support")
        for path in (ROOT / "diag_dynamics" / "nodes" / room).glob("*.py")
        if path.name != "interfaces.py"
    )
    for one in INTERFACES[node]:
        last = one.name.removeprefix("~/").removeprefix("mode/")
        last = last.removeprefix("diag_dynamics/") if node == "view" else last
        known = f'"{last}"' in code or f'"~/{last}"' in code or one.name.startswith("~/mode/")
        assert known or f'"{one.name}"' in code or one.name == "/clock", one.name
        package, _, kind = one.type.rpartition("/")
        if not package:
            folder = "srv" if one.kind == SERVICE else "msg"
            assert (ROOT / folder / f"{kind}.{folder}").is_file()
        assert re.search(rf"\b{kind}\b", code), one.type


@pytest.mark.ros
def test_what_the_monitor_publishes_is_complete():
    """Each topic of the list has a type, a place in --help and the pages, a maker that makes that type, and a rate."""
    from diag_dynamics.assembly.assembler import RobotState
    from diag_dynamics.control.observer import Disturbance, DisturbanceObserver
    from diag_dynamics.dynamics import DiagonalDynamics
    from diag_dynamics.model import load_robot
    from diag_dynamics.model.example_robots import find_urdf
    from diag_dynamics.nodes.encoded.topic_bits import ORDER
    from diag_dynamics.nodes.monitor.described import matrix
    from diag_dynamics.nodes.monitor.markers import MarkerMaker
    from diag_dynamics.nodes.monitor.outputs import TYPES
    from diag_dynamics.nodes.support.messages import MessageMaker
    from diag_dynamics.parameters.monitor import RATES
    from diag_dynamics.views.scene import Scene

    ours = {
        one.name: one.type.rpartition("/")[2]
        for one in INTERFACES["monitor"]
        if one.kind == OUT and one.name.startswith("~/")
    }
    assert ours == {f"~/{name}": kind.__name__ for name, kind in TYPES.items()}
    assert set(TYPES) == set(RATES)
    dynamics = DiagonalDynamics(load_robot("panda"))
    zero, maker = np.zeros(dynamics.model.nv), MessageMaker(dynamics.model)
    state = RobotState(dynamics.model.neutral, zero, zero, 0, 0, False)
    evaluated = dynamics.evaluate(state.position, zero, zero)
    for topic in TOPICS:
        if topic.matrix:
            made = matrix(topic.name, maker, dynamics, state)
        elif topic.name == "markers":
            made = MarkerMaker(Scene(dynamics, find_urdf("panda"))).message(evaluated, state)
        elif topic.name == "contact":
            made = maker.contact(dynamics.contact(state.position, zero, [("tip", "panda_hand")]), state)
        elif not topic.beside:
            made = getattr(maker, topic.name)(evaluated, state)
        else:  # of a residual
            observer = DisturbanceObserver(dynamics, gain=1.0, threshold=2.0)
            made = getattr(maker, topic.name)(Disturbance(True, "", zero, zero, 0.0, False), observer, state)
        assert type(made) is TYPES[topic.name]
    # In step with matrices last and topics beside the others aside, which publishing relies on.
    assert tuple(topic.name for topic in TOPICS if not topic.beside) == ORDER


OF_EVERY_NODE = {name for name, _ in MANAGED} | {
    f"~/{name}"
    for name in (
        "describe_parameters",
        "get_parameter_types",
        "get_parameters",
        "list_parameters",
        "set_parameters",
        "set_parameters_atomically",
        "get_type_description",
    )
}
"""Services that every managed node offers."""

EVERY_NODE = {"~/transition_event", "/rosout", "/parameter_events"}
"""Topics that every managed node publishes."""


@pytest.mark.parametrize("node", NODES)
def test_interfaces_are_those_of_the_graph(node):
    """The same as in the policy of access, which test_security.py holds to what is on the graph."""
    policy = ET.parse(ROOT / "config" / "sros2_policy.xml").getroot()
    profiles = policy.findall(f".//profile[@node='{NODES[node]}']") + policy.findall(
        f".//profile[@node='{NODES[node]}_reading']"
    )
    for kind, path in (
        (IN, "topics[@subscribe]/topic"),
        (OUT, "topics[@publish]/topic"),
        (SERVICE, "services[@reply]/service"),
    ):
        listed = {one.name for one in INTERFACES[node] if one.kind == kind}
        allowed = {element.text for profile in profiles for element in profile.findall(path)}
        if kind == SERVICE:
            allowed = {name for name in allowed if name not in OF_EVERY_NODE}
        assert listed == allowed - EVERY_NODE


def interface_files():
    return sorted((ROOT / "msg").glob("*.msg")) + sorted((ROOT / "srv").glob("*.srv"))


@pytest.mark.parametrize("path", interface_files(), ids=lambda path: path.name)
def test_interfaces_page_lists_every_field(path):
    """With its type; its comment is compared by whoever generates the page."""
    section = text_of("interfaces.md").split(f"\n### {path.stem}\n")[1].split("\n### ")[0]
    rows = re.findall(r"^\| `(\w+)(?: = \d+)?` \| (?:`([^`]+)`|\[(\w+)\]\(#\w+\)) \|", section, re.M)
    fields = []
    for line in path.read_text(encoding="utf-8").splitlines():
        words = line.split("#")[0].replace("=", " ").split()
        if len(words) >= 2:
            fields.append((words[1], words[0].removeprefix("diag_dynamics/")))
    assert [(name, own or other) for name, other, own in rows] == fields


def test_every_topic_has_a_direction():
    assert {one.kind for table in INTERFACES.values() for one in table} == {IN, OUT, SERVICE}


# --- Pages ---


def anchors(path):
    """Anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"^```.*?^```", "", path.read_text(encoding="utf-8"), flags=re.S | re.M)
    return {
        re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")
        for heading in re.findall(r"^#+ (.*)$", text, re.M)
    }


def test_links_lead_somewhere():
    """Every link to a file of ours, and to a heading in it."""
    for page in PAGES:
        for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
            if re.match(r"https?:", target):
                continue
            file, _, anchor = target.partition("#")
            path = (page.parent / file).resolve() if file else page
            assert path.exists(), f"{page.name}: {target}"
            if anchor:
                assert anchor in anchors(path), f"{page.name}: {target}"


def test_pages_that_code_names_are_there():
    """A comment, a message or a test that sends somebody to docs/… sends them to a page."""
    folders = ("benchmarks", "config", "diag_dynamics", "docs", "launch", "msg", "scripts", "srv", "test")
    no_text = (".jpg", ".png", ".pyc")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.*") if path.suffix not in no_text]
    for path in (ROOT / "README.md", *files):
        for name in re.findall(r"\bdocs/((?:howto/|api/)?\w+\.md)\b", path.read_text(encoding="utf-8")):
            assert (DOCS / name).is_file(), f"{path.relative_to(ROOT)}: docs/{name}"


def test_architecture_names_what_is_there():
    """Every file, and every test, that the page names."""
    named = re.findall(r"`([^`\s]+)`", text_of("architecture.md"))
    paths = [name for name in named if re.fullmatch(r"[\w/.]+\.(?:py|md|yaml|txt)", name) and "/" in name]
    assert len(paths) > 35
    assert [name for name in paths if not (ROOT / name).is_file()] == []
    tests = [name for name in named if name.startswith("test_")]
    for name in tests:
        file, _, function = name.partition("::")
        if not function and not file.endswith(".py"):
            file, function = "test_package.py", file
        (path,) = (ROOT / "test").rglob(file)
        assert not function or f"\ndef {function}(" in path.read_text(encoding="utf-8"), name
    bare = [name for name in named if re.fullmatch(r"(?!test_)\w+\.py", name)]
    assert [name for name in bare if not list((ROOT / "diag_dynamics").rglob(name))] == []


def test_architecture_draws_the_floors():
    """The drawing has every room of FLOORS, floor above floor."""
    drawing = text_of("architecture.md").split("```text\n")[2].split("```")[0]
    rooms = [line[:55].split() for line in drawing.splitlines() if not line.startswith("--")]
    drawn = [sorted(room.removesuffix(".py").rstrip("/") for room in line) for line in rooms]
    assert drawn == [sorted(floor.split()) for floor in reversed(FLOORS)]


@pytest.mark.parametrize("page", [page for page in PAGES if blocks_of(page)], ids=lambda page: page.stem)
def test_blocks_say_whether_they_are_run(page):
    """By one of the ways that test/support/pages.py knows; who is not run has a reason."""
    named = {"run until", "run in the background", "hear", "end", "not run"}
    ways = named | {"run", "run in a folder of recordings", "parameters of monitor", "columns of a table"}
    for block in blocks_of(page):
        if block.language == "text":
            continue
        assert block.how in ways, f"{page.name}, line {block.line}"
        assert bool(block.what) == (block.how in named), f"line {block.line}"
        for name in re.findall(r"test_\w+\.py", block.what):
            assert list((ROOT / "test").rglob(name)), f"{page.name}, line {block.line}: no {name}"


def test_commands_stand_in_blocks_that_say_so():
    """Lines that are merely indented would be run by nothing; those for a container daemon or systemd are."""
    for page in sorted(DOCS.rglob("*.md")):
        text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
        found = re.findall(r"^    (?:diag-dynamics|ros2|pip|make|import) .*", text, re.M)
        assert found == [], page.name


@pytest.mark.parametrize("page", RUN, ids=lambda page: page.stem)
def test_blocks_run(page, tmp_path, monkeypatch, capfd):
    """One after the other in an empty folder; of parameters the monitor takes every name and value."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]))
    names = {}
    for block in blocks_of(page):
        where = f"{page.name}, line {block.line}"
        if block.how == "parameters of monitor":
            (tmp_path / "parameters.yaml").write_text(block.code, encoding="utf-8")
            values = parameters_of([tmp_path / "parameters.yaml"])
            written = yaml.safe_load(block.code)["/**"]["ros__parameters"]
            assert set(values) == {name for name, _ in flat(written)} <= set(node_parameters("monitor")), where
        elif block.how == "run" and block.language == "python":
            exec(compile("\n" * block.line + block.code, page.name, "exec"), names)
        elif block.how == "run":
            ours = f'diag-dynamics() {{ "{sys.executable}" -m diag_dynamics "$@"; }}'
            done = subprocess.run(["bash", "-euo", "pipefail", "-c", f"{ours}\n{block.code}"])
            assert done.returncode == 0, f"{where}: {capfd.readouterr().err}"


def test_every_example_is_shown():
    """On the page of examples, as it stands in its file."""
    shown = re.findall(r"\{literalinclude\} \.\./examples/(\w+\.py)", text_of("examples.md"))
    assert sorted(shown) == sorted(path.name for path in (ROOT / "examples").glob("*.py"))


def test_quick_starts_are_the_files():
    """The parameters of each robot stand in a file, and in the page as they are in the file."""
    files = {path.name: path.read_text(encoding="utf-8") for path in (ROOT / "config" / "robots").glob("*.yaml")}
    shown = [block.code for block in blocks_of(DOCS / "quickstart.md") if block.language == "yaml"]
    names = re.findall(r"^`(\w+\.yaml)`:$", text_of("quickstart.md"), re.M)
    assert dict(zip(names, shown, strict=True)) == files
    assert len(files) == 6


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_lines_can_be_read(page):
    """They have up to 120 characters, but for tables, code, comments, pictures and addresses without a place to break."""
    text = re.sub(r"^```.*?^```", "", page.read_text(encoding="utf-8"), flags=re.S | re.M)
    for line in text.splitlines():
        assert not re.match(r" *\+ ", line), f"{page.name}: a sum that is broken before its plus is a list: {line}"
        if line.startswith(("|", "    ", "<!--", "![")) or len(line) <= 120:
            continue
        assert max(map(len, line.split())) > 100, f"{page.name}: {line}"


def test_the_readme_is_short():
    """A sentence, pictures, install, the equations, a program, the nodes, links: the rest is in docs/."""
    assert (ROOT / "README.md").stat().st_size <= 9000
