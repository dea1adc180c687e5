# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The policy for SROS 2: it allows each node all that it has on the graph, or it would not start, and nothing besides."""

import contextlib
from pathlib import Path
from xml.etree import ElementTree

import pytest
from rclpy.node import NodeNameNonExistentError

from controllers import effort_controller
from nodes import PANDA, START, robot
from processes import node_process

pytestmark = [pytest.mark.full, pytest.mark.live]

POLICY = Path(__file__).resolve().parents[2] / "config" / "sros2_policy.xml"

LIMITS = POLICY.with_name("contact_limits.example.yaml")
"""With it the monitor judges contact, and the view listens to what it says of that."""

GRAPH = {
    ("topic", "publish"): "publisher",
    ("topic", "subscribe"): "subscriber",
    ("service", "reply"): "service",
    ("service", "request"): "client",
}


def allowed(node):
    """Return the names that a node may use, by kind and by use, as the graph has them."""
    (profile,) = ElementTree.parse(POLICY).findall(f".//profile[@node='{node}']")
    assert profile.get("ns") == "/"
    found = {way: set() for way in GRAPH}
    for element in profile.iterfind("*/*"):
        (parent,) = [group for group in profile if element in group]
        (use,) = parent.keys()
        assert parent.get(use) == "ALLOW"
        name = element.text.replace("~", f"/{node}")
        found[element.tag, use].add(name if name.startswith("/") else f"/{name}")
    return found


def used(peer, node):
    """Return what it has on the graph; None if it is not there."""
    query = lambda kind: getattr(peer.node, f"get_{kind}_names_and_types_by_node")  # noqa: E731
    with contextlib.suppress(NodeNameNonExistentError):
        return {way: {name for name, _ in query(kind)(node, "/")} for way, kind in GRAPH.items()}


def check(peer, node, unused=()):
    """Wait until a node uses all that it is allowed, but for what it has in other settings only; and nothing else."""
    expected = allowed(node)
    for way, name in unused:
        expected[way].remove(name)
    now = None

    def agrees():
        nonlocal now
        now = used(peer, node)
        return now == expected

    try:
        peer.wait_until(agrees, f"{node} to use what its policy allows", START)
    except AssertionError:
        assert now == expected
        raise


@pytest.fixture(scope="module")
def three(peer):
    """Start all nodes in the root namespace, where the policy has them, with all inputs and outputs."""
    model = robot(PANDA)
    simulator = {"robot_description": model.path, "floating_base": True, "publish_clock": True}
    controller = {"robot_compensates_gravity": False, "check_time": 60.0, "autostart": True, "use_sim_time": True}
    controller |= {"controlled_link": "panda_hand"}
    with (
        node_process("simulator", **simulator),
        node_process("monitor", floating_base=True, use_sim_time=True, **{"contact.limits_file": LIMITS}),
        node_process("controller", **controller),
        node_process("view", port=0, use_sim_time=True),
    ):
        yield model


def test_names_of_the_policy(peer, three):
    """The controller's for the time in which it asks for joints, too, and then with a client of its own."""
    check(peer, "diag_dynamics_controller_asking")
    with effort_controller(peer, "", three.names):
        check(peer, "diag_dynamics_controller")
        check(peer, "diag_dynamics")
        check(peer, "diag_dynamics_simulator", [(("topic", "subscribe"), "/clock")])
    check(peer, "diag_dynamics_view")
    check(peer, "diag_dynamics_view_reading")
