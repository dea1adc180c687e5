# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The demo before its nodes start: robots and options that it rejects."""

import socket

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.model import end_effector_link
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
    """Status 1 and the reason: unknown and ambiguous names, paths, robots without motion or inertia."""
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    assert demo.main(["demo", "--robot", robot]) == 1
    output = capsys.readouterr()
    assert [text for text in texts if text not in output.err] == []
    assert not output.out


@pytest.mark.parametrize("name", ["panda", "ur5", "z1"])
def test_the_link_that_it_pushes_is_told(name):
    """Its own joint feels a push of the demo; its noise is added."""
    model = dd.load_robot(name)
    dyn, weight = dd.DiagonalDynamics(model), demo.GRAVITY * model.total_mass
    link = end_effector_link(model)
    wrench = demo.FORCE * weight * demo.direction_of_push(model, link)
    deviation = demo.DEVIATION * weight
    noise = deviation * np.random.default_rng(0).normal(size=(50, model.nv))
    for seed, torque in enumerate(noise):
        q = model.random(seed)
        torque += dyn.jacobian(q, link).T @ wrench
        touched = dyn.touched_link(q, torque, deviation**2 * np.eye(model.nv))
        assert model.placement_in_body(touched.link)[0] == model.placement_in_body(link)[0]
        assert touched.confidence > 0.5


def test_a_port_that_is_taken():
    """The page gets another one."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        assert demo.find_port(port) == 0
    assert demo.find_port(port) == port
