# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The monitor as a managed node: every transition, and the topics and services of each state."""

import pytest
from diag_dynamics.srv import Diagonalize

from diag_dynamics.exceptions import InputError
from nodes import MS, OUTPUTS, PANDA, UR5, Monitor, Truth, robot

OK, WARN, ERROR = b"\x00", b"\x01", b"\x02"

INPUTS = {"joint_states", "odom", "robot_description"}
SERVICES = {"forward_dynamics", "inverse_dynamics", "diagonalize", "set_payload"}


@pytest.fixture(scope="module")
def managed(peer):
    """Start a monitor that does nothing by itself."""
    with Monitor(peer, "/managed", autostart=False) as monitor:
        yield monitor


def unconfigured(monitor):
    """Lead a monitor back to the beginning, from wherever it is, with its parameters as they were."""
    phase = monitor.peer.phase(monitor.name)
    monitor.transition(*{"active": ("deactivate", "cleanup"), "inactive": ("cleanup",)}.get(phase, ()))
    result = monitor.set_parameters({"mimic": "embed", "robot_description": ""})
    assert result.successful, result.reason
    assert monitor.peer.phase(monitor.name) == "unconfigured"


@pytest.fixture
def monitor(managed):
    """Return it unconfigured."""
    unconfigured(managed)
    managed.forget()
    return managed


def offers(monitor):
    """Return the outputs that it publishes, the inputs that it subscribes to, and its services."""
    graph, at = monitor.peer.graph, monitor.name
    namespace = at.rpartition("/")[0]
    outputs = {topic for topic in OUTPUTS if graph.publishers[f"{at}/{topic}"]}
    inputs = {topic for topic in INPUTS if graph.subscriptions[f"{namespace}/{topic}"]}
    return outputs, inputs, {name for name in SERVICES if f"{at}/{name}" in graph.services}


NOTHING = set(), set(), set()


def test_what_each_state_offers(monitor, panda):
    """Up and down again: only diagnostics; then a model and services; then states, too; and back."""
    peer = monitor.peer
    assert offers(monitor) == NOTHING
    report = monitor.next_report()
    assert report.values["lifecycle"] == "unconfigured"
    assert "unconfigured" in report.entries["joint states"].message

    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure")
    assert peer.phase(monitor.name) == "inactive"
    assert offers(monitor) == ({*OUTPUTS}, set(), SERVICES)
    request = Diagonalize.Request(state=panda.message(0, panda.samples[0]))
    response = monitor.call(Diagonalize, "diagonalize", request)
    assert response.success, response.message
    Truth(panda, *panda.samples[0][:3]).check_state(response.state)
    report = monitor.next_report()
    assert (report.values["lifecycle"], report.values["robot"]) == ("inactive", "panda")

    monitor.transition("activate")
    assert peer.phase(monitor.name) == "active"
    assert offers(monitor) == ({*OUTPUTS}, {"joint_states"}, SERVICES)
    for sample in range(3):
        monitor.connect(panda, sample).serves(panda, sample)

    monitor.transition("deactivate")
    assert offers(monitor) == ({*OUTPUTS}, set(), SERVICES)
    monitor.forget()
    received = monitor.next_report().count("received")
    monitor.feeder.publish(panda.message(monitor.tick(), panda.samples[0]))
    report = monitor.next_report()
    assert report.count("received") == received
    assert "inactive: nothing is listened to" in report.entries["joint states"].message
    assert not any(topic.messages for topic in monitor.topics.values())

    monitor.transition("cleanup")
    assert offers(monitor) == NOTHING
    assert "robot" not in monitor.next_report().values


def test_joints_are_forgotten_when_inactive(monitor, panda):
    """After a pause, a part of the joints is no state: what was before the pause does not stand for the rest."""
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda)
    monitor.serves(panda)
    monitor.transition("deactivate", "activate")
    before = monitor.next_report()
    monitor.forget()

    def incomplete(report):
        monitor.feeder.publish(panda.message(monitor.tick(MS), panda.samples[1], panda.names[:5]))
        return report.count("incomplete") > before.count("incomplete")

    report = monitor.wait_for_report(incomplete, "an incomplete state")
    assert report.values["missing joints"] == f"3: {', '.join(panda.names[5:])}"
    assert not monitor.topics["state"].messages
    monitor.connect(panda).serves(panda, 2)


@pytest.mark.parametrize(
    ("value", "reason"),
    [("/nowhere/robot.urdf", "/nowhere/robot.urdf"), ("<robot name='r'><link name='a'/>", "not well-formed")],
    ids=["no file", "malformed"],
)
def test_configure_fails_and_can_be_repeated(monitor, panda, value, reason):
    """It stays unconfigured, with nothing left over, and says why; with the parameter put right it goes on."""
    monitor.set_parameter("robot_description", value)
    assert not monitor.peer.transition(monitor.name, "configure")
    assert monitor.peer.phase(monitor.name) == "unconfigured"
    assert offers(monitor) == NOTHING
    report = monitor.next_report()
    model = report.entries["model"]
    assert model.level == ERROR
    assert reason in model.message and "robot_description" in model.message
    assert report.values["lifecycle"] == "unconfigured"

    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda).serves(panda, 1)
    assert monitor.next_report().entries["model"].level == OK


def test_reconfigured(monitor, panda):
    """What shapes the model changes only while unconfigured, and holds from then on; so does another robot."""
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda).serves(panda)
    for phase in ("active", "inactive"):
        assert monitor.peer.phase(monitor.name) == phase
        result = monitor.set_parameters({"mimic": "free"})
        assert not result.successful
        assert result.reason.startswith(
            "parameter 'mimic' is read-only while the node is configured: clean it up first"
        )
        if phase == "active":
            monitor.transition("deactivate")
    monitor.transition("cleanup")
    monitor.set_parameter("mimic", "free")
    monitor.transition("configure", "activate")
    free = robot(PANDA, free=True)
    monitor.connect(free).serves(free, 1)
    monitor.transition("deactivate", "cleanup")
    result = monitor.set_parameters({"mimic": "embed", "robot_description": str(robot(UR5).path)})
    assert result.successful, result.reason
    monitor.transition("configure", "activate")
    monitor.connect(robot(UR5)).serves(robot(UR5), 1)


def test_transitions_that_are_none(monitor, panda):
    """Activating what is not configured fails and changes nothing."""
    assert not monitor.peer.transition(monitor.name, "activate")
    assert monitor.peer.phase(monitor.name) == "unconfigured"
    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure")
    assert not monitor.peer.transition(monitor.name, "configure")
    assert monitor.peer.phase(monitor.name) == "inactive"
    monitor.transition("activate")
    monitor.connect(panda).serves(panda)


def test_pauses_leave_nothing_behind(monitor, panda):
    """After fifty pauses and ten configurations a monitor has as many ends, services and timers as after the first."""
    graph = monitor.peer.graph

    def count():
        ends = (graph.publishers, graph.subscriptions)
        return [sum(map(len, topics.values())) for topics in ends], len(graph.services), len(graph.timers)

    monitor.set_parameter("robot_description", str(panda.path))
    monitor.transition("configure", "activate")
    monitor.connect(panda)
    before = count()
    for _ in range(10):
        for _ in range(5):
            monitor.transition("deactivate", "activate")
        monitor.serves(panda)
        monitor.transition("deactivate", "cleanup", "configure", "activate")
    assert count() == before
    monitor.serves(panda, 1)
    report = monitor.next_report()
    assert report.count("received") == report.outcomes()


def test_shut_down(peer, panda):
    """A monitor that was shut down has neither topics nor services."""
    with Monitor(peer, "/finalized", robot_description=panda.path) as monitor:
        monitor.connect(panda)
        monitor.transition("shutdown")
        assert peer.phase(monitor.name) == "finalized"
        assert offers(monitor) == NOTHING


def test_autostart_with_a_robot_that_is_none(peer):
    """The node is not made, and the error names parameter and file: an executable ends with status 1."""
    with pytest.raises(InputError) as caught:
        peer.start("monitor", robot_description="/nowhere/robot.urdf")
    assert "robot_description" in str(caught.value) and "/nowhere/robot.urdf" in str(caught.value)
