# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fleet's archive: a task for each recording, on real schedulers and workers, restarted, and killed midway."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("distributed", reason="distributed is not installed")
pytest.importorskip("pyarrow", reason="pyarrow is not installed")
import distributed
from mcap.writer import Writer
from pyarrow import parquet
from test_pieces import analysed, compare, good, unordered

import diag_dynamics as dd
from bags import TEXT
from diag_dynamics.cli.main import main
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.recordings.fleet.table import KINDS, text_of
from diag_dynamics.recordings.histogram import Histogram
from diag_dynamics.recordings.summary import summary_of
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import message_type
from hostile import JOINT_STATE, START, S, hostile

pytestmark = [pytest.mark.full]

PIECE = 4.0
ROOT = Path(__file__).parents[2]


def write(path, pairs, robot):
    """Joint states and the description of their robot, as the library mcap writes them."""
    description = message_type("std_msgs/msg/String")(data=Path(find_urdf(robot)).read_text(encoding="utf-8"))
    with open(path, "wb") as file:
        writer = Writer(file, chunk_size=20_000)
        writer.start(profile="ros2")
        text = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/robot_description", "cdr", text)
        writer.add_message(channel, START, Template(description).encoded(), START)
        states = writer.register_schema(JOINT_STATE, "ros2msg", TEXT.encode())
        channel = writer.register_channel("/joint_states", "cdr", states)
        for raw, now in pairs:
            writer.add_message(channel, now, raw, now)
        writer.finish()


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Folder of recordings of two robots: short ones, a long one, one with everything wrong; one empty, one no bag."""
    folder = tmp_path_factory.mktemp("archive")
    panda, ur5 = dd.load_robot("panda"), dd.load_robot("ur5")
    for day in ("monday", "tuesday"):
        (folder / day).mkdir()
    write(folder / "monday" / "arm.mcap", good(panda, 3.0), "panda")
    write(folder / "monday" / "long shift.mcap", good(panda, 14.0, seed=2), "panda")
    write(folder / "tuesday" / "arm.mcap", good(ur5, 3.0, seed=3), "ur5")
    write(folder / "tuesday" / "hostile.mcap", hostile(panda, 4), "panda")
    write(folder / "tuesday" / "idle.mcap", [], "panda")
    (folder / "tuesday" / "broken.mcap").write_bytes(np.random.default_rng(0).bytes(5000))
    return folder


GOOD = "monday/arm.mcap", "monday/long shift.mcap", "tuesday/arm.mcap", "tuesday/hostile.mcap"
BAD = "tuesday/broken.mcap", "tuesday/idle.mcap"


@pytest.fixture(scope="module")
def expected(archive):
    """What is said of each recording that is analysed by itself, in one piece."""
    return {str(archive / name): summary_of(analysed(archive / name, None, {})) for name in GOOD}


def check(report, out, expected, archive):
    """All recordings are analysed as by themselves, and those that cannot be are told of."""
    assert set(report["failed"]) == {str(archive / name) for name in BAD}
    assert [row["recording"] for row in report["recordings"]] == list(expected)
    summaries = {}
    for path in out.glob("*.json"):
        if path.name != "fleet.json":
            summary = json.loads(path.read_text(encoding="utf-8"))
            summaries[summary["recording"]] = path, summary
    assert summaries.keys() == expected.keys()
    for recording, (path, summary) in summaries.items():
        whole = json.loads(json.dumps(expected[recording]))
        compare(unordered({key: summary[key] for key in whole}), unordered(whole))
        columns = parquet.read_table(path.with_suffix(".parquet"))
        assert columns.num_rows == whole["states"]
        assert columns["stamp"].to_numpy()[[0, -1]].tolist() == pytest.approx([whole["begin"] * S, whole["end"] * S])
        assert np.max(columns["kinetic_energy"].to_numpy()) == whole["kinetic_energy"]["max"]
    assert not (out / ".unfinished").exists()
    told = json.loads((out / "fleet.json").read_text(encoding="utf-8"))
    assert told == json.loads(json.dumps(report))
    table = parquet.read_table(out / "fleet.parquet")
    assert table.num_rows == len(GOOD) + len(BAD)
    assert {name: str(table.schema.field(name).type) for name in KINDS} == {
        name: kind.replace("float64", "double") for name, kind in KINDS.items()
    }
    for row, given in zip(table.to_pylist(), report["recordings"], strict=False):  # those that failed come behind
        assert {name: row[name] for name in given} == given


@pytest.fixture(scope="module")
def analysed_once(archive, tmp_path_factory):
    """What is written by processes of this machine."""
    out, told = tmp_path_factory.mktemp("out"), []
    report = dd.analyse_fleet(
        [str(archive / "**" / "*.mcap")],
        out,
        workers=2,
        piece=PIECE,
        progress=lambda done, count, path: told.append((done, count)),
    )
    assert told == [(k + 1, len(GOOD) + len(BAD)) for k in range(len(GOOD) + len(BAD))]
    return report, out


def test_fleet_on_this_machine(analysed_once, archive, expected):
    report, out = analysed_once
    check(report, out, expected, archive)
    assert (report["computed"], report["kept"]) == (len(GOOD), 0)
    assert "not a single state" in report["failed"][str(archive / BAD[1])]
    assert [row["pieces"] for row in report["recordings"]] == [1, 4, 1, 2]


def test_robots_are_told_of_together(analysed_once, expected):
    report, _ = analysed_once
    panda, ur5 = report["robots"]
    assert (panda["robot"], panda["recordings"]) == ("panda", 3)
    assert (ur5["robot"], ur5["recordings"]) == ("ur5", 1)
    of = [summary for summary in expected.values() if summary["robot"] == "panda"]
    highest = max(of, key=lambda one: one["kinetic_energy"]["max"])
    assert panda["kinetic_energy"]["max"] == highest["kinetic_energy"]["max"]
    assert expected[panda["kinetic_energy"]["recording"]] is highest
    assert sum(one["states"] for one in panda["kinetic_energy"]["histogram"]) == panda["states"]
    assert panda["states"] == sum(one["states"] for one in of)
    assert panda["rejected"] == {
        cause: sum(one["rejected"].get(cause, 0) for one in of) for one in of for cause in one["rejected"]
    }
    assert sum(panda["rejected"].values()) > 10
    assert [robot["collisions"] for robot in report["robots"]] == [None, None]  # there are no thresholds
    assert [robot["unjudged"] for robot in report["robots"]] == [3, 1]
    assert {row["collisions"] for row in report["recordings"]} == {None}
    assert text_of(report | {"computed": 4, "kept": 0, "failed": {}}).count("nothing is known of collisions") == 2
    variance = {name: variance_of([one["balance"]["moments"][name] for one in of]) for name in ("kinetic", "residual")}
    assert panda["explained"] == pytest.approx(1.0 - variance["residual"] / variance["kinetic"], rel=1e-9)
    assert ur5["explained"] == pytest.approx(next(x for x in expected.values() if x["robot"] == "ur5")["explained"])


def variance_of(told):
    """Variance of all values, by number, mean and sum of squared distances from the mean of several lots of them."""
    count = sum(one["count"] for one in told)
    mean = sum(one["count"] * one["mean"] for one in told) / count
    return sum(one["squares"] + one["count"] * (one["mean"] - mean) ** 2 for one in told) / count


def modified(out):
    """When each summary of a single recording was written, by name."""
    return {path.name: path.stat().st_mtime_ns for path in out.glob("*.json") if path.name != "fleet.json"}


def test_restart(analysed_once, archive):
    """Nothing is computed again but what is not there, or would be another; the bad ones are tried again."""
    _, out = analysed_once
    patterns = [str(archive / name) for name in GOOD]

    def again(**options):
        before = modified(out)
        report = dd.analyse_fleet(patterns, out, workers=1, piece=PIECE, **options)
        after = modified(out)
        return report, {name for name in after if after[name] != before.get(name)}

    report, written = again()
    assert (report["computed"], report["kept"], written) == (0, len(GOOD), set())

    lost = next(out.glob("monday-arm-*.parquet"))
    lost.unlink()
    report, written = again()
    assert (report["computed"], written) == (1, {lost.with_suffix(".json").name})
    assert lost.exists()

    touched = archive / "tuesday" / "arm.mcap"
    os.utime(touched, ns=(touched.stat().st_atime_ns, touched.stat().st_mtime_ns + S))
    _, written = again()
    assert {name.rpartition("-")[0] for name in written} == {"tuesday-arm"}

    report, written = again(parameters={"absurd.jump": 0.5})
    assert report["computed"] == len(written) == len(GOOD)


class Cluster:
    """A scheduler and two workers, processes of their own."""

    def __init__(self, folder, stack):
        self._folder, self._stack = folder, stack
        self._scheduler = folder / "scheduler.json"
        self._start("scheduler", "--port", "0", "--no-dashboard", "--host", "127.0.0.1")
        self.workers = {
            name: self._start("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard", "--name", name)
            for name in ("first", "second")
        }
        self.client = stack.enter_context(distributed.Client(scheduler_file=str(self._scheduler), timeout=120))
        self.client.wait_for_workers(2, timeout=120)
        self.address = self.client.scheduler.address

    def _start(self, what, *arguments):
        log = self._stack.enter_context((self._folder / f"{what}.log").open("ab"))
        command = [sys.executable, "-m", "dask", what, "--scheduler-file", str(self._scheduler), *arguments]
        process = subprocess.Popen(command, cwd=ROOT, stdout=log, stderr=log)
        self._stack.callback(process.wait)
        self._stack.callback(process.kill)
        return process

    def kill_one_at_work(self):
        """Kill a worker in the midst of a task; returns its process, and what it was at."""
        names = {address: of["name"] for address, of in self.client.scheduler_info()["workers"].items()}
        again = threading.Event()
        for _ in range(600):
            for address, working in self.client.processing().items():
                if working:
                    process = self.workers[names[address]]
                    process.send_signal(signal.SIGKILL)
                    return process, working
            again.wait(0.05)
        raise AssertionError("no worker has anything to do")


def test_killed_worker(tmp_path, archive, expected):
    """Whatever a worker was at when it was killed, and what it had not handed over, another one does."""
    with ExitStack() as stack:
        cluster, killed = Cluster(tmp_path, stack), []

        def progress(done, count, path):
            if not killed:
                killed.extend(cluster.kill_one_at_work())

        report = dd.analyse_fleet(
            [str(archive / "**" / "*.mcap")],
            tmp_path / "out",
            scheduler=cluster.address,
            piece=PIECE,
            progress=progress,
        )
        assert killed[0].wait(60) == -signal.SIGKILL and killed[1]
        assert len(cluster.client.scheduler_info()["workers"]) == 1
    check(report, tmp_path / "out", expected, archive)


def test_command(tmp_path, archive, capsys):
    arguments = ["analyse", "--fleet", str(archive / "tuesday" / "*.mcap"), "--out", str(tmp_path), "--no-parquet"]
    status = main([*arguments, "--workers", "1", "--piece", "4"])
    told = capsys.readouterr()
    assert status == 1  # there are bad ones
    assert "Robot 'ur5': 1 recordings" in told.out
    assert "2 recordings analysed; 2 failed" in told.out
    assert "4 of 4 recordings" in told.err
    assert not list(tmp_path.glob("*.parquet"))
    assert main([*arguments, "--quiet", "--workers", "1"]) == 1
    assert capsys.readouterr() == ("", "")
    before = ["analyse", arguments[2], "--fleet", *arguments[3:], "--quiet", "--workers", "1"]  # as well as behind it
    assert main(before) == 1
    assert capsys.readouterr() == ("", "")
    for wrong, what in (
        (["analyse", "--fleet", "nothing.mcap", "--out", str(tmp_path)], "there is no recording 'nothing.mcap'"),
        (["analyse", "--fleet", str(archive)], "--fleet needs --out"),
        ([*arguments, "--csv", "x.csv"], "--csv is of a single recording"),
        ([*arguments, "--topics", "state"], "--topics is of a single recording"),
        ([*arguments, "--workers", "0"], "--workers is 0"),
        ([*arguments, "--piece", "0"], "piece is 0.0"),
    ):
        assert main(wrong) == 2
        assert what in capsys.readouterr().err


def test_reports_and_the_page_that_leads_to_them(tmp_path, archive, expected, capsys):
    """Each recording has its report; the page has a row for each, whose links are there, and what is wrong with others."""
    chosen = [str(archive / name) for name in (GOOD[0], GOOD[1], BAD[1])]
    command = ["analyse", "--fleet", *chosen, "--out", str(tmp_path), "--no-parquet", "--piece", "4", "--workers", "2"]
    assert main([*command, "--reports"]) == 1  # there is a bad one
    page = (tmp_path / "fleet.html").read_text(encoding="utf-8")
    links = re.findall('href="([^"]*[.](?:html|json))"', page)
    assert len(links) == 4
    assert all((tmp_path / link).exists() for link in links)
    reports = {path for path in map(tmp_path.joinpath, links) if path.suffix == ".html"}
    assert reports == set(tmp_path.glob("*.html")) - {tmp_path / "fleet.html"}
    for path in reports:
        (text,) = re.findall(r'id="report">(.*)</script>', path.read_text(encoding="utf-8"))
        told = json.loads(text)["summary"]
        whole = json.loads(json.dumps(expected[told["recording"]]))
        compare(unordered({key: told[key] for key in whole}), unordered(whole))
    rows = [re.findall('data-value="([^"]*)"', row) for row in page.split("<tr>")[2:]]
    assert [row[0] for row in rows] == chosen[:2]
    assert [int(row[3]) for row in rows] == [expected[name]["states"] for name in chosen[:2]]
    assert [float(row[4]) for row in rows] == [expected[name]["kinetic_energy"]["max"] for name in chosen[:2]]
    assert [row[8] for row in rows] == ["", ""]
    assert "nothing is known of contacts" in page and "0 contacts" not in page
    assert f"<li>{chosen[2]}: " in page
    capsys.readouterr()
    assert main([*command, "--reports"]) == 1
    assert "0 recordings analysed, 2 had been" in capsys.readouterr().out
    assert main([*command, "--report", "x.html"]) == 2
    assert "--report is of a single recording" in capsys.readouterr().err


def test_part_by_the_command(tmp_path, archive):
    path = tmp_path / "summary.json"
    main(["analyse", str(archive / GOOD[0]), "--start", "1", "--end", "2", "--json", str(path), "--quiet"])
    assert json.loads(path.read_text(encoding="utf-8"))["duration"] == pytest.approx(1.0, abs=0.005)


def test_one_pattern_is_no_list(tmp_path, archive):
    """Its letters would be the patterns."""
    with pytest.raises(dd.InputError, match="expected a list of paths"):
        dd.analyse_fleet(str(archive / GOOD[0]), tmp_path)


def test_without_dask(tmp_path, archive, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(dd.InputError, match=r"pip install 'dask\[distributed\]'"):
        dd.analyse_fleet([str(archive / GOOD[0])], tmp_path)


def test_histogram():
    values = np.array([0.0, 1e-12, 0.5, 0.999, 1.0, 1.2, 1.3, 99.0, -1.0])
    histogram = Histogram()
    for part in np.split(values, [2, 5]):
        one = Histogram()
        one.take(part)
        histogram.add(one)
    told = histogram.told()
    assert sum(one["states"] for one in told) == len(values)
    assert told[0] == {"from": 0.0, "to": 0.0, "states": 2}
    for one in told[1:]:
        assert one["states"] == np.sum((values >= one["from"] * (1 - 1e-15)) & (values < one["to"] * (1 - 1e-15)))
    assert Histogram.of(told).told() == told


def test_the_exit_status_is_that_of_a_recording_by_itself(tmp_path, capsys):
    """States too far apart for a balance, with efforts: worth a look in either way."""
    model, t = dd.load_robot("ur5"), 0.3 * np.arange(200.0)
    q, qd = 0.3 * np.sin(t)[:, None] * np.ones(model.nv), 0.3 * np.cos(t)[:, None] * np.ones(model.nv)
    path = tmp_path / "slow.csv"
    names = ["t", *(f"{kind}_{name}" for kind in ("q", "qd", "tau") for name in model.dof_names)]
    columns = np.column_stack([t, q, qd, np.ones_like(q)])
    np.savetxt(path, columns, delimiter=",", header=",".join(names), comments="")
    assert main(["analyse", str(path), "--urdf", "ur5"]) == 1
    assert "there are efforts, but no balance of power" in capsys.readouterr().err
    out = tmp_path / "out"
    assert main(["analyse", "--fleet", str(path), "--urdf", "ur5", "--out", str(out), "--no-parquet"]) == 1
    (row,) = json.loads((out / "fleet.json").read_text(encoding="utf-8"))["recordings"]
    assert row["wrong"] == "there are efforts, but no balance of power"
