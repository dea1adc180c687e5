# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A fleet's archive: each recording is analysed as by itself, once, whatever fails meanwhile.

Tasks run in threads of the test's process; those in processes, of which one is killed, are of the
full tier.
"""

import csv
import html
import json
import os
import re
import shutil
import sys
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
from diag_dynamics.description.catalog import find_urdf
from diag_dynamics.recordings import fleet_analysis
from diag_dynamics.recordings.summary import describe_faults
from hostile import MS, START, Driver, S, hostile

GOOD = "monday/arm.mcap", "monday/long shift.mcap", "tuesday/arm.mcap", "tuesday/hostile.mcap"
BAD = "tuesday/broken.mcap", "tuesday/idle.mcap"


def good(model, seconds, seed=1):
    """Return messages of one driver, 500 Hz with jitter, with times of reception."""
    driver = Driver(model, seed)
    rng = np.random.default_rng(seed)
    count = int(500 * seconds)
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
    """Folder of recordings of two robots, one hostile; without messages of its joints, and of
    garbage.
    """
    folder = tmp_path_factory.mktemp("archive")
    panda = dd.load_robot("panda")
    ur5 = dd.load_robot("ur5")
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
    out = tmp_path_factory.mktemp("expected") / "summary.json"
    result = {}
    for path in (str(archive / name) for name in GOOD):
        assert main(["analyse", path, "--json", str(out), "--quiet"]) in (0, 1)
        result[path] = json.loads(out.read_text(encoding="utf-8"))
    return result


def summaries_of(out):
    paths = {path: json.loads(path.read_text(encoding="utf-8")) for path in out.glob("*-*.json")}
    return {summary["recording"]: (path, summary) for path, summary in paths.items()}


def check(rows, out, expected, archive):
    """Assert that recordings are analysed as by themselves, and that damage is a row with an
    error.
    """
    errors = {row["recording"] for row in rows if "error" in row}
    assert errors == {str(archive / name) for name in BAD}
    summaries = summaries_of(out)
    assert summaries.keys() == expected.keys()
    for recording, (path, summary) in summaries.items():
        whole = expected[recording]
        assert {key: summary[key] for key in whole} == whole
        columns = parquet.read_table(path.with_suffix(".parquet"))
        assert np.max(columns["kinetic_energy"].to_numpy()) == whole["kinetic_energy"]["max"]
        (row,) = (row for row in rows if row["recording"] == recording)
        assert (row["states"], row["explained"]) == (columns.num_rows, whole["explained"])
        assert row["kinetic_energy_max"] == whole["kinetic_energy"]["max"]
        assert row["rejected"] == sum(whole["rejected"].values()) and row["collisions"] is None
    suffixes = {path.suffix for path in out.iterdir()}
    assert suffixes == {".json", ".parquet", ".csv", ".html"}  # and nothing unfinished
    with (out / "fleet.csv").open(encoding="utf-8", newline="") as file:
        table = list(csv.DictReader(file))
    cells = [{name: "" if x is None else str(x) for name, x in row.items()} for row in rows]
    assert [{name: x for name, x in row.items() if x} for row in table] == [
        {name: x for name, x in row.items() if x} for row in cells
    ]


@pytest.fixture(scope="module")
def analysed(archive, scheduler, tmp_path_factory):
    """Rows and folder of an archive that is analysed in the test's process."""
    out = tmp_path_factory.mktemp("out")
    counts = []
    rows = dd.analyse_fleet(
        archive / "**" / "*.mcap",
        out,
        scheduler=scheduler,
        progress=lambda done, count, path: counts.append((done, count)),
    )
    count = len(GOOD) + len(BAD)
    assert counts == [(k + 1, count) for k in range(count)]
    return rows, out


def test_a_fleet_is_its_recordings(analysed, archive, expected):
    rows, out = analysed
    check(rows, out, expected, archive)
    errors = {row["recording"]: row.get("error") for row in rows}
    assert errors[str(archive / BAD[1])].startswith(f"'{archive / BAD[1]}' contains no valid state")


def test_an_unexpected_error_is_a_row(archive, scheduler, tmp_path, monkeypatch):
    monkeypatch.setattr(fleet_analysis.Analysis, "run", lambda analysis, _: analysis.no_such_name)
    (row,) = dd.analyse_fleet(archive / GOOD[0], tmp_path, scheduler=scheduler)
    assert row["error"].startswith("AttributeError: ")


def test_restart(analysed, archive, scheduler, tmp_path):
    """Only a recording without a summary of the same file and options is analysed again."""
    out = shutil.copytree(analysed[1], tmp_path / "out")
    patterns = [str(archive / name) for name in (*GOOD, BAD[0])]

    def again(**options):
        before = {path: path.stat().st_mtime_ns for path in out.glob("*-*.json")}
        rows = dd.analyse_fleet(patterns, out, scheduler=scheduler, **options)
        assert [row["recording"] for row in rows if "error" in row] == patterns[-1:]
        after = {path: path.stat().st_mtime_ns for path in out.glob("*-*.json")}
        return {path.stem.rpartition("-")[0] for path in after if before.get(path) != after[path]}

    assert again() == set()
    lost = next(out.glob("monday-arm-*.json"))
    touched = archive / "tuesday" / "arm.mcap"
    lost.unlink()
    (out / f"{lost.stem}.parquet.part").touch()  # of a run that was killed
    assert again() == {"monday-arm"} and not [*out.glob("*.part")]
    os.utime(touched, ns=(touched.stat().st_atime_ns, touched.stat().st_mtime_ns + S))
    assert again() == {"tuesday-arm"}
    patterns = [str(archive / GOOD[0]), *patterns[-1:]]
    options = {}
    for more in (
        {"parameters": {"plausibility.jump": 0.5}},
        {"gain": 30.0},
        {"model": dd.load_robot("panda")},
    ):
        options |= more
        assert [again(**options) for _ in range(2)] == [{"monday-arm"}, set()]


def test_options_of_all_recordings(tmp_path, scheduler):
    """Topics and names of joints are those of read_recording."""
    topics = "/one", "/two"
    names = {"left_*": "*"}
    path = write_mcap(tmp_path / "x.mcap", few(["left_a", "left_b"], topics))
    options = {"topic": topics, "scheduler": scheduler, "model": arm("a", "b")}
    (row,) = dd.analyse_fleet([path], tmp_path / "out", joint_names=names, **options)
    assert row["states"] == 79
    (row,) = dd.analyse_fleet(tmp_path / "*", tmp_path / "out", **options)  # not its outputs
    assert "--joint-names 'left_*=*'" in row["error"]


def test_the_command(tmp_path, archive, scheduler, capsys):
    pattern = str(archive / "tuesday" / "*.mcap")
    arguments = ["analyse", "--fleet", pattern, "--out", str(tmp_path)]
    options = ["--scheduler", scheduler]
    assert main([*arguments, *options]) == 1  # there are bad ones
    printed = capsys.readouterr()
    assert "2 recordings analysed, 2 failed" in printed.out
    assert "4 of 4 recordings" in printed.err and "no valid state" in printed.err
    arguments[1:3] = [str(archive / GOOD[3]), "--fleet"]  # messages were rejected
    assert main([*arguments, *options, "--quiet"]) == 1
    assert capsys.readouterr() == ("", "")
    for wrong, text in (
        (
            ["analyse", "--fleet", "nothing.mcap", "--out", str(tmp_path)],
            "there is no recording 'nothing.mcap'",
        ),
        (["analyse", "--fleet", str(archive)], "--fleet requires --out"),
        ([*arguments, "--csv", "x.csv"], "--csv cannot be combined with --fleet"),
    ):
        assert main(wrong) == 2
        assert text in capsys.readouterr().err


@pytest.mark.parametrize(
    ("rows", "status"),
    [
        ([{"faults": ""}], 0),
        ([{"faults": "messages were rejected"}], 1),
        ([{"faults": ""}, {"error": "damage"}], 1),
        ([{"error": "damage"}], 2),
    ],
)
def test_exit_status(monkeypatch, rows, status):
    monkeypatch.setattr("diag_dynamics.cli.fleet.analyse_fleet", lambda *_, **__: rows)
    assert main(["analyse", "--fleet", "*.mcap", "--out", "out", "--quiet"]) == status


def page_of(folder):
    """Return the text of a fleet's page, the files of its links, and the texts of its cells by
    row.
    """
    page = (folder / "fleet.html").read_text(encoding="utf-8")
    links = [folder / link for link in re.findall('href="([^"]*)"', page)]
    assert all(link.exists() for link in links)
    rows = page.split("<tr>")[2:]
    cells = [re.findall("<td[^>]*>(?:<a[^>]*>)?([^<]*)", row) for row in rows]
    return page, links, [list(map(html.unescape, row)) for row in cells]


def test_the_page(analysed, archive, expected):
    """A row for each recording leads to its summary; a row of one that failed has the error."""
    _, links, rows = page_of(analysed[1])
    assert sorted(links) == sorted(analysed[1].glob("*-*.json"))
    cells = {os.path.join(archive, row[0]): row[1:] for row in rows}
    for recording, summary in expected.items():
        assert cells[recording][0] == summary["robot"]
        assert cells[recording][2] == str(summary["states"])
        rejected = str(sum(summary["rejected"].values()))
        assert cells[recording][8:] == [rejected, "; ".join(describe_faults(summary))]
    for name in BAD:
        assert len(cells[str(archive / name)]) == 1


def test_strange_names(tmp_path, scheduler):
    """Names of files and robots with characters of HTML, and bytes that are no UTF-8."""
    strange = "<i>&'\""
    folder = tmp_path / strange
    out = tmp_path / "out"
    urdf = tmp_path / "arm.urdf"
    folder.mkdir()
    urdf.write_text(re.sub('name="[^"]*"', f'name="{html.escape(strange)}"', urdf_of("a"), count=1))
    paths = [
        write_mcap(folder / os.fsdecode(name), few(["a"]))
        for name in (b"caf\xe9.mcap", b"<b>&amp;.mcap")
    ]
    (folder / "<u>.mcap").write_bytes(b"nothing")
    command = ["analyse", "--fleet", str(folder / "*.mcap"), "--urdf", str(urdf), "--out", str(out)]
    for _ in range(2):
        assert main([*command, "--scheduler", scheduler]) == 1
    page, links, rows = page_of(out)
    assert not {"<i>", "<u>", "<b>"} & set(re.findall("<[^>]*>", page)) and len(links) == 2
    shown = {path.name.encode(errors="backslashreplace").decode() for path in map(Path, paths)}
    assert {row[0] for row in rows} == {*shown, "<u>.mcap"}
    assert strange in {row[1] for row in rows}
    assert set(summaries_of(out)) == set(map(str, paths))


def test_wrong_arguments(tmp_path, monkeypatch):
    with pytest.raises(dd.InputError, match="no parameter 'max_agge'"):
        dd.analyse_fleet(["a.mcap"], tmp_path, parameters={"max_agge": 1.0})
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(dd.InputError, match=r"pip install 'dask\[distributed\]'"):
        dd.analyse_fleet(["a.mcap"], tmp_path)


@pytest.mark.full
def test_killed_worker(tmp_path, archive, expected):
    """A new process continues with what the killed one had not finished."""
    out = tmp_path / "out"
    finished = {}

    def workers():
        children = psutil.Process().children(recursive=True)
        return [child for child in children if "spawn_main" in " ".join(child.cmdline())]

    def progress(done, count, path):
        if not finished and path in expected:
            summary = summaries_of(out)[path][0]
            finished[summary] = summary.stat().st_mtime_ns
            for worker in workers():
                worker.kill()

    rows = dd.analyse_fleet([str(archive / "**" / "*.mcap")], out, progress=progress)
    check(rows, out, expected, archive)
    assert finished == {path: path.stat().st_mtime_ns for path in finished} and len(finished) == 1
    assert not workers()
