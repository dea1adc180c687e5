# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo before its nodes start: robots and options that it rejects."""

import socket

import pytest

from diag_dynamics.nodes import demo


@pytest.mark.parametrize(
    ("robot", "texts"),
    [
        ("nosuchrobot", ["'nosuchrobot'", "neither a file nor an example robot", "All of these: "]),
        ("pandaa", ["'pandaa'", "is neither a file"]),
        ("anymal", ["anymal_b_simple", "anymal_c_simple"]),
        ("iris_simple", ["iris", "no moving joint"]),
        ("romeo_laas_small", ["l_gripper_joint"]),
        ("nowhere/panda.urdf", ["nowhere/panda.urdf"]),
    ],
)
def test_robots_it_cannot_show(robot, texts, capsys, monkeypatch):
    """Status 1 and the reason: unknown and ambiguous names, paths, robots without motion or
    inertia.
    """
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert demo.main(["demo", "--robot", robot]) == 1
    output = capsys.readouterr()
    assert [text for text in texts if text not in output.err] == []
    assert not output.out


def test_a_port_that_is_taken():
    """The page gets another one."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert demo.find_port(port) == 0
    assert demo.find_port(port) == port
