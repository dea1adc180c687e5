# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""Files of deploy/ and config/ with nodes in processes: systemd units, the container, the SROS 2
policy.
"""

import contextlib
import itertools
import os
import re
import shlex
import signal
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml
from rclpy.node import NodeNameNonExistentError

from controllers import effort_controller
from nodes import PANDA, robot
from processes import Process, node_process

pytestmark = [pytest.mark.full, pytest.mark.live]

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"
UNITS = sorted((ROOT / "deploy" / "systemd").glob("*.service"))


def at_hand(command, places):
    """A shell's text with the places of a robot's computer replaced by those of this one; each has
    to be there.
    """
    for place, allowed_names in places.items():
        assert place in command, place
        command = command.replace(place, str(allowed_names))
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

AT_WORK = {
    "monitor": "Waiting for a robot",
    "controller": "Waiting to be configured",
    "view": "Page: http",
}
"""What each node says when it has taken its parameters and is at work."""


@pytest.mark.parametrize("unit", UNITS, ids=lambda path: path.stem)
def test_units_start_nodes(ros_domain, tmp_path, unit):
    """By the line that systemd would run, as it is but for places; the signal that systemd sends
    ends them.
    """
    directives = dict(re.findall(r"^(\w+)=(.*)$", unit.read_text(encoding="utf-8"), re.M))
    shell, option, command = re.fullmatch(
        r"(/bin/bash) (-c) '([^']*)'", directives["ExecStart"]
    ).groups()
    node = unit.stem.rsplit("-")[-1]
    settings = SETTINGS[node]
    if isinstance(settings, dict):
        settings = tmp_path / "node.yaml"
        settings.write_text(
            yaml.safe_dump({"/**": {"ros__parameters": SETTINGS[node]}}), encoding="utf-8"
        )
    places = dict.fromkeys(
        ("/opt/ros/jazzy/setup.bash", "/home/ros/ws/install/setup.bash"), nothing(tmp_path)
    )
    command = at_hand(
        command, places | {f"/etc/diag_dynamics/{node}.yaml": shlex.quote(str(settings))}
    )
    with Process(
        (shell, option, command), env=os.environ | {"ROS_LOG_DIR": str(tmp_path)}
    ) as process:
        process.wait_for_text(AT_WORK[node])
        assert process.popen.pid == os.getpgid(process.popen.pid)
        assert process.children() == []  # exec: no shell in between
        process.stop(getattr(signal, directives["KillSignal"]))


# --- the policy for SROS 2


POLICY = CONFIG / "sros2_policy.xml"

LIMITS = POLICY.with_name("contact_limits.example.yaml")
"""With it the monitor judges contact, and the view listens to what it says of that."""

GRAPH = {
    ("topic", "publish"): "publisher",
    ("topic", "subscribe"): "subscriber",
    ("service", "reply"): "service",
    ("service", "request"): "client",
}

ACTION = {
    ("topic", "publish"): ("feedback", "status"),
    ("service", "reply"): ("send_goal", "cancel_goal", "get_result"),
    ("service", "request"): ("cancel_goal",),
}
"""Names of an action that its server uses, by kind and by use."""


def allowed(node):
    """Return the names that a node may use, by kind and by use, as the graph has them."""
    (profile,) = ElementTree.parse(POLICY).findall(f".//profile[@node='{node}']")
    assert profile.get("ns") == "/"
    result = {way: set() for way in GRAPH}
    for group in profile:
        if group.tag == "actions":
            assert group.attrib == {"call": "ALLOW", "execute": "ALLOW"}
            for action, (way, parts) in itertools.product(group, ACTION.items()):
                name = action.text.replace("~", f"/{node}")
                result[way] |= {f"{name}/_action/{part}" for part in parts}
            continue
        ((use, verdict),) = group.items()
        assert verdict == "ALLOW"
        for element in group:
            name = element.text.replace("~", f"/{node}")
            result[element.tag, use].add(name if name.startswith("/") else f"/{name}")
    return result


def used(peer, node):
    """Return the names that a node has on the graph; None if it is not there."""
    query = lambda kind: getattr(peer.node, f"get_{kind}_names_and_types_by_node")  # noqa: E731
    with contextlib.suppress(NodeNameNonExistentError):
        return {way: {name for name, _ in query(kind)(node, "/")} for way, kind in GRAPH.items()}


def check(peer, node, unused=()):
    """Wait until a node uses all that it is allowed, but for what it has in other settings only;
    and nothing else.
    """
    expected = allowed(node)
    for way, name in unused:
        expected[way].remove(name)
    try:
        peer.wait_until(
            lambda: used(peer, node) == expected,
            f"{node} to use what its policy allows",
        )
    except AssertionError:
        assert used(peer, node) == expected
        raise


def test_names_of_the_policy(peer):
    """All nodes have the names that the policy allows; the controller also while it asks for
    joints, by another node.
    """
    model = robot(PANDA)
    simulator = {"robot_description": model.path, "floating_base": True, "real_time_factor": 0.9}
    controller = {
        "robot_compensates_gravity": False,
        "autostart": True,
        "use_sim_time": True,
    }
    controller |= {"controlled_link": "panda_hand"}
    with (
        node_process("simulator", **simulator),
        node_process(
            "monitor", floating_base=True, use_sim_time=True, **{"contact_limits.file": LIMITS}
        ),
        node_process("controller", **controller),
        node_process("view", port=0, use_sim_time=True),
    ):
        check(peer, "diag_dynamics_controller_asking")
        with effort_controller(peer, "", model.names):
            check(peer, "diag_dynamics_controller")
            check(peer, "diag_dynamics")
            check(peer, "diag_dynamics_simulator", [(("topic", "subscribe"), "/clock")])
        check(peer, "diag_dynamics_view")
