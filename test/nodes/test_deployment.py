# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Monitors as they are deployed, in process: parameter files of robots, and several monitors."""

from pathlib import Path

import pytest
import yaml
from std_msgs.msg import String

from nodes import LATCHED, UR5, Monitor, description, robot

ROBOTS = sorted((Path(__file__).resolve().parents[2] / "config" / "robots").glob("*.yaml"))


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_parameters_of_a_robot(peer, path):
    """A monitor has each value of the file as rcl reads it, and knows each name."""
    expected = yaml.safe_load(path.read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    with peer.start("monitor", "--params-file", path) as monitor:
        assert peer.get_parameters("/diag_dynamics", expected) == expected
        assert "Unknown parameter" not in monitor.output


def test_several_monitors_in_one_process(peer, panda):
    """Two monitors, one robot by parameter and one by topic: neither the end nor the start of one
    disturbs the other.
    """
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
