# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of deploy/ and config/robots with real nodes: what units and the container start, and parameters of each robot."""

import os
import re
import signal
from pathlib import Path

import pytest
import rclpy
import yaml
from rclpy.exceptions import InvalidParameterTypeException

from diag_dynamics.nodes.monitor.monitor import MonitorNode
from nodes import PANDA
from processes import Process
from robots import robot_path

pytestmark = [pytest.mark.full, pytest.mark.live]

ROOT = Path(__file__).resolve().parents[2]
UNITS = sorted((ROOT / "deploy" / "systemd").glob("*.service"))
ROBOTS = sorted((ROOT / "config" / "robots").glob("*.yaml"))


def at_hand(command, places):
    """A shell's text with the places of a robot's computer replaced by those of this one; each has to be there."""
    for place, own in places.items():
        assert place in command, place
        command = command.replace(place, str(own))
    return command


def nothing(folder):
    """An empty file, to be sourced."""
    path = folder / "nothing.bash"
    path.touch()
    return path


# --- systemd


SETTINGS = {
    "monitor": ROOT / "config" / "robots" / "ur.yaml",
    "controller": {"robot_compensates_gravity": False},
    "view": {"port": 0},
}
"""What /etc/diag_dynamics has for each node: a file, or parameters."""

AT_WORK = {"monitor": "Waiting for a robot", "controller": "Waiting to be configured", "view": "Page: http"}
"""What each node says when it has taken its parameters and is at work."""


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_units_start_nodes(ros_domain, tmp_path, unit):
    """By the line that systemd would run, as it is but for places; the signal that systemd sends ends them."""
    said = dict(re.findall(r"^(\w+)=(.*)$", unit.read_text(encoding="utf-8"), re.M))
    shell, option, command = re.fullmatch(r"(/bin/bash) (-c) '([^']*)'", said["ExecStart"]).groups()
    node = unit.stem.rsplit("-")[-1]
    settings = SETTINGS[node]
    if isinstance(settings, dict):
        settings = tmp_path / "node.yaml"
        settings.write_text(yaml.safe_dump({"/**": {"ros__parameters": SETTINGS[node]}}), encoding="utf-8")
    places = dict.fromkeys(("/opt/ros/jazzy/setup.bash", "/home/ros/ws/install/setup.bash"), nothing(tmp_path))
    command = at_hand(command, places | {f"/etc/diag_dynamics/{node}.yaml": settings})
    with Process((shell, option, command), env=os.environ | {"ROS_LOG_DIR": str(tmp_path)}) as process:
        process.wait_for_text(AT_WORK[node])
        assert (
            process.popen.pid == os.getpgid(process.popen.pid) and process.children() == []
        )  # exec: no shell in between
        process.stop(getattr(signal, said["KillSignal"]))


# --- the container


def test_services_start_nodes(ros_domain, tmp_path):
    """Those of the compose file, by the image's entrypoint: a robot, its monitor that finds it, and the page."""
    compose = yaml.safe_load((ROOT / "deploy" / "compose.yaml").read_text(encoding="utf-8"))["services"]
    entrypoint = tmp_path / "entrypoint.sh"
    text = (ROOT / "deploy" / "entrypoint.sh").read_text(encoding="utf-8")
    set_up = '"/opt/ros/${ROS_DISTRO:?is set by the image}/setup.bash"', "/ws/install/setup.bash"
    places = dict.fromkeys(set_up, nothing(tmp_path))
    entrypoint.write_text(at_hand(text, places), encoding="utf-8")
    mounted = {"/robot/robot.urdf": robot_path(PANDA), "/robot/monitor.yaml": ROOT / "config" / "robots" / "xarm.yaml"}

    def started(service, *more):
        command = [mounted.get(part, part) for part in compose[service]["command"]]
        return Process(("bash", entrypoint, *command, *more), env=os.environ | {"ROS_LOG_DIR": str(tmp_path)})

    with started("robot"), started("monitor") as monitor, started("page", "--port", "0") as page:
        page.wait_for_text("Page: http")
        monitor.wait_for_text("Ready: robot 'panda'")
        page.wait_for_text("Showing robot 'panda'")
        assert {one.popen.poll() for one in (monitor, page)} == {None}
        for process in (page, monitor):
            process.stop(getattr(signal, compose["page"]["stop_signal"]))


# --- parameters of robots


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_a_node_takes_the_parameters_of_a_robot(ros_domain, path):
    """A monitor has every value of the file, as rcl reads it, and none is told of as unknown."""
    wanted = yaml.safe_load(path.read_text(encoding="utf-8"))["/**"]["ros__parameters"]
    context = rclpy.Context()
    rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
    try:
        node = MonitorNode(context=context)
        try:
            assert {name: node.get_parameter(name).value for name in wanted} == wanted
        finally:
            node.destroy_node()
    finally:
        context.shutdown()


def test_a_node_refuses_wrong_parameters_of_a_robot(ros_domain, tmp_path):
    """The test before this one can fail."""
    path = tmp_path / "wrong.yaml"
    path.write_text(ROBOTS[0].read_text(encoding="utf-8").replace("joint_timeout: 0.2", "joint_timeout: soon"))
    context = rclpy.Context()
    rclpy.init(args=["--ros-args", "--params-file", str(path)], context=context)
    try:
        with pytest.raises(InvalidParameterTypeException, match="joint_timeout"):
            MonitorNode(context=context)
    finally:
        context.shutdown()
