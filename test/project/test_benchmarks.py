# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The benchmarks in their short form: outputs are compared, every ratio is computed. Never a time."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytestmark = [pytest.mark.full]

if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") != "1":  # where everything is installed, they have to be here
    pytest.importorskip("mujoco", reason="mujoco is not installed: a peer of the benchmarks is missing")
    pytest.importorskip("matplotlib", reason="matplotlib is not installed: the benchmarks cannot draw")

ROOT = Path(__file__).parents[2]
BENCHMARKS = ROOT / "benchmarks"
PLOTS = ("dof.png", "growth.png", "batch.png")

# What the project has targets for, as the lines of the table begin.
TARGETS = [
    ("`evaluate`", "`pin.aba`", "6–9 dof", 0.9),
    ("`evaluate`, then its 8 fields", "`pin.aba`", "6–9 dof", 1.5),
    ("`evaluate` with `out=`", "`pin.aba`", "6–9 dof", 1.1),
    ("`evaluate`", "`pin.aba`", "29–50 dof", 0.6),
    ("`evaluate`", "NumPy and Pinocchio route", "all robots", 0.1),
    ("`forward_dynamics`", "`pin.aba`", "6–50 dof", 0.7),
    ("`factors`", "`crba`", "6–50 dof", 0.5),
    ("`evaluate_batch` per state", "`pin.abaInParallel`", "6–9 dof", 0.4),
    ("`evaluate_batch` with `out=`", "`pin.abaInParallel`", "6–9 dof", 0.18),
    ("`evaluate_batch` of 2000 states", "`pin.abaInParallel`", "6–9 dof", 0.3),
    ("`evaluate_batch` per state", "", "6–9 dof", 1.25),
    ("`Simulation.advance` per step", "Python loop", "panda", 0.15),
    ("growth", "exponent", "serial chains, balanced trees", 1.05),
    ("allocations of compiled code", "each further one", "7 dof", 0.001),
    ("memory of `evaluate_stream`", "that of", "7 dof", 1.1),
    ("import to first result", "`import numba` + `import yourdfpy`", "panda", 1.3),
]


def run(folder, *arguments):
    """Run Python with the benchmarks to be imported, in a folder where it may leave what it likes."""
    path = os.pathsep.join(filter(None, (str(ROOT), str(BENCHMARKS), os.environ.get("PYTHONPATH"))))
    command = [sys.executable, *map(str, arguments)]
    return subprocess.run(
        command, cwd=folder, env=os.environ | {"PYTHONPATH": path}, capture_output=True, text=True, timeout=1800
    )


def summary(path):
    """The table between the markers of a file, as text."""
    return re.search("<!-- benchmarks: begin -->\n(.*)<!-- benchmarks: end -->", path.read_text("utf-8"), re.S)[1]


def cells(table):
    """The lines of a table below its head."""
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines()[2:]]


def check(table, complete=True):
    """Every target has its line in the order of the targets, every ratio is a number, and verdicts are right.

    A table that is not complete was made before some of the targets were set.
    """
    judged = []
    for subject, peer, over, target, median, worst, verdict in cells(table):
        median, worst = float(median), float(worst.split(" ")[0])
        assert np.isfinite([median, worst]).all()
        assert 0.0 <= median <= worst
        assert median > 0.0 or subject.startswith("allocations")
        assert bool(target) == bool(verdict)
        if target:
            limit = float(target.removeprefix("≤ "))
            judged.append((subject, peer, over, limit))
            if abs(worst - limit) > 0.01:  # else the table does not show enough digits to tell
                assert verdict == ("met" if worst <= limit else "missed")
    targets = iter(TARGETS)
    for *shown, limit in judged:  # each is the next of the targets, or one that comes later
        assert any(_is_of(shown, limit, target) for target in targets), shown
    assert len(judged) == len(TARGETS) or not complete


def _is_of(shown, limit, target):
    *expected, number = target
    return limit == number and all(text.startswith(begin) for text, begin in zip(shown, expected, strict=True))


def test_short_form(tmp_path, compiled):
    before = {path: path.stat().st_mtime_ns for path in (BENCHMARKS / "results").glob("*")}
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", "library", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    assert re.search(r"outputs of \d+ robots agree to \de-\d\d", done.stderr)
    table = summary(tmp_path / "results" / "table.md")
    assert table in done.stdout
    check(table)
    for plot in PLOTS:
        assert (tmp_path / "results" / plot).read_bytes().startswith(b"\x89PNG")
    assert before == {path: path.stat().st_mtime_ns for path in before}


def test_short_form_of_alarms(tmp_path, compiled):
    """Both observers are calibrated by one procedure, and see pushes of 40 N on the simulated arm."""
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", "alarms", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "results" / "alarms.md").read_text(encoding="utf-8")
    rows = [row for row in cells("\n\n" + text.split("## Panda, simulated")[1]) if row[0] == "all"]
    assert [row[1] for row in rows] == ["total rates", "momenta"]
    for row in rows:
        assert int(row[6].split(" of ")[0]) >= 9 and row[6].endswith(" of 10")


def test_short_form_of_contact(tmp_path, compiled):
    """What contact takes of an evaluation, and that both limiters keep the limit which is broken without them."""
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", "contact", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "results" / "contacts.md").read_text(encoding="utf-8")
    (row,) = (line for line in text.splitlines() if line.startswith("| talos_reduced"))
    assert all(float(part) > 0.0 for part in re.findall(r"× ([\d.]+)", row))
    assert "Target of Talos' mobilities: × 2" in text
    text = (tmp_path / "results" / "contact_limit.md").read_text(encoding="utf-8")
    nothing, contact, energy = (float(row[1]) for row in cells(text.split("## Panda")[1].split("\n\n")[1]))
    assert contact <= 1.0 < nothing
    assert energy <= 1.0


def test_short_form_of_the_observer(tmp_path, compiled):
    """Two arms, right and wrong model, two gains, five detectors: every row is there, and the picture."""
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", "observer", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "results" / "observer.md").read_text(encoding="utf-8")
    assert text in done.stdout
    rows = re.findall(r"^\| ((?:ν|momenta): .*?) \| (\d+)% \| .* \| (\d+)% \| [\d.]+ \|$", text, re.M)
    assert len(rows) == 2 * 2 * 2 * 5 and len({row[0] for row in rows}) == 5
    assert all(0 <= float(part) <= 100 for row in rows for part in row[1:])
    assert (tmp_path / "results" / "observer.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("call", ["aba", "aba_default", "dense_evaluate", "dense_factors"])
def test_disagreement_is_an_error_before_anything_is_timed(call, tmp_path, compiled):
    script = f"""
import peers, run
calls = peers.Pinocchio.calls
def wrong(*arguments):
    exact = calls(*arguments)
    def perturbed():
        result = exact["{call}"]()
        (result[0] if isinstance(result, tuple) else result)[...] *= 1.0 + 1e-7
        return result
    return exact | {{"{call}": perturbed}}
peers.Pinocchio.calls = wrong
run.main()
"""
    done = run(tmp_path, "-c", script, "--short", "--only", "library")
    assert done.returncode != 0
    assert re.search(r"outputs disagree: kinova: .* differs by", done.stderr)
    assert "measures" not in done.stderr
    assert "|" not in done.stdout


def test_what_is_compared(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from agreement import TOLERANCE, DisagreementError, compare

    x = np.array([1.0, -2.0, 3.0])
    assert compare("robot", "x", x, x) == 0.0
    assert compare("robot", "x", x * (1 + 0.5 * TOLERANCE), x) > 0.0
    for wrong in (x * (1 + 2 * TOLERANCE), x[::-1], np.array([1.0, np.nan, 3.0]), x * np.inf):
        with pytest.raises(DisagreementError, match=r"^robot: x differs by"):
            compare("robot", "x", wrong, x)
    with pytest.raises(DisagreementError, match="x has shape"):
        compare("robot", "x", x[:2], x)


def test_a_file_is_no_folder_to_write_into(tmp_path):
    file = tmp_path / "file"
    file.touch()
    done = run(tmp_path, BENCHMARKS / "run.py", "--short", "--only", "library", "--output", file)
    assert done.returncode == 2
    assert "file is not a folder" in done.stderr


def test_results_show_what_was_measured():
    check(summary(BENCHMARKS / "results" / "table.md"), complete=False)
    for plot in PLOTS:
        assert (BENCHMARKS / "results" / plot).is_file()


# --- The nodes ---


NODE_PLOTS = ("nodes_latency.png", "nodes_rates.png")
QUANTITIES = ("CPU time per joint state", "median latency", "p99 latency", "highest lossless rate")
SETS = ("all", "kinetic_energy")


@pytest.fixture
def domain(request):
    """Return a ROS domain of our own, where ROS is."""
    if os.environ.get("DIAG_DYNAMICS_REQUIRE_ROS") != "1":
        pytest.importorskip("rclpy", reason="rclpy is not installed: nodes cannot be measured")
    return request.getfixturevalue("ros_domain")


def check_nodes(page):
    """Every quantity has its line for either serialization and either set of topics, and verdicts are right."""
    table = page[page.index("| measured") :].split("\n\n")[0]
    seen = []
    for quantity, serialization, topics, target, shown, verdict in cells(table):
        relation, limit = target.split(" ")
        bound = shown.startswith("at least ")  # something else was the limit
        value, limit = float(shown.removeprefix("at least ").split(" ")[0]), float(limit)
        assert np.isfinite(value)
        assert value > 0.0
        if abs(value - limit) > 0.01:  # else the table does not show enough digits to tell
            met = value <= limit if relation == "≤" else value >= limit
            wrong = (
                re.escape("missed") if not bound else "not shown: (listener|machine|feeder|queue|none) was the limit"
            )
            assert re.fullmatch("met" if met else wrong, verdict)
        seen.append((serialization, topics, quantity))
    assert seen == [(kind, topics, what) for kind in ("template", "rclpy") for topics in SETS for what in QUANTITIES]


def check_source(page):
    """The report shows the floor's source as it is."""
    assert f"```python\n{(BENCHMARKS / 'graph' / 'relay.py').read_text('utf-8')}```\n" in page


@pytest.mark.ros
def test_short_form_of_the_nodes(domain, tmp_path):
    script = """
import json, run
from graph import compare
measure = compare.measure
def kept(plan):
    found = measure(plan)
    bursts = [burst for part in found[:3] for bursts in part.values() for burst in bursts]
    counts = [(burst.sent, burst.received, len(burst.latencies), burst.latencies.min()) for burst in bursts]
    with open("found.json", "w") as file:
        json.dump({"counts": counts, "sizes": found.sizes}, file)
    return found
compare.measure = kept
run.main()
"""
    done = run(tmp_path, "-c", script, "--short", "--only", "nodes", "--output", tmp_path / "results")
    assert done.returncode == 0, done.stderr
    found = json.loads((tmp_path / "found.json").read_text())
    for sent, received, timed, earliest in found["counts"]:
        assert 0 < received <= sent
        assert timed == received
        assert earliest > 0.0
    sizes = found["sizes"]
    assert len(sizes["floor"]) == 8
    assert sizes["floor"] == sizes["template"] == sizes["rclpy"]
    page = (tmp_path / "results" / "nodes.md").read_text("utf-8")
    check_nodes(page)
    check_source(page)
    for plot in NODE_PLOTS:
        assert (tmp_path / "results" / plot).read_bytes().startswith(b"\x89PNG")
    assert not (tmp_path / "results" / "table.md").exists()


def test_what_was_measured_of_the_nodes_is_shown():
    page = (BENCHMARKS / "results" / "nodes.md").read_text("utf-8")
    check_nodes(page)
    check_source(page)
    for plot in NODE_PLOTS:
        assert (BENCHMARKS / "results" / plot).is_file()


@pytest.mark.ros
def test_nodes_with_messages_of_other_sizes_are_not_compared(domain, monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from graph.compare import GraphError, same_sizes

    same_sizes({"floor": {"state": 796}, "template": {"state": 796}})
    with pytest.raises(GraphError, match="on state of template have 800 bytes, expected 796"):
        same_sizes({"floor": {"state": 796}, "template": {"state": 800}})


@pytest.mark.parametrize("limit", [300.0, 1000.0, 2999.0, 12345.0])
def test_the_highest_lossless_rate_is_found(limit, monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from graph.sweep import Search, highest, search

    class Node:
        def burst(self, rate, seconds):
            loss = max(0.0, 1.0 - limit / rate)
            return SimpleNamespace(asked=rate, rate=rate, loss=loss, backlog=0.0, kept=True, limit="node")

    rate, who = highest(search(Node(), Search()))
    assert 0.95 * limit < rate <= 1.002 * limit  # what may be lost of a lossless rate is 0.1 %
    assert who == "node"


def test_a_node_that_lives_on_its_queue_is_not_served(monkeypatch):
    """Nothing is lost beyond 2 kHz, but more and more waits: no rate above that counts."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    from graph.sweep import BACKLOG, Search, highest, search

    class Node:
        def burst(self, rate, seconds):
            waiting = max(rate - 2000.0, 0.0) * seconds
            return SimpleNamespace(asked=rate, rate=rate, loss=0.0, backlog=waiting, kept=True, limit="node")

    rate, _ = highest(search(Node(), Search()))
    assert 1900.0 < rate <= 2000.0 + BACKLOG


def test_a_feeder_that_cannot_keep_up_ends_the_search(monkeypatch):
    monkeypatch.syspath_prepend(BENCHMARKS)
    from graph.sweep import Search, highest, search

    class Node:
        def burst(self, rate, seconds):
            return SimpleNamespace(
                asked=rate, rate=min(rate, 3000.0), loss=0.0, backlog=0.0, kept=rate < 3100.0, limit="feeder"
            )

    bursts = search(Node(), Search())
    assert highest(bursts) == (3000.0, "feeder")


def test_table_of_cold_starts(tmp_path):
    """Medians of what was measured, each with its target and a right verdict; nodes where there is a ROS 2."""
    script = (
        "import numpy as np, cold\n"
        "lines = [one for one in cold.starts() if one.target]\n"
        "found = [(one, np.array([3.0, one.target + 1.0, 99.0]), np.array([1.0, 2.0, 1.5])) for one in lines[:1]]\n"
        "found += [(one, np.array([one.target]), np.array([0.5])) for one in lines[1:]]\n"
        "print(len(lines)); print(cold.page(found, '', 'a machine'))"
    )
    said = run(tmp_path, "-c", script).stdout
    count, _, page = said.partition("\n")
    rows = [line.split(" | ") for line in page.splitlines() if line.startswith("| ") and "≤" in line]
    assert len(rows) == int(count) >= 3 and "Medians of 3" in page
    assert (rows[0][1], rows[0][3], rows[0][4]) == ("10.0", "missed", "1.5 |")
    assert all(row[3] == "met" for row in rows[1:])
