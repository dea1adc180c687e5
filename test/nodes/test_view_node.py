# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The view on a real graph: simulator, monitor and view in processes of their own, read over a real connection."""

import contextlib
import signal
import socket
import threading

import numpy as np
import pytest
from diag_dynamics.msg import Contact, DiagonalizedState, ExternalTorque
from diag_dynamics.srv import SetPayload

import diag_dynamics as dd
from diag_dynamics.nodes.view.watched import APART
from nodes import MANY, MAX_AGE, PANDA, START, UR5, S, nanoseconds, robot
from processes import Process, node_process
from streams import CONTACT, DIAGNOSTICS, FRAME, HEARTBEAT, LAYOUT, Stream, get_json, wait_for_robot

pytestmark = [pytest.mark.full, pytest.mark.live]

MONITOR, VIEW = "/arm/diag_dynamics", "/diag_dynamics_view"

IN_ARM = ("-r", "__ns:=/arm")


def free_port(domain):
    """A port for the page that stays free while the view is not there.

    One that the system hands out might go to anybody meanwhile; this one is the ROS domain's, below those.
    """
    for port in range(21000 + domain, 31000, 200):
        with socket.socket() as probe, contextlib.suppress(OSError):
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return port
    raise AssertionError("no port is free")


def monitor_process(**parameters):
    """Start the monitor; a test that is late hears all that it says nonetheless."""
    observed = {"external_torque.gain": 25.0, "external_torque.threshold": 1e6, "max_age": MAX_AGE}
    deep = {
        f"qos_overrides.{MONITOR}/{topic}.publisher.depth": 1000 for topic in ("state", "external_torque", "contact")
    }
    return node_process("monitor", *IN_ARM, "-r", "/clock:=/arm/clock", **observed, **deep, **parameters)


def simulator_process(id, **parameters):
    parameters |= {"robot_description": robot(id).path, "motion": "wave", "rate": 50.0}
    return node_process("simulator", *IN_ARM, "-r", "/clock:=/arm/clock", **parameters)


class Graph:
    """The processes, some of which are started anew."""

    def __init__(self, domain):
        """Start all three."""
        self.port = free_port(domain)
        self.address = f"http://127.0.0.1:{self.port}/"
        self.simulator = simulator_process(PANDA)
        self.monitor = monitor_process()
        self.view = self.view_process()

    def view_process(self):
        return node_process("view", port=self.port, rate=100.0)

    def stream(self, **query):
        return Stream(self.address, timeout=START, robot="/arm", hz=100, **query)

    def stop(self):
        for process in (self.view, self.monitor, self.simulator):
            with process:
                pass


@pytest.fixture(scope="module")
def graph(ros_domain):
    graph = Graph(ros_domain)
    try:
        graph.view.wait_for_text(f"Page: {graph.address}")
        graph.view.wait_for_text("Showing robot 'panda' of /arm/diag_dynamics")
        yield graph
    finally:
        graph.stop()


def read_while(peer, read):
    """Call what reads a stream in a thread while the test's node is served; return what it returns."""
    found = []
    thread = threading.Thread(target=lambda: found.append(read()))
    thread.start()
    peer.wait_until(lambda: not thread.is_alive(), "what is read of a stream", START)
    return found[0]


def test_numbers_are_those_of_the_messages(graph, peer):
    """Each frame is the state of its stamp, with an external torque of about then, as float32; and of no other."""
    states = peer.topic(DiagonalizedState, f"{MONITOR}/state", MANY)
    torques = peer.topic(ExternalTorque, f"{MONITOR}/external_torque", MANY)
    peer.wait_until(lambda: states.messages and torques.messages, "states")
    with graph.stream(link="panda_hand") as stream:

        def read():
            """60 frames, and until 30 have an external torque: on a busy machine its messages may be late."""
            frames = stream.frames(60)
            while sum("no_external_torque" not in frame.flags for frame in frames) < 30:
                frames += stream.frames(1)
            return frames

        frames = read_while(peer, read)
    for topic in (states, torques):  # each may be late by itself
        peer.wait_until(lambda topic=topic: topic.stamps[-1] / S > frames[-1].t, "the last state")
    by_time = {nanoseconds(m.header.stamp) / S: m for m in states.messages}
    by_norm = {np.float32(m.norm): m for m in torques.messages if m.valid}
    dyn = dd.DiagonalDynamics(dd.load_urdf(robot(PANDA).path))
    for frame in frames[1:]:  # the first one may have been on its way before the test listened
        message = by_time.get(frame.t)
        assert message is not None, f"no state has the stamp {frame.t}"
        names = ("nu", "epsilon", "coriolis", "gravity", "effort")
        fields = {name: name for name in names} | {"q": "position", "qd": "velocity", "D": "articulated_inertia"}
        for name, field in fields.items():
            np.testing.assert_array_equal(frame[name], np.array(getattr(message, field), dtype=np.float32))
        assert frame["K"] == np.float32(message.kinetic_energy)
        np.testing.assert_allclose(frame["p_effort"] + frame["p_gravity"], message.power, rtol=1e-4, atol=1e-4)
        s = dyn.evaluate(message.position, message.velocity, message.effort)
        np.testing.assert_allclose(frame["link_energy"], s.link_energy, rtol=1e-5, atol=1e-7)
        place = dyn.placement(message.position, "panda_hand")[:3, 3]
        k = stream.layout["links"].index("panda_hand")
        np.testing.assert_allclose(frame["pose"].reshape(-1, 7)[k, :3], place, atol=1e-6)
        if "no_external_torque" not in frame.flags and frame.t - APART > torques.stamps[0] / S:
            torque = by_norm[np.float32(frame["norm"])]
            assert abs(nanoseconds(torque.header.stamp) / S - frame.t) <= APART + 1e-6  # times are doubles
            np.testing.assert_array_equal(frame["residual"], np.array(torque.residual, dtype=np.float32))
            np.testing.assert_array_equal(frame["external_torque"], np.array(torque.external_torque, dtype=np.float32))
        assert frame.flags <= {"no_external_torque", "late"}  # how late is the machine's business
    times = [frame.t for frame in frames]
    assert sorted(set(times)) == times


def test_what_comes_with_it(graph, peer):
    """Thresholds of the monitor, diagnostics of the robot's nodes, rate, latency, and that it lives."""
    with graph.stream() as stream:
        layout = stream.next(LAYOUT, lambda layout: layout["thresholds"]["norm"] == 1e6)
        assert layout["scene"]["missing"] == {}
        told = stream.next(DIAGNOSTICS, lambda told: len(told) >= 5)
        names = {one["name"] for one in told}
        assert {"arm/diag_dynamics: model", "arm/diag_dynamics_simulator: simulation"} <= names
        beat = stream.next(HEARTBEAT, lambda beat: beat["rate"] and 40.0 < beat["rate"] < 60.0)
        assert beat["alive"]
        assert beat["waiting"] == ""
        assert stream.next(FRAME)["latency"] >= 0.0
        assert stream.next(FRAME, lambda frame: frame["latency"] < 1.0)  # a busy machine may be late with some


def test_it_only_reads(graph, peer):
    """On the graph it publishes nothing but what every node does and its diagnostics, and calls for parameters alone."""
    node = peer.node
    peer.wait_until(
        lambda: ("diag_dynamics_view", "/") in node.get_node_names_and_namespaces(), "the view's name", START
    )
    expected = {"/rosout", "/parameter_events", "/diagnostics", f"{VIEW}/transition_event"}, {"get_parameters"}

    def seen():
        """What it publishes, and calls: a node may be known before all that it has."""
        published = node.get_publisher_names_and_types_by_node("diag_dynamics_view", "/")
        asks = node.get_client_names_and_types_by_node("diag_dynamics_view", "/")
        return {name for name, _ in published}, {name.rpartition("/")[2] for name, _ in asks}

    with contextlib.suppress(AssertionError):
        peer.wait_until(lambda: seen() == expected, "all that it has")
    assert seen() == expected


def test_a_payload_of_the_monitor_is_one_of_the_page(graph, peer):
    """What the monitor's model changes by while it runs, the page's follows: links' energies add up to the monitor's K."""
    with graph.stream() as stream:
        stream.frames(3)
        request = SetPayload.Request(link="panda_link7")
        request.inertia.m = 3.0
        response = peer.call(SetPayload, f"{MONITOR}/set_payload", request)
        assert response.success, response.message
        heavy = stream.next(
            LAYOUT,
            lambda layout: any(
                one["name"] == "panda_link7" and one["inertia"]["mass"] > 3.0 for one in layout["scene"]["links"]
            ),
        )
        assert heavy["robot"] == "panda"
        stream.next(FRAME, lambda frame: "other_model" not in frame.flags)  # a state of before may come yet
        for frame in stream.frames(5):
            assert frame["link_energy"].sum() == pytest.approx(frame["K"], rel=1e-4)
            assert "other_model" not in frame.flags
        request.inertia.m = 0.0
        assert peer.call(SetPayload, f"{MONITOR}/set_payload", request).success
        stream.next(LAYOUT)


def test_other_robots_are_found(graph, peer):
    """One whose monitor has begun later, in another namespace; no state has come of it yet."""
    with node_process("monitor", "-r", "__ns:=/other", robot_description=robot(UR5).path):
        wait_for_robot(graph.address, lambda one: (one["name"], one["robot"]) == ("/other", "ur5"))
        robots = {one["name"]: one for one in get_json(graph.address, "/robots")}
        assert not robots["/other"]["alive"]
        wait_for_robot(graph.address, lambda one: one["name"] == "/arm" and one["alive"])  # it may be late for a second
        assert get_json(graph.address, "/layout?robot=/other")["robot"] == "ur5"


def test_restart_of_the_monitor(graph):
    """The stream stays, says that the robot no longer lives, and goes on when the monitor is back."""
    with graph.stream() as stream:
        last = stream.frames(3)[-1].t
        graph.monitor.stop()
        stream.next(HEARTBEAT, lambda beat: not beat["alive"])
        graph.monitor = monitor_process()
        frame = stream.next(FRAME, lambda frame: frame.t > last + 1.0, timeout=START)
        assert np.isfinite(frame["nu"]).all()
        assert stream.next(HEARTBEAT, lambda beat: beat["alive"])["waiting"] == ""


def test_restart_of_the_view(graph):
    """It ends at once though a page is open, and comes back on the same port."""
    with graph.stream() as stream:
        stream.frames(3)
        graph.view.signal(signal.SIGINT)
        with pytest.raises((EOFError, ConnectionError)):
            stream.next(HEARTBEAT, lambda _: False)
        assert graph.view.wait() == 0
    assert "Traceback" not in graph.view.output
    graph.view = graph.view_process()
    graph.view.wait_for_text("Showing robot 'panda'")
    with graph.stream(link="panda_link5") as stream:
        assert np.isfinite(stream.frames(3)[-1]["mobility"]).all()


def test_a_port_that_is_taken(graph):
    """It says which, and ends."""
    process = node_process("view", port=graph.port)
    assert process.wait() == 1
    assert f"port {graph.port}: Address already in use. Port 0 takes a free one." in process.output


def test_lifecycle(graph, peer):
    """Deactivated it watches nobody, its page stays; cleaned up the page is gone, and comes back."""
    shown = "Showing robot 'panda'"
    before = graph.view.output.count(shown)
    try:
        assert peer.transition(VIEW, "deactivate")
        assert get_json(graph.address, "/robots") == []
        assert peer.transition(VIEW, "cleanup")
        with pytest.raises(ConnectionError):
            get_json(graph.address, "/robots")
        assert peer.set_parameter(VIEW, "rate", 20.0).successful
        result = peer.set_parameter(VIEW, "rate", 1e6)
        assert not result.successful
    finally:
        assert peer.transition(VIEW, "configure")
        assert peer.transition(VIEW, "activate")
    graph.view.wait_for(lambda output: output.count(shown) > before, "the robot again")
    with graph.stream() as stream:
        stream.frames(2)
        assert stream.next(HEARTBEAT)["hz"] == pytest.approx(20.0)


def test_contact_is_shown_where_limits_are_judged(graph, peer, tmp_path):
    """As the monitor tells it, by the stamp; one without limits would compute it for the page alone: nobody listens then."""
    assert peer.node.count_subscribers(f"{MONITOR}/contact") == 0
    limits = tmp_path / "limits.yaml"
    limits.write_text("regions: {nobody: {mass: 3.0, stiffness: 20000, force: 60}}")
    graph.monitor.stop()
    graph.monitor = monitor_process(**{"contact.limits_file": str(limits)})
    touches = peer.topic(Contact, f"{MONITOR}/contact", MANY)
    peer.wait_until(lambda: peer.node.count_subscribers(f"{MONITOR}/contact") == 2, "the view to listen", START)
    peer.wait_until(lambda: touches.messages, "the first message", START)
    with graph.stream() as stream:
        found = read_while(peer, lambda: [stream.next(CONTACT) for _ in range(4)])

    def both():
        """One of them and its message; times are doubles."""
        for told in found:
            for message in touches.messages:
                if abs(nanoseconds(message.header.stamp) / S - told["t"]) < 1e-6:
                    return told, message
        return None

    told, message = peer.wait_until(both, "its message")
    points = told["points"]
    assert told["worst"] == message.worst
    assert [(point["name"], point["link"]) for point in points] == list(
        zip(message.point_names, message.link_names, strict=True)
    )
    for name, field in (("speed", "speed"), ("mass", "reflected_mass"), ("energy", "transferable_energy")):
        np.testing.assert_array_equal([point[name] for point in points], getattr(message, field))
    np.testing.assert_array_equal(np.ravel([point["position"] for point in points]), message.positions)
    finite = np.isfinite(message.margin)
    assert finite.any()
    np.testing.assert_allclose(
        [point["margin"] for point, is_limited in zip(points, finite, strict=True) if is_limited],
        np.array(message.margin)[finite],
        atol=1e-12,
    )
    assert told["half"] == pytest.approx(0.5 * (17.451901 - 0.629769))  # of the links that move


def test_another_robot_comes(graph):
    """The robot is another one after a restart, under the same monitor: the stream goes on with another layout."""
    with graph.stream(link="panda_hand") as stream:
        stream.frames(2)
        graph.simulator.stop()
        stream.next(HEARTBEAT, lambda beat: not beat["alive"])
        graph.simulator = simulator_process(UR5)
        layout = stream.next(LAYOUT, lambda layout: layout["robot"] == "ur5", timeout=START)
        assert layout["link"] == ""  # that robot has no panda_hand
        frame = stream.next(FRAME)
        assert len(frame["nu"]) == 6
        assert frame["link_energy"].sum() == pytest.approx(frame["K"], rel=1e-4, abs=1e-6)
        assert np.isnan(frame["twist"]).all()


def test_foreign_time(graph):
    """A monitor by simulated time: how late its states are the view cannot know, and does not say."""
    graph.monitor.stop()
    graph.monitor = monitor_process(use_sim_time=True)
    graph.simulator.stop()
    graph.simulator = simulator_process(UR5, publish_clock=True)
    with graph.stream() as stream:
        frame = stream.next(FRAME, lambda frame: np.isnan(frame["latency"]), timeout=START)
        assert "late" not in frame.flags
        assert np.isfinite(frame["nu"]).all()


def test_scripts_have_it():
    """`diag-dynamics view --help` lists its parameters."""
    import sys
    from pathlib import Path

    script = Path(__file__).resolve().parents[2] / "scripts" / "view"
    process = Process([sys.executable, script, "--help"])
    assert process.wait() == 0
    assert "mesh_folders" in process.output
