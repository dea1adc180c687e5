# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fleet's archive: each recording is analysed as by itself, once, whatever fails meanwhile.

Tasks run in threads of the test's process; those in processes, of which one is killed, are of the full tier.
"""

import html
import json
import math
import os
import re
import shutil
import sys
from collections import Counter
from pathlib import Path

import distributed
import numpy as np
import psutil
import pytest
from pyarrow import parquet

import diag_dynamics as dd
from bags import Message, arm, description, serialized, urdf_of, write_mcap
from commands import quiet_compiler  # noqa: F401 (a fixture of all tests here)
from diag_dynamics.cli.main import main
from diag_dynamics.model.catalog import find_urdf
from hostile import MS, START, Driver, S, hostile
from recorded_arm import parts_of

GOOD = "monday/arm.mcap", "monday/long shift.mcap", "tuesday/arm.mcap", "tuesday/hostile.mcap"
BAD = "tuesday/broken.mcap", "tuesday/idle.mcap"
NUMBERS = {
    "int64": {"states", "collisions", "rejected", "unread", "warnings"},
    "string": {"recording", "robot", "wrong", "error"},
    "double": {
        "hours",
        "kinetic_energy_max",
        "kinetic_energy_max_at",
        "kinetic_energy_mean",
        "explained",
    }
    | {"explained_with_potential", "residual_power", "external_torque_max"},
}


def good(model, seconds, seed=1):
    """Return messages of one driver, 500 Hz with jitter, with times of reception."""
    driver, rng, count = Driver(model, seed), np.random.default_rng(seed), int(500 * seconds)
    stamps = START + np.arange(count) * 2 * MS + rng.integers(-1000, 1000, count)
    return [(driver.good(int(stamp)), int(stamp) + 200_000) for stamp in stamps]


def few(names, topics=("/joint_states",)):
    """Return 40 messages of each topic with the joint of its name."""
    return [
        Message(topic, START + k * MS, serialized(START + k * MS, [name], [0.01 * k], [0.1], [1.0]))
        for k in range(40)
        for topic, name in zip(topics, names, strict=True)
    ]


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    """Folder of recordings of two robots, one hostile; without messages of its joints, and of garbage."""
    folder = tmp_path_factory.mktemp("archive")
    panda, ur5 = dd.load_robot("panda"), dd.load_robot("ur5")
    elsewhere = [(serialized(START, ["elsewhere"], [0.0]), START)]
    pairs = (
        good(panda, 3.0),
        good(panda, 6.0, seed=2),
        good(ur5, 3.0, seed=3),
        hostile(panda, 4),
        elsewhere,
    )
    for name, sent in zip((*GOOD, BAD[1]), pairs, strict=True):
        (folder / name).parent.mkdir(exist_ok=True)
        urdf = Path(find_urdf("ur5" if name == GOOD[2] else "panda")).read_text(encoding="utf-8")
        states = [Message("/joint_states", now, raw) for raw, now in sent]
        write_mcap(folder / name, [description(urdf, START), *states], chunk_size=200_000)
    (folder / BAD[0]).write_bytes(np.random.default_rng(0).bytes(5000))
    return folder


@pytest.fixture(scope="module")
def scheduler():
    """Address of a scheduler whose worker is a thread of this process."""
    options = {
        "n_workers": 1,
        "threads_per_worker": 1,
        "processes": False,
        "dashboard_address": None,
    }
    with distributed.LocalCluster(**options) as cluster:
        yield cluster.scheduler_address


@pytest.fixture(scope="module")
def expected(archive, tmp_path_factory):
    """Summaries of recordings that are analysed by themselves, by path."""
    out, found = tmp_path_factory.mktemp("expected") / "summary.json", {}
    for path in (str(archive / name) for name in GOOD):
        assert main(["analyse", path, "--json", str(out), "--quiet"]) in (0, 1)
        found[path] = json.loads(out.read_text(encoding="utf-8"))
    return found


def summaries_of(out):
    paths = {path: json.loads(path.read_text(encoding="utf-8")) for path in out.glob("*-*.json")}
    return {summary["recording"]: (path, summary) for path, summary in paths.items()}


def check(report, out, expected, archive):
    """Assert that all recordings are analysed as by themselves, and those that cannot be are named."""
    assert set(report["failed"]) == {str(archive / name) for name in BAD}
    assert [row["recording"] for row in report["recordings"]] == list(expected)
    found = summaries_of(out)
    assert found.keys() == expected.keys()
    for recording, (path, summary) in found.items():
        whole = expected[recording]
        assert {key: summary[key] for key in whole} == whole
        columns = parquet.read_table(path.with_suffix(".parquet"))
        assert columns.num_rows == whole["states"]
        ends = columns["stamp"].to_numpy()[[0, -1]].tolist()
        assert ends == pytest.approx([whole["begin"] * S, whole["end"] * S])
        assert np.max(columns["kinetic_energy"].to_numpy()) == whole["kinetic_energy"]["max"]
    assert {path.suffix for path in out.iterdir()} == {
        ".json",
        ".parquet",
        ".html",
    }  # and nothing unfinished
    assert json.loads((out / "fleet.json").read_text(encoding="utf-8")) == json.loads(
        json.dumps(report)
    )
    table = parquet.read_table(out / "fleet.parquet")
    assert {
        str(f.type): {g.name for g in table.schema if g.type == f.type} for f in table.schema
    } == NUMBERS
    failed = [
        {"recording": path, "error": text, "hours": None} for path, text in report["failed"].items()
    ]
    for row, given in zip(table.to_pylist(), [*report["recordings"], *failed], strict=True):
        assert {name: row[name] for name in given} == given


@pytest.fixture(scope="module")
def analysed(archive, scheduler, tmp_path_factory):
    """Report and folder of an archive that is analysed in the test's process."""
    out, told, count = tmp_path_factory.mktemp("out"), [], len(GOOD) + len(BAD)
    patterns, progress = (
        [str(archive / "**" / "*.mcap")],
        lambda done, all, path: told.append((done, all)),
    )
    report = dd.analyse_fleet(patterns, out, scheduler=scheduler, progress=progress)
    assert told == [(k + 1, count) for k in range(count)]
    return report, out


def test_a_fleet_is_its_recordings(analysed, archive, expected):
    report, out = analysed
    check(report, out, expected, archive)
    assert (report["computed"], report["kept"]) == (len(GOOD), 0)
    assert "no valid state" in report["failed"][str(archive / BAD[1])]


def test_robots_are_reported_together(analysed, expected):
    panda, ur5 = analysed[0]["robots"]
    assert (panda["robot"], panda["recordings"], ur5["robot"], ur5["recordings"]) == (
        "panda",
        3,
        "ur5",
        1,
    )
    of = [summary for summary in expected.values() if summary["robot"] == "panda"]
    energy, energies = panda["kinetic_energy"], [one["kinetic_energy"] for one in of]
    states = [one["states"] for one in of]
    assert energy["max"] == max(one["max"] for one in energies)
    assert expected[energy["recording"]]["kinetic_energy"]["at"] == energy["at"]
    assert panda["states"] == sum(states) == sum(one["states"] for one in energy["histogram"])
    assert energy["mean"] == pytest.approx(
        np.average([one["mean"] for one in energies], weights=states), rel=1e-12
    )
    lows = {part["from"] for one in energies for part in one["histogram"]}
    assert [part["from"] for part in energy["histogram"]] == sorted(lows)
    assert panda["rejected"] == dict(sum((Counter(one["rejected"]) for one in of), Counter()))
    assert sum(panda["rejected"].values()) > 10
    kinetic, residual = (pooled(of, name) for name in ("kinetic", "residual"))
    assert panda["explained"] == pytest.approx(1.0 - residual[1] / kinetic[1], rel=1e-9)
    assert panda["residual_power"] == pytest.approx(
        math.sqrt(residual[1] + residual[0] ** 2), rel=1e-9
    )
    assert [(robot["collisions"], robot["unjudged"]) for robot in (panda, ur5)] == [
        (None, 3),
        (None, 1),
    ]


def pooled(summaries, name):
    """Return mean and variance over the windows of all recordings, by sums of squares about zero."""
    lots = [one["balance"]["moments"][name] for one in summaries]
    count = sum(one["count"] for one in lots)
    mean = sum(one["count"] * one["mean"] for one in lots) / count
    return mean, sum(
        one["squares"] + one["count"] * one["mean"] ** 2 for one in lots
    ) / count - mean**2


def test_restart(analysed, archive, scheduler, tmp_path):
    """Nothing is computed again but what is not there, or would be another; failures are tried again."""
    out = shutil.copytree(analysed[1], tmp_path / "out")
    patterns = [str(archive / name) for name in (*GOOD, BAD[0])]

    def again(**options):
        before = {path: path.stat().st_mtime_ns for path in out.glob("*-*.json")}
        report = dd.analyse_fleet(patterns, out, scheduler=scheduler, **options)
        assert list(report["failed"]) == patterns[-1:]
        written = {
            path.stem
            for path in out.glob("*-*.json")
            if path.stat().st_mtime_ns != before.get(path)
        }
        assert (report["computed"], report["kept"]) == (
            len(written),
            len(patterns) - 1 - len(written),
        )
        return {name.rpartition("-")[0] for name in written}

    assert again() == set()
    lost, touched = next(out.glob("monday-arm-*.parquet")), archive / "tuesday" / "arm.mcap"
    lost.unlink()
    for old in ("parquet.part", "html"):  # of a run that was killed, and of one with reports
        (out / f"{lost.stem}.{old}").touch()
    assert again() == {"monday-arm"} and lost.exists()
    assert not [*out.glob("*.part"), *out.glob("*-*.html")]
    os.utime(touched, ns=(touched.stat().st_atime_ns, touched.stat().st_mtime_ns + S))
    assert again() == {"tuesday-arm"}
    patterns, options = [str(archive / GOOD[0]), *patterns[-1:]], {}
    for more in (
        {"parameters": {"plausibility.jump": 0.5}},
        {"gain": 30.0},
        {"model": dd.load_robot("panda")},
    ):
        options |= more
        assert [again(**options) for _ in range(2)] == [{"monday-arm"}, set()]


def test_topics_and_names_of_joints(tmp_path, scheduler):
    """Those of all recordings; another map is another result, a model is known again."""
    topics, names = ("/one", "/two"), {"left_*": "*"}
    path = write_mcap(tmp_path / "x.mcap", few(["left_a", "left_b"], topics))
    options = {"topic": topics, "scheduler": scheduler, "parquet": False}
    for joint_names, computed, states in ((names, 1, 79), (names, 0, 79), (None, 0, 0)):
        report = dd.analyse_fleet(
            [path], tmp_path / "out", arm("a", "b"), joint_names=joint_names, **options
        )
        assert (
            report["computed"] == computed
            and sum(row["states"] for row in report["recordings"]) == states
        )
    assert "--joint-names 'left_*=*'" in report["failed"][str(path)]


def test_the_command(tmp_path, archive, scheduler, capsys):
    arguments = [
        "analyse",
        "--fleet",
        str(archive / "tuesday" / "*.mcap"),
        "--out",
        str(tmp_path),
        "--no-parquet",
    ]
    run = [*arguments, "--scheduler", scheduler]
    assert main(run) == 1  # there are bad ones
    told = capsys.readouterr()
    assert "Robot 'ur5': 1 recordings" in told.out and "2 recordings analysed, 2 failed" in told.out
    assert told.out.count("collisions unknown") == 2
    assert re.search(r"50% of states below [\d.e-]+ J, 99% of states below [\d.e-]+ J", told.out)
    assert "4 of 4 recordings" in told.err and not list(tmp_path.glob("*.parquet"))
    run[2] = str(archive / GOOD[3])  # all are analysed, and messages were rejected
    assert (
        main(["analyse", run[2], "--fleet", *run[3:], "--quiet"]) == 1
    )  # before --fleet as well as behind it
    assert capsys.readouterr() == ("", "")
    for wrong, what in (
        (
            ["analyse", "--fleet", "nothing.mcap", "--out", str(tmp_path)],
            "there is no recording 'nothing.mcap'",
        ),
        (["analyse", "--fleet", str(archive)], "--fleet requires --out"),
        ([*arguments, "--csv", "x.csv"], "--csv cannot be combined with --fleet"),
    ):
        assert main(wrong) == 2
        assert what in capsys.readouterr().err


@pytest.mark.parametrize(
    ("wrong", "failed", "status"),
    [("", {}, 0), ("messages were rejected", {}, 1), ("", {"x.mcap": "damage"}, 1)],
)
def test_exit_status(monkeypatch, wrong, failed, status):
    """Findings in one recording, or a recording that failed, are status 1."""
    report = {"recordings": [{"wrong": wrong}], "failed": failed}
    monkeypatch.setattr("diag_dynamics.cli.fleet.analyse_fleet", lambda *_, **__: report)
    assert main(["analyse", "--fleet", "*.mcap", "--out", "out", "--quiet"]) == status


def page_of(folder):
    """Return the text of a fleet's page, its links, and the values of its rows."""
    page = (folder / "fleet.html").read_text(encoding="utf-8")
    links = [folder / link for link in re.findall('href="([^"]*[.](?:html|json))"', page)]
    assert all(link.exists() for link in links)
    return page, links, [re.findall('data-value="([^"]*)"', row) for row in page.split("<tr>")[2:]]


def test_the_page(analysed, expected):
    """A row for each recording, which leads to its summary; what is wrong with it and with others is below."""
    page, links, rows = page_of(analysed[1])
    assert sorted(links) == sorted(analysed[1].glob("*-*.json")) and {row[8] for row in rows} == {
        ""
    }
    shown = [(row[0], int(row[3]), float(row[4])) for row in rows]
    assert shown == [
        (path, one["states"], one["kinetic_energy"]["max"]) for path, one in expected.items()
    ]
    assert "collisions unknown" in page and "0 collisions" not in page
    notes = dict(re.findall("<li><b>(.*?)</b>: (.*?)</li>", page))
    assert set(notes) == {*BAD, *GOOD} and "rejected messages" in notes[GOOD[3]]


def test_strange_names(tmp_path, scheduler, capsys):
    """Names of files and robots with characters of HTML, and bytes that are no UTF-8."""
    strange = "<i>&'\""
    folder, out, urdf = tmp_path / strange, tmp_path / "out", tmp_path / "arm.urdf"
    folder.mkdir()
    urdf.write_text(re.sub('name="[^"]*"', f'name="{html.escape(strange)}"', urdf_of("a"), count=1))
    paths = [
        write_mcap(folder / os.fsdecode(name), few(["a"]))
        for name in (b"caf\xe9.mcap", b"<b>&amp;.mcap")
    ]
    (folder / "<u>.mcap").write_bytes(b"nothing")
    command = ["analyse", "--fleet", str(folder / "*.mcap"), "--urdf", str(urdf), "--out", str(out)]
    for said in (
        f"Robot '{strange}': 2 recordings",
        "0 recordings analysed, 2 unchanged, 1 failed",
    ):
        assert main([*command, "--scheduler", scheduler]) == 1
        assert said in capsys.readouterr().out
    page, links, rows = page_of(out)
    assert not {"<i>", "<u>"} & set(re.findall("<[^>]*>", page)) and len(links) == 2
    shown = {os.fspath(path).encode(errors="backslashreplace").decode() for path in paths}
    assert {html.unescape(row[0]) for row in rows} == shown and {
        html.unescape(row[1]) for row in rows
    } == {strange}
    assert set(parquet.read_table(out / "fleet.parquet")["recording"].to_pylist()[:2]) == shown
    assert set(summaries_of(out)) == set(map(str, paths))


@pytest.mark.full
def test_reports(tmp_path, archive, scheduler, expected):
    """The page leads to the report of each recording, which has its summary; a lost one is made again."""
    options = {"scheduler": scheduler, "parquet": False, "reports": True}
    for computed in (2, 0, 1):
        report = dd.analyse_fleet(
            [archive / GOOD[0], archive / GOOD[2], archive / BAD[1]], tmp_path, **options
        )
        assert (report["computed"], len(report["failed"])) == (computed, 1)
        reports = sorted(path for path in page_of(tmp_path)[1] if path.suffix == ".html")
        assert reports == sorted(tmp_path.glob("*-*.html")) and len(reports) == 2
        for path in reports:
            summary = parts_of(path)[0]["summary"]
            assert summary == expected[summary["recording"]]
        if not computed:
            reports[0].unlink()


def test_wrong_arguments(tmp_path, monkeypatch):
    with pytest.raises(
        dd.InputError, match="expected a list of paths"
    ):  # its letters would be the patterns
        dd.analyse_fleet("a.mcap", tmp_path)
    with pytest.raises(dd.InputError, match="no parameter 'max_agge'"):
        dd.analyse_fleet(["a.mcap"], tmp_path, parameters={"max_agge": 1.0})
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(dd.InputError, match=r"pip install 'dask\[distributed\]'"):
        dd.analyse_fleet(["a.mcap"], tmp_path)


@pytest.mark.full
def test_killed_worker(tmp_path, archive, expected):
    """What the killed process was at is done again by a new one; what it had handed over is not."""
    out, finished = tmp_path / "out", {}

    def workers():
        children = psutil.Process().children(recursive=True)
        return [child for child in children if "spawn_main" in " ".join(child.cmdline())]

    def progress(done, count, path):
        if not finished and path in expected:
            finished.update({one: one.stat().st_mtime_ns for one in [summaries_of(out)[path][0]]})
            killed, *others = workers()
            assert not others
            killed.kill()

    report = dd.analyse_fleet([str(archive / "**" / "*.mcap")], out, workers=1, progress=progress)
    check(report, out, expected, archive)
    assert finished == {path: path.stat().st_mtime_ns for path in finished} and len(finished) == 1
    assert not workers()
