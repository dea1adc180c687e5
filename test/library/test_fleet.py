# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fleet's archive: each recording is analysed as by itself, in pieces or whole, once, whatever fails meanwhile.

Tasks run in threads of the test's process; those in processes, of which one is killed, are of the full tier.
"""

import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
from contextlib import ExitStack
from pathlib import Path

import distributed
import numpy as np
import pytest
from pyarrow import parquet

import diag_dynamics as dd
from bags import Message, arm, description, serialized, urdf_of, write_mcap
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from diag_dynamics.cli.main import main
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.recordings.fleet.table import KINDS, text_of
from hostile import MS, START, Driver, S, hostile

PIECE = 4.0
ROOT = Path(__file__).parents[2]
GOOD = "monday/arm.mcap", "monday/long shift.mcap", "tuesday/arm.mcap", "tuesday/hostile.mcap"
BAD = "tuesday/broken.mcap", "tuesday/idle.mcap"


def good(model, seconds, seed=1):
    """Return messages of one driver, 500 Hz with jitter, with times of reception."""
    driver, rng, count = Driver(model, seed), np.random.default_rng(seed), int(500 * seconds)
    stamps = START + np.arange(count) * 2 * MS + rng.integers(-1000, 1000, count)
    return [(driver.good(int(stamp)), int(stamp) + 200_000) for stamp in stamps]


def write(path, pairs, robot, **options):
    """Write joint states and the description of their robot; return the path."""
    path.parent.mkdir(exist_ok=True)
    states = [Message("/joint_states", now, raw) for raw, now in pairs]
    urdf = Path(find_urdf(robot)).read_text(encoding="utf-8")
    return write_mcap(path, [description(urdf, START), *states], chunk_size=20_000, **options)


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Folder of recordings of two robots: short, long, and hostile; without messages, and of garbage."""
    folder = tmp_path_factory.mktemp("archive")
    panda, ur5 = dd.load_robot("panda"), dd.load_robot("ur5")
    write(folder / GOOD[0], good(panda, 3.0), "panda")
    write(folder / GOOD[1], good(panda, 12.0, seed=2), "panda")
    write(folder / GOOD[2], good(ur5, 3.0, seed=3), "ur5")
    write(folder / GOOD[3], hostile(panda, 4), "panda")
    write(folder / BAD[1], [(serialized(START, ["elsewhere"], [0.0]), START)], "panda")
    (folder / BAD[0]).write_bytes(np.random.default_rng(0).bytes(5000))
    return folder


@pytest.fixture(scope="module")
def scheduler():
    """Address of a scheduler whose worker is a thread of this process."""
    options = {"n_workers": 1, "threads_per_worker": 1, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        yield cluster.scheduler_address


def alone(path, out, *options):
    """Return the summary of a recording that is analysed by itself."""
    assert main(["analyse", str(path), "--json", str(out), "--quiet", *map(str, options)]) in (0, 1)
    return json.loads(out.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def expected(archive, tmp_path_factory):
    out = tmp_path_factory.mktemp("expected") / "summary.json"
    return {str(archive / name): alone(archive / name, out) for name in GOOD}


def compare(one, other, where=""):
    """Assert that whole numbers, texts and times of two summaries are the same, others to 1e-12.

    Findings have an order of their own: the first ones of a cause may come in another piece than others.
    """
    if isinstance(other, dict):
        for key in other:
            compare(one[key], other[key], f"{where}.{key}")
    elif isinstance(other, list):
        assert len(one) == len(other), where
        if where.endswith(".findings"):
            one, other = (sorted(each, key=str) for each in (one, other))
        for k, pair in enumerate(zip(one, other, strict=True)):
            compare(*pair, f"{where}[{k}]")
    elif isinstance(other, float):
        assert math.isclose(one, other, rel_tol=1e-12, abs_tol=1e-14), f"{where}: {one} {other}"
    else:
        assert one == other, where


def check(report, out, expected, archive):
    """Assert that all recordings are analysed as by themselves, and those that cannot be are named."""
    assert set(report["failed"]) == {str(archive / name) for name in BAD}
    assert [row["recording"] for row in report["recordings"]] == list(expected)
    summaries = {}
    for path in out.glob("*-*.json"):
        summary = json.loads(path.read_text(encoding="utf-8"))
        summaries[summary["recording"]] = path, summary
    assert summaries.keys() == expected.keys()
    for recording, (path, summary) in summaries.items():
        whole = expected[recording]
        compare(summary, whole)
        columns = parquet.read_table(path.with_suffix(".parquet"))
        assert columns.num_rows == whole["states"]
        ends = columns["stamp"].to_numpy()[[0, -1]].tolist()
        assert ends == pytest.approx([whole["begin"] * S, whole["end"] * S])
        assert np.max(columns["kinetic_energy"].to_numpy()) == whole["kinetic_energy"]["max"]
    assert not (out / ".unfinished").exists()
    assert json.loads((out / "fleet.json").read_text(encoding="utf-8")) == json.loads(json.dumps(report))
    table = parquet.read_table(out / "fleet.parquet")
    assert table.num_rows == len(GOOD) + len(BAD)
    kinds = {name: str(table.schema.field(name).type).replace("double", "float64") for name in KINDS}
    assert kinds == KINDS
    for row, given in zip(table.to_pylist(), report["recordings"], strict=False):  # those that failed come behind
        assert {name: row[name] for name in given} == given


@pytest.fixture(scope="module")
def analysed(archive, scheduler, tmp_path_factory):
    """Report and folder of an archive that is analysed in the test's process."""
    out, told = tmp_path_factory.mktemp("out"), []
    report = dd.analyse_fleet(
        [str(archive / "**" / "*.mcap")],
        out,
        scheduler=scheduler,
        piece=PIECE,
        progress=lambda done, count, path: told.append((done, count)),
    )
    assert told == [(k + 1, len(GOOD) + len(BAD)) for k in range(len(GOOD) + len(BAD))]
    return report, out


def test_a_fleet_is_its_recordings(analysed, archive, expected):
    report, out = analysed
    check(report, out, expected, archive)
    assert (report["computed"], report["kept"]) == (len(GOOD), 0)
    assert "not a single state" in report["failed"][str(archive / BAD[1])]


def test_robots_are_reported_together(analysed, expected):
    report, _ = analysed
    panda, ur5 = report["robots"]
    assert (panda["robot"], panda["recordings"], ur5["robot"], ur5["recordings"]) == ("panda", 3, "ur5", 1)
    of = [summary for summary in expected.values() if summary["robot"] == "panda"]
    highest = max(of, key=lambda one: one["kinetic_energy"]["max"])
    assert panda["kinetic_energy"]["max"] == highest["kinetic_energy"]["max"]
    assert expected[panda["kinetic_energy"]["recording"]] is highest
    assert sum(one["states"] for one in panda["kinetic_energy"]["histogram"]) == panda["states"]
    assert panda["states"] == sum(one["states"] for one in of)
    causes = {cause for one in of for cause in one["rejected"]}
    assert panda["rejected"] == {cause: sum(one["rejected"].get(cause, 0) for one in of) for cause in causes}
    assert sum(panda["rejected"].values()) > 10
    assert [robot["collisions"] for robot in report["robots"]] == [None, None]  # there are no thresholds
    assert [robot["unjudged"] for robot in report["robots"]] == [3, 1]
    assert {row["collisions"] for row in report["recordings"]} == {None}
    assert text_of(report | {"failed": {}}).count("nothing is known of collisions") == 2
    variance = {name: variance_of([one["balance"]["moments"][name] for one in of]) for name in ("kinetic", "residual")}
    assert panda["explained"] == pytest.approx(1.0 - variance["residual"] / variance["kinetic"], rel=1e-9)


def variance_of(lots):
    """Return the variance of all values, by number, mean and sum of squared distances from the mean of each lot."""
    count = sum(one["count"] for one in lots)
    mean = sum(one["count"] * one["mean"] for one in lots) / count
    return sum(one["squares"] + one["count"] * (one["mean"] - mean) ** 2 for one in lots) / count


def test_restart(analysed, archive, scheduler, tmp_path):
    """Nothing is computed again but what is not there, or would be another; failures are tried again."""
    out = shutil.copytree(analysed[1], tmp_path / "out")
    patterns = [str(archive / name) for name in (*GOOD, BAD[0])]

    def modified():
        return {path.name: path.stat().st_mtime_ns for path in out.glob("*-*.json")}

    def again(**options):
        before = modified()
        report = dd.analyse_fleet(patterns, out, scheduler=scheduler, piece=PIECE, **options)
        after = modified()
        assert list(report["failed"]) == patterns[-1:]
        return report, {name for name in after if after[name] != before.get(name)}

    report, written = again()
    assert (report["computed"], report["kept"], written) == (0, len(GOOD), set())
    lost = next(out.glob("monday-arm-*.parquet"))
    lost.unlink()
    report, written = again()
    assert (report["computed"], written) == (1, {lost.with_suffix(".json").name}) and lost.exists()
    touched = archive / "tuesday" / "arm.mcap"
    os.utime(touched, ns=(touched.stat().st_atime_ns, touched.stat().st_mtime_ns + S))
    assert {name.rpartition("-")[0] for name in again()[1]} == {"tuesday-arm"}
    patterns = [str(archive / GOOD[0]), *patterns[-1:]]
    report, written = again(parameters={"absurd.jump": 0.5})
    assert report["computed"] == len(written) == 1


PARAMETERS = {
    "collisions": ["external_torque.gain=25", "external_torque.threshold=2"],
    "alarms": ["external_torque.gain=25", "alarm.joints=['*=35']", "alarm.norm=29", "alarm.release=0.95"],
    "standing offset": ["external_torque.gain=25", "alarm.joints=['*=30']", "alarm.standing=0.1"],
    "frozen values refused": ["frozen_values=refuse", "frozen_timeout=0.05"],
    "estimated velocities": ["missing_velocity=estimate"],
}
SLOW = {"estimated velocities", "frozen values refused"}


def test_topics_and_names_of_joints(tmp_path, scheduler):
    """Those of all recordings; another map is another result."""
    sent = [
        Message(topic, START + k * MS, serialized(START + k * MS, [name], [0.01 * k], [0.1], [1.0]))
        for k in range(40)
        for topic, name in (("/one", "left_a"), ("/two", "left_b"))
    ]
    path, given = write_mcap(tmp_path / "x.mcap", sent), {"topic": ["/one", "/two"], "joint_names": {"left_*": "*"}}
    for joint_names, computed, states in ((given["joint_names"], 1, 79), (given["joint_names"], 0, 79), (None, 0, 0)):
        report = dd.analyse_fleet(
            [path],
            tmp_path / "out",
            arm("a", "b"),
            scheduler=scheduler,
            parquet=False,
            **given | {"joint_names": joint_names},
        )
        assert report["computed"] == computed and sum(row["states"] for row in report["recordings"]) == states
    assert "--joint-names 'left_*=*'" in report["failed"][str(path)]


def test_the_command(tmp_path, archive, scheduler, capsys):
    arguments = ["analyse", "--fleet", str(archive / "tuesday" / "*.mcap"), "--out", str(tmp_path), "--no-parquet"]
    run = [*arguments, "--scheduler", scheduler]
    assert main([*run, "--piece", "4"]) == 1  # there are bad ones
    told = capsys.readouterr()
    assert "Robot 'ur5': 1 recordings" in told.out and "2 recordings analysed; 2 failed" in told.out
    assert "4 of 4 recordings" in told.err and not list(tmp_path.glob("*.parquet"))
    assert main(["analyse", run[2], "--fleet", *run[3:], "--quiet"]) == 1  # before --fleet as well as behind it
    assert capsys.readouterr() == ("", "")
    for wrong, what in (
        (["analyse", "--fleet", "nothing.mcap", "--out", str(tmp_path)], "there is no recording 'nothing.mcap'"),
        (["analyse", "--fleet", str(archive)], "--fleet needs --out"),
        ([*arguments, "--csv", "x.csv"], "--csv is of a single recording"),
        ([*arguments, "--report", "x.html"], "--report is of a single recording"),
        ([*arguments, "--topics", "state"], "--topics is of a single recording"),
        ([*arguments, "--workers", "0"], "--workers is 0"),
        ([*arguments, "--piece", "0"], "piece is 0.0"),
    ):
        assert main(wrong) == 2
        assert what in capsys.readouterr().err


def page_of(folder):
    """Return the text of a fleet's page, its links, and the values of its rows."""
    page = (folder / "fleet.html").read_text(encoding="utf-8")
    links = [folder / link for link in re.findall('href="([^"]*[.](?:html|json))"', page)]
    assert all(link.exists() for link in links)
    return page, links, [re.findall('data-value="([^"]*)"', row) for row in page.split("<tr>")[2:]]


def test_the_page(analysed, archive, expected):
    """A row for each recording, which leads to its summary; what is wrong with others is below."""
    page, links, rows = page_of(analysed[1])
    assert sorted(links) == sorted(analysed[1].glob("*-*.json"))
    assert [row[0] for row in rows] == list(expected) and {row[8] for row in rows} == {""}
    assert [int(row[3]) for row in rows] == [one["states"] for one in expected.values()]
    assert [float(row[4]) for row in rows] == [one["kinetic_energy"]["max"] for one in expected.values()]
    assert "nothing is known of contacts" in page and "0 contacts" not in page
    assert all(f"<li>{archive / name}: " in page for name in BAD)


@pytest.mark.full
def test_reports(tmp_path, archive, scheduler, expected, capsys):
    """The page leads to the report of each recording, which has its summary."""
    chosen = [str(archive / name) for name in (GOOD[0], GOOD[2], BAD[1])]
    command = ["analyse", "--fleet", *chosen, "--out", str(tmp_path), "--no-parquet", "--scheduler", scheduler]
    assert main([*command, "--reports"]) == 1
    reports = {path for path in page_of(tmp_path)[1] if path.suffix == ".html"}
    assert reports == set(tmp_path.glob("*-*.html")) and len(reports) == 2
    for path in reports:
        (text,) = re.findall(r'id="report">(.*)</script>', path.read_text(encoding="utf-8"))
        summary = json.loads(text)["summary"]
        compare(summary, expected[summary["recording"]])
    capsys.readouterr()
    assert main([*command, "--reports"]) == 1
    assert "0 recordings analysed, 2 had been" in capsys.readouterr().out


def test_the_exit_status_is_that_of_a_recording_by_itself(tmp_path, scheduler, capsys):
    """States too far apart for a balance, with efforts: worth a look in either way."""
    rows = [f"{0.3 * k},{0.3 * math.sin(0.3 * k)},{0.3 * math.cos(0.3 * k)},1" for k in range(200)]
    path, out = tmp_path / "slow.csv", tmp_path / "out"
    path.write_text("\n".join(["t,q_a,qd_a,tau_a", *rows]))
    why = "there are efforts, but no balance of power"
    report = dd.analyse_fleet([path], out, arm("a"), scheduler=scheduler, parquet=False)
    assert [row["wrong"] for row in report["recordings"]] == [why]
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf_of("a"))
    assert main(["analyse", str(path), "--urdf", str(urdf)]) == 1
    assert why in capsys.readouterr().err
    fleet = ["analyse", "--fleet", str(tmp_path / "sl*.csv"), "--out", str(out), "--no-parquet", "--quiet"]
    assert main([*fleet, "--urdf", str(urdf), "--scheduler", scheduler]) == 1


def test_wrong_arguments(tmp_path, archive, monkeypatch):
    path = str(archive / GOOD[0])
    with pytest.raises(dd.InputError, match="expected a list of paths"):  # its letters would be the patterns
        dd.analyse_fleet(path, tmp_path)
    with pytest.raises(dd.InputError, match="no parameter 'max_agge'"):
        dd.analyse_fleet([path], tmp_path, parameters={"max_agge": 1.0})
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(dd.InputError, match=r"pip install 'dask\[distributed\]'"):
        dd.analyse_fleet([path], tmp_path)


# --- Processes ---


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
        """Kill a worker in the midst of a task; return its process, and what it was at."""
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


@pytest.mark.full
def test_killed_worker(tmp_path, archive, expected):
    """What a killed worker was at, and what it had not handed over, another worker does."""
    with ExitStack() as stack:
        cluster, killed = Cluster(tmp_path, stack), []

        def progress(done, count, path):
            if not killed:
                killed.extend(cluster.kill_one_at_work())

        patterns = [str(archive / "**" / "*.mcap")]
        report = dd.analyse_fleet(patterns, tmp_path / "out", scheduler=cluster.address, piece=PIECE, progress=progress)
        assert killed[0].wait(60) == -signal.SIGKILL and killed[1]
        assert len(cluster.client.scheduler_info()["workers"]) == 1
    check(report, tmp_path / "out", expected, archive)


@pytest.mark.full
def test_processes_of_this_machine(tmp_path, archive, expected):
    report = dd.analyse_fleet([str(archive / "**" / "*.mcap")], tmp_path, workers=2, piece=PIECE)
    check(report, tmp_path, expected, archive)
