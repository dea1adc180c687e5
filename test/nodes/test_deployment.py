# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Monitors as they are deployed, in process: parameter files of robots, several monitors, and delays between hosts."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from std_msgs.msg import String

from nodes import LATCHED, MS, PANDA, UR5, Monitor, S, description, robot

ROBOTS = sorted((Path(__file__).resolve().parents[2] / "config" / "robots").glob("*.yaml"))


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_parameters_of_a_robot(peer, path):
    """A monitor has each value of the file as rcl reads it, and knows each name."""
    expected = yaml.safe_load(path.read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    with peer.start("monitor", "--params-file", path) as monitor:
        assert peer.get_parameters("/diag_dynamics", expected) == expected
        assert "Unknown parameter" not in monitor.output


def test_several_monitors_in_one_process(peer, panda):
    """Two monitors, one robot by parameter and one by topic: neither the end nor the start of one disturbs the other."""
    ur5 = robot(UR5)
    descriptions_of_second = peer.publisher(String, "/second/robot_description", LATCHED)
    descriptions_of_second.publish(description(ur5.urdf))
    with Monitor(peer, "/second") as second:
        for _ in range(2):
            with Monitor(peer, "/first", robot_description=panda.path) as first:
                first.connect(panda)
                second.connect(ur5)
                for sample in range(3):
                    first.serves(panda, sample)
                    second.serves(ur5, sample)
                assert first.next_report().values["robot"] == "panda"
                assert second.next_report().values["robot"] == ur5.oracle.xml.get("name")
                heard = len(first.reports)
            second.serves(ur5)
            second.next_report()
            assert len(first.reports) == heard
        assert not [key for key in second.next_report().counts() if key.startswith("rejected: ")]


# --- a robot on another host: stamps of its clock, and states that are on their way for some time


@pytest.fixture
def far(peer):
    """Return a monitor that judges stamps by its clock; all states so far were in time."""
    with Monitor(peer, "/far", live=True, max_age=1.0, robot_description=robot(PANDA).path) as monitor:
        monitor.connect(robot(PANDA))
        yield monitor


def publish_at(monitor, states):
    """Publish states, each a pair of arrival and stamp [ns], at their arrivals."""
    for arrival, stamp in sorted(states):
        monitor.peer.pass_time(max(arrival - monitor.peer.now(), 0) / S)
        monitor.feeder.publish(robot(PANDA).message(stamp, robot(PANDA).samples[stamp % 3]))
    monitor.peer.pass_time(0.001)


def test_delays_of_milliseconds(far):
    """States that overtake each other on their way are published in order; those that come after newer ones are late."""
    rng = np.random.default_rng(1)
    before, begin = far.next_report(), far.peer.now()
    stamps = [begin + 5 * MS * k for k in range(100)]
    arrivals = [stamp + 10 * MS + int(rng.integers(50 * MS)) for stamp in stamps]
    far.forget()
    publish_at(far, list(zip(arrivals, stamps, strict=True)))
    in_order = [stamp for _, stamp in sorted(zip(arrivals, stamps, strict=True))]
    newest = np.maximum.accumulate(in_order)
    expected = sorted({*newest.tolist()})
    assert 10 < len(expected) < 90
    assert far.topics["state"].stamps == expected
    counts = {"received": 100, "published": len(expected), "rejected: late": 100 - len(expected)}
    assert far.next_report().since(before) == counts


def test_delay_beyond_max_age(far, panda):
    """States that arrive older than max_age, after others have not, are rejected; then all goes on."""
    before, begin = far.next_report(), far.peer.now()
    far.forget()
    publish_at(far, [(begin + 1500 * MS + 5 * MS * k, begin + 5 * MS * k) for k in range(20)])
    assert not far.topics["state"].stamps
    report = far.wait_for_report(lambda report: report.count("received") >= before.count("received") + 20, "all", 0)
    assert report.since(before) == {"received": 20, "rejected: stamp from the past": 20}
    assert report.level == b"\x01"
    far.serves(panda)
    publish_at(far, [(far.peer.now() + 999 * MS, far.peer.now())])
    assert len(far.topics["state"].stamps) == 2


@pytest.mark.parametrize(("foreign_time", "published"), [("warn", 20), ("refuse", 0)])
def test_slow_from_the_first_on(peer, panda, foreign_time, published):
    """Stamps that have never been those of the clock are used with a warning, or rejected; in step all is well."""
    options = {"max_age": 1.0, "foreign_time": foreign_time, "robot_description": panda.path}
    with Monitor(peer, f"/slow_{foreign_time}", live=True, **options) as monitor:
        begin = peer.now()
        publish_at(monitor, [(begin + 2000 * MS + S * k, begin + S * k) for k in range(20)])
        report = monitor.wait_for_report(lambda report: report.count("received") == 20, "all states", 0)
        assert len(monitor.topics["state"].stamps) == report.count("published") == published
        assert report.level == b"\x01"
        begin = peer.now()
        publish_at(monitor, [(begin + 100 * MS * k, begin + 100 * MS * k) for k in range(100)])
        assert len(monitor.topics["state"].stamps) > published
        assert monitor.reports[-1].level == b"\x00"
