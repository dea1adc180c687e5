# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A recording fed to a monitor, message by message, and the same recording read: the same states, the same counters."""

import numpy as np
import pytest
from diag_dynamics.msg import DiagonalizedState
from nav_msgs.msg import Odometry
from sensor_msgs.msg import JointState

import diag_dynamics as dd
from nodes import Reports, nanoseconds
from recording_cases import CASES, hostile_messages, write_case

OF_THE_MOMENT = {
    "missing joints",
    "stale joints",
    "joints without effort",
    "joints with estimated velocity",
    "effort undeclared (taken as N m, with gravity)",
}
"""Whole numbers in the monitor's status that count joints as they are now."""

BY_TEMPLATE = "joint states read by template"
"""How many messages were taken in without deserialization."""


class Live:
    """A monitor whose clock is the time of reception of each message."""

    def __init__(self, peer, namespace, urdf, parameters):
        self.peer, self.name = peer, f"{namespace}/diag_dynamics"
        self.inputs = {
            "/joint_states": peer.publisher(JointState, f"{namespace}/joint_states"),
            "/odom": peer.publisher(Odometry, f"{namespace}/odom"),
        }
        self.states = peer.topic(DiagonalizedState, f"{self.name}/state")
        self.reports = Reports(peer.node, peer.wait_until, self.name)
        parameters = {"robot_description": urdf, "max_rate.state": 0.0} | parameters
        self.process = peer.start("monitor", "-r", f"__ns:={namespace}", **parameters)

    def feed(self, messages):
        """Have each message be received at its log time."""
        for topic, log_time, raw, _ in messages:
            self.peer.graph.system = log_time
            self.inputs[topic].publish(raw)
            self.peer.graph.spin()

    def counts(self):
        """Return all that it has counted."""
        report = self.reports.next()
        values = {pair.key: pair.value for pair in report.entries["joint states"].values}
        counts = {key: int(value) for key, value in values.items() if value.isdecimal() and "[" not in key}  # no unit
        return {key: n for key, n in counts.items() if n and key not in OF_THE_MOMENT | {BY_TEMPLATE}}


@pytest.mark.parametrize("name", CASES)
def test_a_recording_is_what_the_monitor_publishes(peer, tmp_path, name):
    """Published states equal the recording's bit for bit, in the same order."""
    case, urdf = CASES[name], tmp_path / "robot.urdf"
    text = case.urdf if isinstance(case.urdf, str) else case.urdf.read_text(encoding="utf-8")
    urdf.write_text(text, encoding="utf-8")
    messages = hostile_messages(case, 3, 500)
    recording = dd.read_recording(write_case(tmp_path / "x.mcap", messages), case.model, parameters=case.own_parameters)
    states = recording.states
    assert len(recording) > 100 and states.received.any()
    live = Live(peer, f"/robot{list(CASES).index(name)}", urdf, case.parameters)
    with live.process:
        live.feed(messages)
        published, counts = list(live.states.messages), live.counts()
    assert counts == {key: count for key, count in recording.counts.items() if count}
    assert [nanoseconds(one.header.stamp) for one in published] == states.newest.tolist()
    assert [nanoseconds(one.oldest_stamp) for one in published] == states.oldest.tolist()
    for field in ("position", "velocity"):
        assert np.array([getattr(one, field) for one in published]).tobytes() == getattr(states, field).tobytes()
    assert [one.effort_valid for one in published] == states.with_effort.tolist()
    assert [one.stamp_is_receive_time for one in published] == states.received.tolist()
    assert [one.velocity_estimated for one in published] == states.estimated.tolist()
    dynamics = dd.DiagonalDynamics(case.model)
    for k, one in enumerate(published):
        effort = states.effort[k] if states.with_effort[k] else None
        assert np.array(one.effort).tobytes() == (b"" if effort is None else effort.tobytes())
        s = dynamics.evaluate(states.position[k], states.velocity[k], effort)
        for field in ("nu", "xi", "coriolis", "gravity", "articulated_inertia", "epsilon", "kappa"):
            expected = getattr(s, field)
            assert np.array(getattr(one, field)).tobytes() == (b"" if expected is None else expected.tobytes()), field
        assert (one.kinetic_energy, one.power) == (s.kinetic_energy, s.effort_power or 0.0)
