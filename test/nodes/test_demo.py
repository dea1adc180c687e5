# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo before its nodes start: robots and options that it rejects."""

import socket
import sys

import numpy as np
import pytest

from diag_dynamics.dynamics import DiagonalDynamics
from diag_dynamics.model import end_effector_link, load_robot
from diag_dynamics.nodes import demo


@pytest.mark.parametrize(
    ("robot", "texts"),
    [
        ("nosuchrobot", ["'nosuchrobot'", "All of these: ", f"{sys.executable} -m pip install"]),
        ("pandaa", ["'pandaa'", "is neither a file"]),
        ("anymal", ["anymal_b_simple", "anymal_c_simple"]),
        ("iris_simple", ["iris", "no moving joint"]),
        ("nowhere/panda.urdf", ["nowhere/panda.urdf"]),
    ],
)
def test_robots_it_cannot_show(robot, texts, capsys, monkeypatch):
    """Status 1 and the reason: unknown and ambiguous names, paths, robots without motion."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    monkeypatch.setattr(demo.signal, "signal", lambda *_: None)  # later tests have Ctrl-C
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


@pytest.mark.parametrize("robot", ["ur5", "panda", "z1"])
def test_the_pushed_link_is_told(robot):
    """Whatever the pose, the touched link is on the same joints."""
    model = load_robot(robot)
    dynamics = DiagonalDynamics(model)
    link = end_effector_link(model)
    wrench = demo.turning_wrench(dynamics, link)
    noise = 0.1 * demo.LEVER
    for q in np.random.default_rng(1).uniform(-1.5, 1.5, (20, model.nq)):
        jacobian = dynamics.jacobian(q, link, frame="link")
        touched = dynamics.touched_link(q, jacobian.T @ wrench, noise**2 * np.eye(model.nv)).link
        moves = dynamics.jacobian(q, touched, frame="link").any(axis=0)
        assert (moves == jacobian.any(axis=0)).all()
