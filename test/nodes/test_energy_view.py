# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The terminal view by itself: it finds a monitor, says what it waits for, and shows the topic it is told to."""

import contextlib
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from diag_dynamics.nodes.support.graph import NOT_YET_KNOWN, publishing
from nodes import START, Monitor, joint_state
from processes import Process

pytestmark = [pytest.mark.full, pytest.mark.live]

VIEW = Path(__file__).resolve().parents[2] / "scripts" / "energy_view"


def test_a_monitor_in_a_namespace_is_found(peer, panda, tmp_path):
    """The view says what it waits for; then it shows the states of the only monitor there is, wherever it is.

    One that is told of a topic listens to no other, and says which there are. A monitor at DEBUG tells of every rejection.
    """
    with contextlib.ExitStack() as stack:
        open_view = lambda *options: stack.enter_context(  # noqa: E731
            Process([sys.executable, VIEW, "--duration", "5", *options], cwd=tmp_path)
        )
        view, told = open_view(), open_view("--state", "/nowhere/state")
        view.wait_for_text("waiting for states on /diag_dynamics/state, published by nobody yet")
        view.wait_for_text("such states on no other topic")
        told.wait_for_text("waiting for states on /nowhere/state, published by nobody yet")
        debugged = ("--log-level", "away.diag_dynamics:=debug")
        monitor = Monitor(peer, "/away", *debugged, robot_description=panda.path)
        with monitor.process:
            monitor.connect(panda)
            assert monitor.next_report().entries["model"].hardware_id == "panda"
            told.wait_for_text("such states are on /away/diag_dynamics/state too: --state shows them")

            def over():
                monitor.serves(panda)
                return view.popen.poll() is not None

            peer.wait_until(over, "the end of the view", START)
            assert view.wait() == 0, view.output
            assert "states on /away/diag_dynamics/state, published by /away/diag_dynamics\n" in view.output
            assert "kinetic energy" in view.output
            assert (tmp_path / "kinetic_energy_robot.png").exists()
            monitor.feeder.publish(joint_state(panda.names, [0.0], stamp=monitor.tick()))
            monitor.process.wait_for_text("[DEBUG] ")
            monitor.process.wait_for_text("rejected: wrong length: ")


def test_a_topic_that_cannot_be_one(tmp_path):
    """A topic name that is none is refused before anything starts."""
    with Process([sys.executable, VIEW, "--state", "no topic"], cwd=tmp_path) as process:
        assert process.wait() == 2
        assert "argument --state: " in process.output
        assert "Traceback" not in process.output


def test_a_publisher_may_be_known_before_its_node():
    """It then has no name yet; rcl's word for that is nothing to show."""
    names = [("_NODE_NAMESPACE_UNKNOWN_", "_NODE_NAME_UNKNOWN_"), ("/arm", "driver")]
    found = [SimpleNamespace(node_namespace=space, node_name=name) for space, name in names]
    node = SimpleNamespace(get_publishers_info_by_topic=lambda topic: found)
    assert publishing(node, "/joint_states") == [NOT_YET_KNOWN, "/arm/driver"]
