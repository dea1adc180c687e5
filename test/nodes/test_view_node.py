# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The viewer node in process, with monitors beside it; its page is read by HTTP from this
machine.
"""

import numpy as np
import pytest
from diag_dynamics.msg import ContactLimits, DiagonalizedState
from diag_dynamics.srv import SetPayload
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import String

from diag_dynamics.exceptions import InputError
from nodes import LATCHED, PANDA, UR5, Monitor, S, nanoseconds, robot
from streams import DIAGNOSTICS, FRAME, HEARTBEAT, LAYOUT, Stream, get_json

FIELDS = {name: name for name in ("nu", "epsilon", "coriolis", "gravity", "effort")} | {
    "q": "position",
    "qd": "velocity",
    "D": "articulated_inertia",
}
"""Fields of a state's message, by those of a frame."""


@pytest.fixture(scope="module")
def start_view(peer):
    """Return a function that starts a view."""
    return lambda *arguments, port=0: peer.start("view", *arguments, port=port, rate=100.0)


@pytest.fixture(scope="module")
def view(start_view):
    """Start a view."""
    with start_view() as view:
        yield view


def start_monitor(peer, id, namespace, **parameters):
    """Start a monitor that observes external torque, and wait until a view shows its robot."""
    observed = {"external_torque.gain": 25.0, "collision.threshold": ["norm=1e6"]}
    monitor = Monitor(
        peer, namespace, robot_description=robot(id).path, **observed, **parameters
    ).connect(robot(id))
    peer.pass_time(3.0)
    return monitor


@pytest.fixture(scope="module")
def running(peer, view):
    """Start a monitor of the Panda."""
    with start_monitor(peer, PANDA, "/arm") as monitor:
        assert "Showing robot 'panda' of /arm/diag_dynamics" in view.output
        yield monitor


def stream_of(view, robot="/arm", **query):
    """Return the stream of a robot."""
    return Stream(view.node.address, robot=robot, hz=100, **query)


def frame_of(stream, stamp):
    """Return the frame with the time of a stamp."""
    return stream.next(FRAME, lambda frame: frame.t == stamp / S)


def test_numbers_are_those_of_the_messages(monitor, view, panda):
    """A frame is the state of its stamp and the external torque of about then, as float32."""
    with stream_of(view) as stream:
        for sample in range(3):
            message = monitor.serves(panda, sample)["state"]
            frame = frame_of(stream, monitor.now)
            for name, field in FIELDS.items():
                np.testing.assert_array_equal(
                    frame[name], np.array(getattr(message, field), dtype=np.float32)
                )
            assert frame["K"] == np.float32(message.kinetic_energy)
            assert frame.flags <= {"no_external_torque"}


def test_external_torque(peer, monitor, view, panda, monkeypatch):
    """The residual of a state's own time is in its frame with the contact; that of another time is
    not.
    """
    with stream_of(view) as stream:
        for _ in range(50):
            monitor.feeder.publish(panda.message(monitor.tick(S // 100), panda.samples[0]))
            peer.pass_time(0.01)
        frame = frame_of(stream, monitor.now)
        with monitor.having(**{"contact.threshold": ["total=1e-6"]}):
            for _ in range(3):
                monitor.feeder.publish(panda.message(monitor.tick(S // 100), panda.samples[0]))
                peer.pass_time(0.01)
            touched = frame_of(stream, monitor.now)
        monkeypatch.setattr("diag_dynamics.nodes.view.MAX_DIFFERENCE", -1.0)
        monitor.feeder.publish(panda.message(monitor.tick(S // 100), panda.samples[0]))
        peer.pass_time(0.01)
        other = frame_of(stream, monitor.now)
    assert "contact" in touched.flags and not {"contact", "collision"} & frame.flags
    assert "no_external_torque" not in frame.flags
    assert frame["norm"] > 0.0 and np.isfinite(frame["external_torque"]).all()
    assert "no_external_torque" in other.flags and np.isnan(other["norm"])


def test_thresholds_diagnostics_and_heartbeat(peer, monitor, view, panda, monkeypatch):
    """The page has thresholds of the monitor, diagnostics of the robot's nodes, and whether states
    come.
    """
    stale = "diag_dynamics.page.stream.STALE"
    monkeypatch.setattr(
        stale, np.inf
    )  # the server reads the time of the machine, which may be busy
    monitor.next_report()
    with stream_of(view) as stream:
        monitor.serves(panda)
        layout = stream.next(LAYOUT, lambda layout: layout["robot"] == "panda")
        assert layout["scene"]["missing"] == {}
        names = {
            entry["name"] for entry in stream.next(DIAGNOSTICS, lambda entries: len(entries) >= 4)
        }
        assert {"arm/diag_dynamics: model", "arm/diag_dynamics: joint states"} <= names
        stream.next(HEARTBEAT, lambda beat: beat["alive"] and beat["waiting"] == "")
        monkeypatch.setattr(stale, 0.0)
        stream.next(HEARTBEAT, lambda beat: not beat["alive"])


def test_statuses_that_are_not_repeated_are_removed(peer, monitor, view, monkeypatch):
    """As that of external torque when it is no longer observed."""
    with stream_of(view) as stream:
        stream.next(
            DIAGNOSTICS,
            lambda result: any(entry["name"].endswith("external torque") for entry in result),
        )
        with monitor.having(external_torque__gain=0.0, collision__threshold=[""]):
            monkeypatch.setattr("diag_dynamics.nodes.view.DIAGNOSTICS_TIMEOUT", 0.0)
            peer.pass_time(1.0)
            stream.next(
                DIAGNOSTICS,
                lambda result: (
                    not any(entry["name"].endswith("external torque") for entry in result)
                ),
            )
    peer.pass_time(1.0)  # the view loads the robot with the monitor's parameters
    robots = view.node._robots.values()
    peer.wait_until(lambda: not any(robot._loader.loading for robot in robots), "the robot")


def test_states_of_wrong_lengths_end_no_stream(peer, monitor, view, panda):
    """They are reported, and the next state is shown."""
    message = monitor.serves(panda, 0)["state"]
    with stream_of(view) as stream:
        frame_of(stream, monitor.now)
        message.nu = message.nu[:-1]
        state = peer.publisher(type(message), "/arm/diag_dynamics/state")
        state.publish(message)
        peer.wait_until(lambda: "nu has 7 entries; expected 8" in view.output, "an error")
        stream.next(HEARTBEAT, lambda beat: "nu has 7 entries" in beat["error"])
        monitor.serves(panda, 1)
        frame_of(stream, monitor.now)
        stream.next(HEARTBEAT, lambda beat: not beat["error"])


def test_it_only_reads(peer, monitor, view):
    """It publishes its own diagnostics and what every node publishes, and calls for parameters
    alone.
    """
    # A lifecycle node's ~/transition_event is not rclpy's, and so not on the test's graph.
    topics = {
        topic
        for topic, ends in peer.graph.publishers.items()
        if any(end.end.node is view.node for end in ends)
    }
    assert topics == {"/parameter_events", "/diagnostics"}
    assert {client.service_name.rpartition("/")[2] for client in view.node.clients} == {
        "get_parameters"
    }


def test_parameters_that_come_late(peer, view, monkeypatch):
    """The answer to a request counts though others were sent since."""
    waiting = []
    with monkeypatch.context() as patch:
        patch.setattr(peer.graph, "request", lambda *request: waiting.append(request))
        monitor = Monitor(peer, "/slow", robot_description=robot(UR5).path)
        peer.pass_time(3.5)
    peer.graph.request(*waiting[0])
    peer.pass_time(0.5)
    assert len(waiting) > 2
    assert "Showing robot 'ur5' of /slow/diag_dynamics" in view.output
    monitor.process.stop()


def test_a_payload_of_the_monitor_is_one_of_the_page(peer, monitor, view, panda):
    """The page's model follows the monitor's: energies of links add up to the monitor's K."""
    with stream_of(view) as stream:
        request = SetPayload.Request(link="panda_link7")
        request.inertia.m = 3.0
        assert monitor.call(SetPayload, "set_payload", request).success
        monitor.feeder.publish(panda.message(monitor.tick(), panda.samples[0]))
        peer.pass_time(0.1)
        assert "other_model" in frame_of(stream, monitor.now).flags
        peer.pass_time(3.0)
        monitor.feeder.publish(panda.message(monitor.tick(), panda.samples[0]))
        peer.pass_time(0.1)
        frame = frame_of(stream, monitor.now)
        links = stream.layout["scene"]["links"]
        (link,) = (element for element in links if element["name"] == "panda_link7")
        assert link["mass"] > 3.0
        assert "other_model" not in frame.flags
        assert frame["link_energy"].sum() == pytest.approx(frame["K"], rel=1e-4)
    request.inertia.m = 0.0
    assert monitor.call(SetPayload, "set_payload", request).success
    peer.pass_time(3.0)


def wait_for_error(peer, view, name, text):
    """Wait until the page has an error of a robot with a text, or without a text none."""

    def is_said():
        errors = {robot["name"]: robot["error"] for robot in get_json(view.node.address, "/robots")}
        return name in errors and (text in errors[name] if text else not errors[name])

    peer.wait_until(is_said, f"{text or 'no error'} of {name}")


def test_what_will_never_come_is_an_error(peer, view):
    """Parameters of a player, a description that is not latched, and one that the page rejects."""
    player = peer.extra_node("player", "/")
    player.create_publisher(DiagonalizedState, "/played/diag_dynamics/state", 1)
    described = peer.extra_node("describer", "/")
    with Monitor(peer, "/empty"):
        described.create_publisher(String, "/empty/robot_description", 1)  # not latched
        text = "/played/diag_dynamics/get_parameters has no answer"
        wait_for_error(peer, view, "/played", text)
        wait_for_error(peer, view, "/empty", "/empty/robot_description has no message")
        peer.drop_node(described)
        publisher = peer.publisher(String, "/empty/robot_description", LATCHED)
        publisher.publish(String(data="<robot"))
        wait_for_error(peer, view, "/empty", "robot of /empty/diag_dynamics: ")
        publisher.publish(String(data=XACRO.replace("$(arg side)_", "")))
        wait_for_error(peer, view, "/empty", "")
        peer.node.destroy_publisher(publisher)
    peer.drop_node(player)


def test_errors_of_the_robot_before(peer, view):
    """They end with a monitor that has the description as a parameter."""
    describer = peer.extra_node("describer", "/")
    describer.create_publisher(String, "/late/robot_description", 1)  # not latched
    with Monitor(peer, "/late") as monitor:
        wait_for_error(peer, view, "/late", "/late/robot_description has no message")
        monitor.process.stop()
    with start_monitor(peer, UR5, "/late"):
        wait_for_error(peer, view, "/late", "")
    peer.drop_node(describer)


def test_a_robot_without_its_parameters_file(peer, view, panda, tmp_path):
    """Page and diagnostics say that a file of the monitor's machine is missing here."""
    path = tmp_path / "arm.yaml"
    path.write_text("{}")
    reports = peer.topic(DiagnosticArray, "/diagnostics")
    with Monitor(peer, "/far", robot_description=panda.path, parameters_file=str(path)) as monitor:
        path.unlink()
        peer.pass_time(3.0)
        with stream_of(view, "/far") as stream:
            difference = stream.next(HEARTBEAT)["difference"]
    assert "without parameters_file" in difference and str(path) in difference
    messages = [entry.message for report in reports.messages for entry in report.status]
    assert difference in " ".join(messages)
    monitor.process.stop()


def test_publishers_without_a_robot(peer, start_view, monitor, monkeypatch):
    """They shut no robot out, and leave the list after their publisher."""
    junk = peer.extra_node("junk", "/")
    for k in range(4):
        junk.create_publisher(DiagonalizedState, f"/a{k}/diag_dynamics/state", 1)
    with (
        start_view("-r", "__node:=crowded_view") as view,
        start_monitor(peer, UR5, "/z"),
    ):
        peer.wait_until(lambda: "Showing robot 'ur5' of /z/" in view.output, "the robot")
        assert len(get_json(view.node.address, "/robots")) == 6
        peer.drop_node(junk)
        monkeypatch.setattr("diag_dynamics.nodes.view.REMOVAL_TIMEOUT", 0.0)
        peer.pass_time(1.5)
        names = [robot["name"] for robot in get_json(view.node.address, "/robots")]
        assert names == ["/arm", "/z"]


def test_restart_of_the_monitor(peer, view):
    """The stream stays, and goes on with the next monitor; another robot has another layout."""
    layouts = []
    with (
        start_monitor(peer, UR5, "/again") as monitor,
        stream_of(view, "/again", link="tool0") as stream,
    ):
        last = monitor.now
        for id in (UR5, PANDA):
            monitor.process.stop()
            with start_monitor(peer, id, "/again") as monitor:
                monitor.now = last = last + 1000 * S
                monitor.serves(robot(id), 1)
                frame = frame_of(stream, monitor.now)
                layouts.append((stream.layout["robot"], stream.next(HEARTBEAT)["link"]))
                assert frame["link_energy"].sum() == pytest.approx(frame["K"], rel=1e-4, abs=1e-6)
    assert layouts == [("ur5", "tool0"), ("panda", "panda_hand")]  # the Panda has no tool0


def test_restart_of_the_view(peer, start_view, monitor, panda, monkeypatch):
    """It ends though a page is open, and the next one has the same port; a third one names the
    port, and ends.
    """
    monkeypatch.setattr(
        "diag_dynamics.page.server.HEARTBEAT", 1000.0
    )  # states alone wake the sender
    second = ("-r", "__node:=second_view")
    with start_view(*second) as view, stream_of(view) as stream:
        stream.next(HEARTBEAT)
        port = int(view.node.address.rstrip("/").rpartition(":")[2])
        view.stop()
        with pytest.raises((EOFError, ConnectionError)):
            stream.next(HEARTBEAT, lambda _: False)
    with start_view(*second, port=port) as view:
        peer.pass_time(3.0)
        with stream_of(view, link="panda_link5") as stream:
            stream.next(HEARTBEAT)
            monitor.serves(panda)
            assert np.isfinite(frame_of(stream, monitor.now)["mobility_root"]).all()
        with pytest.raises(InputError) as caught:
            start_view("-r", "__node:=third_view", port=port)
        assert f"port {port}" in str(caught.value)


def test_contact_is_shown_where_limits_are_judged(peer, monitor, view, panda, tmp_path):
    """The page has the monitor's numbers by stamp; the view subscribes to contact only where the
    monitor has limits.
    """
    assert peer.node.count_subscribers("/arm/diag_dynamics/contact_limits") == 0
    limits = tmp_path / "limits.yaml"
    limits.write_text("regions: {nobody: {mass: 3.0, stiffness: 20000, force: 60}}")
    contacts = peer.topic(ContactLimits, "/limited/diag_dynamics/contact_limits")
    with start_monitor(peer, PANDA, "/limited", **{"contact_limits.file": str(limits)}) as monitor:
        monitor.next_report()
        assert peer.node.count_subscribers(f"{monitor.name}/contact_limits") == 2
        with stream_of(view, "/limited") as stream:
            stream.next(HEARTBEAT)
            monitor.serves(panda)
            frame = frame_of(stream, monitor.now)
        message = contacts.messages[-1]
    assert nanoseconds(message.header.stamp) == monitor.now
    about = stream.layout["contact_limits"]
    names = [(point["name"], point["link"]) for point in about["points"]]
    assert names == list(zip(message.point_names, message.link_names, strict=True))
    fields = {
        "speed": "speed",
        "mass": "reflected_mass",
        "energy": "transferable_energy",
        "allowed": "allowed_speed",
    }
    for name, field in fields.items():
        np.testing.assert_array_equal(
            frame[f"contact_limits_{name}"], np.array(getattr(message, field), dtype=np.float32)
        )
    worst = int(frame["contact_limits_worst"])
    assert worst == message.worst
    place = np.array(message.positions[3 * worst : 3 * worst + 3], dtype=np.float32)
    np.testing.assert_array_equal(frame["contact_limits_position"], place)


XACRO = """<robot name="expanded" xmlns:xacro="http://www.ros.org/wiki/xacro"><link name="base"/>
  <link name="tip"><inertial><mass value="1"/>
    <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="$(arg side)_turn" type="continuous"><parent link="base"/><child link="tip"/></joint>
    </robot>"""


def test_xacro_file_with_arguments(peer, view, tmp_path):
    """Monitor and view expand the file that the parameter robot_description names; an MJCF is
    refused by name.
    """
    path = tmp_path / "arm.urdf.xacro"
    mjcf = tmp_path / "arm.xml"
    path.write_text(XACRO)
    mjcf.write_text("<mujoco/>")
    with Monitor(peer, "/expanded", robot_description=f"{path} side:=left") as monitor:
        peer.pass_time(3.0)
        assert "Ready: robot 'expanded'" in monitor.process.output
        assert "Showing robot 'expanded' of /expanded/diag_dynamics" in view.output
        with stream_of(view, "/expanded") as stream:
            assert stream.next(LAYOUT)["dofs"] == ["left_turn"]
    with pytest.raises(
        InputError, match=r"expected a URDF or xacro file\. Nodes do not read MJCFs"
    ):
        Monitor(peer, "/mjcf", robot_description=str(mjcf))


def test_without_a_monitor(peer):
    """After three seconds log and page say what the view waits for, until there is a monitor."""
    with peer.start("view", "-r", "__ns:=/alone", port=0, robots="[/alone]") as view:
        peer.pass_time(2.0)
        assert "waiting for a monitor" not in view.output
        peer.pass_time(3.0)
        text = "expected a topic <name>/diag_dynamics/state of type diag_dynamics/msg/Diagonal"
        assert (
            view.output.count(f"[WARN] [diag_dynamics_view]: page: waiting for a monitor: {text}")
            == 1
        )
        (robot,) = get_json(view.node.address, "/robots")
        assert robot["waiting"].startswith("waiting for a monitor: ")
        assert "; this type is on " in robot["waiting"]
        assert robot["name"] == "no monitor" and not robot["alive"]
        with start_monitor(peer, UR5, "/alone"):
            assert [robot_id["name"] for robot_id in get_json(view.node.address, "/robots")] == [
                "/alone"
            ]
