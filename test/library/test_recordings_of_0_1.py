# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings of 0.1, in which a topic of this package has another definition, are read as those without it."""

import json

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.bags.mcap_writer import McapWriter
from diag_dynamics.cli.main import main
from diag_dynamics.model.example_robots import find_urdf
from diag_dynamics.wire.cdr import Template
from diag_dynamics.wire.definitions import definition_with_parts, message_type
from hostile import JOINT_STATE, START, Driver, S

pytest.importorskip("rosbags", reason="rosbags is not installed")
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

MS = 10**6
COUNT = 200

KIND = "diag_dynamics/msg/ExternalTorque"

EXTERNAL_TORQUE = """\
std_msgs/Header header
string[] dof_names
bool valid
float64[] residual
float64[] external_torque
float64 norm
float64 threshold
float64 release_threshold
bool collision
bool velocity_estimated
bool stamp_is_receive_time"""
"""Fields of 0.1, without their comments."""


def write(path, urdf, robot, old):
    """A recording of the inputs and, if `old`, of what a monitor of 0.1 said of them."""
    driver = Driver(robot, 5)
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register(get_types_from_msg(EXTERNAL_TORQUE, KIND))
    types = store.types
    with McapWriter(path) as writer:
        channel = writer.channel("/robot_description", "std_msgs/msg/String", "string data")
        text = Template(message_type("std_msgs/msg/String")(data=urdf)).encoded()
        writer.write_rows(channel, np.frombuffer(text, dtype=np.uint8)[None], np.array([START - S]))
        states = writer.channel("/joint_states", JOINT_STATE, definition_with_parts(JOINT_STATE))
        said = old and writer.channel("/diag_dynamics/external_torque", KIND, EXTERNAL_TORQUE)
        for k in range(COUNT):
            stamp = START + k * 2 * MS
            rows = [(states, driver.good(stamp))]
            if old:
                time = types["builtin_interfaces/msg/Time"](sec=stamp // S, nanosec=stamp % S)
                header = types["std_msgs/msg/Header"](stamp=time, frame_id="base")
                zeros = np.zeros(robot.nv)
                message = types[KIND](header, [*robot.dof_names], True, zeros, zeros, 0.0, 1.0, 0.5, *3 * [False])
                rows.append((said, bytes(store.serialize_cdr(message, KIND))))
            for one, raw in rows:
                writer.write_rows(one, np.frombuffer(raw, dtype=np.uint8)[None], np.array([stamp]))
    return path


def test_recordings_of_0_1_are_read(tmp_path, capsys):
    """Every state, and every figure of the summary, is that of a recording of the inputs alone."""
    robot = dd.load_robot("panda")
    urdf = find_urdf("panda").read_text(encoding="utf-8")
    paths = [write(tmp_path / f"{name}.mcap", urdf, robot, name == "old") for name in ("inputs", "old")]
    inputs, old = map(dd.read_recording, paths)
    assert len(old) == len(inputs) == COUNT and not old.findings
    for name in ("t", "q", "qd", "tau"):
        np.testing.assert_array_equal(getattr(old, name), getattr(inputs, name))
    summaries = []
    for path in paths:
        assert main(["analyse", str(path), "--json", str(path.with_suffix(".json"))]) == 0
        summaries.append(json.loads(path.with_suffix(".json").read_text(encoding="utf-8")))
    capsys.readouterr()
    for summary in summaries:
        assert summary["states"] == COUNT
        summary.pop("recording", None)
    assert summaries[0] == summaries[1]
