# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page's server over real connections. A test waits for packets and answers, never for time to pass."""

import contextlib
import http.client
import itertools
import socket
import time

import numpy as np
import pytest

import diag_dynamics as dd
import page_fixture
from diag_dynamics.page.contact import Touch
from diag_dynamics.page.frames import States
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import Limits, PageServer
from diag_dynamics.page.show import Show, Taken
from robots import description, joint, link, robot_path
from streams import CONTACT, DIAGNOSTICS, FRAME, HEARTBEAT, LAYOUT, PATIENCE, Stream, get, get_json

PANDA = robot_path("panda_description/urdf/panda.urdf")
ONE_POINT = [np.ones(1) for _ in ("speed", "mass", "energy", "allowed")]


class Robot:
    """A robot with another random state whenever a frame is made; the stamp of state k is k."""

    def __init__(self, urdf, name="/arm"):
        self.model = dd.load_urdf(urdf, massless="lock")
        self.rng, self.numbers = np.random.default_rng(4), itertools.count(1)
        self.show = Show(name, self.take, self.take_contact)

    def serve(self, scene=None, meshes=None):
        self.show.use(dd.DiagonalDynamics(self.model), scene, meshes)
        return self.show

    def take(self, dynamics):
        q, nv = dynamics.model.random(self.rng), dynamics.model.nv
        qd, tau = self.rng.normal(size=(2, nv))
        states = States.of(next(self.numbers), q, qd, tau, dynamics.evaluate(q, qd, tau))
        limits = (*np.full(nv, 12.0), np.inf, 8.0)
        return Taken(states, received=time.monotonic(), limits=limits)

    def take_contact(self, _):
        return Touch(1.0, ["tool"], [self.model.root_link], np.zeros(3), *ONE_POINT, 0, False)


@pytest.fixture(scope="module")
def arm():
    robot = Robot(PANDA)
    meshes = MeshLibrary(mesh_folders(str(PANDA)))
    robot.serve(scene_of(robot.model, str(PANDA), meshes), meshes)
    robot.show.tell([{"level": 0, "name": "rates", "message": "well", "values": {"gaps": 0}}])
    return robot


@pytest.fixture
def serve(tmp_path):
    """Return a function that serves some shows with a small page; no line may be logged by then."""
    files = {"index.html": 1000 * "hello ", "page.js": "1;", "page.css": "body {}", "licences.txt": "MIT"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with contextlib.ExitStack() as stack:

        def start(*shows, **options):
            faults = []
            server = PageServer(lambda: shows, log=faults.append, **{"static": tmp_path, **options})
            server.start()
            stack.callback(lambda: pytest.fail(f"logged: {faults}") if faults else None)
            stack.callback(server.stop)
            return server.address

        yield start


@pytest.fixture
def address(serve, arm):
    """Return the address of a server with two robots; the second one has no model."""
    return serve(arm.show, Show("/other", lambda _: None))


# --- Requests ---


def test_files_and_their_headers(address):
    kinds = {"/": "text/html", "/page.js": "text/javascript", "/page.css": "text/css"}
    for path, kind in kinds.items():
        status, headers, body = get(address, path)
        assert (status, headers["Content-Type"].split(";")[0]) == (200, kind)
        assert len(body) == int(headers["Content-Length"]) > 0
        assert headers["X-Content-Type-Options"] == "nosniff"
        policy = headers["Content-Security-Policy"].replace(";", " ").split()
        assert {"default-src", "'none'", "connect-src", "'self'"} <= set(policy)
        assert not {"http:", "https:", "*"} & set(policy)
    _, headers, body = get(address, "/", **{"Accept-Encoding": "gzip"})
    assert headers["Content-Encoding"] == "gzip"
    assert len(body) < 1000


@pytest.mark.parametrize(
    ("status", "path"),
    [
        *((404, f"/{path}") for path in ("../server.py", "..%2f..%2fserver.py", "/etc/passwd", "mesh/..", "x")),
        *((404, f"/{path}") for path in ("layout?robot=/nobody", "layout", f"mesh/{64 * '0'}")),
        (503, "/layout?robot=/other"),
        *((400, f"/stream?robot=/arm&{query}") for query in ("hz=nan", "hz=0", "hz=x", "hz=-1", "link=nobody")),
    ],
)
def test_requests_that_are_rejected(address, status, path):
    assert get(address, path)[0] == status


def test_only_get_and_only_by_an_own_name(address):
    """The server rejects host names of others (DNS rebinding)."""
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD"):
        status, headers, _ = get(address, "/robots", method)
        assert (status, headers["Allow"]) == (405, "GET")
    names = {"evil.example": 403, "localhost:1234": 200, "127.0.0.1": 200, "[::1]:80": 200}
    assert {name: get(address, "/robots", Host=name)[0] for name in names} == names


def test_a_port_that_is_taken(address):
    assert address.startswith("http://127.0.0.1:")
    taken = int(address.split(":")[-1].strip("/"))
    for where, key in (
        ({"port": taken}, "already in use"),
        ({"port": 70000}, "port 70000"),
        ({"host": "300.1.1.1"}, "host '300.1.1.1'"),
        ({"host": ""}, "host ''"),
    ):
        with pytest.raises(dd.InputError, match=key):
            PageServer(list, **where)


def test_robots_and_meshes(address):
    arm, other = get_json(address, "/robots")
    assert [arm[key] for key in ("name", "robot", "alive")] == ["/arm", "panda", True]
    assert [other[key] for key in ("name", "robot", "alive")] == ["/other", None, False]
    with Stream(address, robot="/other") as stream:
        kind, beat = stream.packet()
    assert (kind, beat["waiting"], beat["alive"]) == (HEARTBEAT, "waiting for a robot", False)
    layout = get_json(address, "/layout?robot=/arm")
    shas = {shape["mesh"] for one in layout["scene"]["links"] for shape in one["visuals"]}
    assert len(shas) == 10
    for sha in shas:
        status, _, body = get(address, f"/mesh/{sha}")
        assert status == 200
        assert len(body) == 8 + 12 * int(np.frombuffer(body, "<u4", 2).sum())


def test_bytes_that_are_no_request(address):
    """The server rejects them or ends the connection, and serves the next request."""
    rng = np.random.default_rng(5)
    lines = (
        *("", "/ HTTP/9.9", "/%ff%00 HTTP/1.1\r\nHost: localhost", "http://[ HTTP/1.1\r\nHost: localhost"),
        *("/ HTTP/1.1\r\nHost: [", f"/{100_000 * 'a'} HTTP/1.1", "/ HTTP/1.1\r\n" + 300 * "X: y\r\n"),
        "/stream?robot=%2Farm&hz=1e999 HTTP/1.1\r\nHost: localhost",
    )
    nonsense = [rng.integers(0, 256, 400, dtype=np.uint8).tobytes() for _ in range(20)]
    for data in (*nonsense, *(f"GET {line}\r\n\r\n".encode() for line in lines)):
        with connected(address) as one, contextlib.suppress(OSError):  # it may hang up while we send
            one.sendall(data)
            one.shutdown(socket.SHUT_WR)
            assert b"200 OK" not in one.recv(4096), data[:60]
    assert get(address, "/robots")[0] == 200


def connected(address):
    host, port = address.removeprefix("http://").strip("/").split(":")
    return socket.create_connection((host, int(port)), timeout=PATIENCE)


def test_connections_without_a_request_cannot_take_all_threads(address):
    with contextlib.ExitStack() as stack:
        idle = [stack.enter_context(connected(address)) for _ in range(60)]
        assert idle[-1].recv(1) == b""
    for _ in range(1000):  # the server's threads are free once they have read the end of the connections
        with contextlib.suppress(http.client.RemoteDisconnected, ConnectionError):
            assert get(address, "/robots")[0] == 200
            return
    raise AssertionError("no request is answered after the connections have been closed")


# --- Streams ---


def test_a_stream_has_the_numbers_of_the_states(address, arm):
    """The layout comes first. Frames have the evaluations of their states."""
    dyn = dd.DiagonalDynamics(arm.model)
    with Stream(address, robot="/arm", hz=50, link="panda_hand") as stream:
        kind, layout = stream.packet()
        assert (kind, layout["link"]) == (LAYOUT, "panda_hand")
        assert layout["dofs"] == list(arm.model.dof_names)
        assert layout["thresholds"]["external_torque"] == [12.0] * arm.model.nv
        assert layout["thresholds"]["norm"] == 8.0
        before = 0.0
        for frame in stream.frames(10):
            q, qd, tau = (frame[name].astype(float) for name in ("q", "qd", "effort"))
            K = dyn.evaluate(q, qd, tau).kinetic_energy
            np.testing.assert_allclose([frame["K"], frame["link_energy"].sum()], K, rtol=1e-4)
            velocity = dyn.link_velocity(q, qd, "panda_hand", frame="world")[:3]
            np.testing.assert_allclose(frame["link_velocity"], velocity, atol=1e-4)
            assert frame.t > before
            before = frame.t
        assert stream.next(HEARTBEAT)["alive"]
    with Stream(address, robot="/arm") as stream:
        assert stream.next(CONTACT)["points"][0]["name"] == "tool"
        assert stream.next(DIAGNOSTICS)[0]["values"] == {"gaps": 0}


def test_streams_share_a_limit(serve, arm):
    """A stream has the rate of its request up to a limit; streams share the limit of frames."""
    for asked, served in ((10, 10.0), (1000, 50.0)):
        with Stream(serve(arm.show, limits=Limits(rate=50.0)), hz=asked) as stream:
            assert stream.next(HEARTBEAT)["hz"] == pytest.approx(served)
    address = serve(arm.show, limits=Limits(rate=50.0, streams=3, frames=60.0))
    with Stream(address) as one, Stream(address), Stream(address):
        assert one.next(HEARTBEAT, lambda beat: beat["streams"] == 3)["hz"] == pytest.approx(20.0)
        status, _, body = get(address, "/stream")
        assert (status, b"All 3 streams" in body) == (503, True)


def test_a_slow_reader_gets_the_present_and_makes_nobody_wait(serve):
    """Other readers receive their frames. The slow one finds few old frames, and the number of skipped ones."""
    links = [link(f"l{k}", 1.0, (0, 0, 0.1), (0.01, 0, 0, 0.01, 0, 0.01)) for k in range(61)]
    joints = [joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", (k % 2, 1 - k % 2, 0)) for k in range(60)]
    address = serve(Robot(description("chain", *links, *joints)).serve())
    with Stream(address, hz=60, room=4096) as slow:
        first = slow.next(FRAME).t
        with Stream(address, hz=60) as quick:
            present = quick.frames(150)[-1].t
        old = sum(1 for _ in itertools.takewhile(lambda frame: frame.t < present, iter(lambda: slow.next(FRAME), None)))
        assert old < 75 < present - first
        assert slow.next(HEARTBEAT, lambda beat: beat["skipped"] > 75)["served"] < present


def test_whoever_never_reads_loses_the_stream(serve, arm, monkeypatch):
    monkeypatch.setattr("diag_dynamics.page.server.PATIENCE", 0.5)
    address = serve(arm.show)
    with Stream(address, hz=60, room=4096) as idle, Stream(address, hz=60) as reader:
        assert "200 OK" in idle.head
        reader.next(HEARTBEAT, lambda beat: beat["streams"] == 1)


def test_streams_end_with_the_server_and_another_one_takes_its_port(arm):
    def server(port=0):
        one = PageServer(lambda: [arm.show], port=port)
        one.start()
        return one

    first = server()
    with Stream(first.address) as stream:
        stream.frames(2)
        first.stop()
        with pytest.raises((EOFError, ConnectionError)):
            stream.next(HEARTBEAT, lambda _: False)
    again = server(first.server_port)
    with Stream(again.address) as stream:
        assert stream.next(FRAME)["K"] >= 0.0
    again.stop()


def test_another_robot_has_a_layout_of_its_own(serve):
    """The stream goes on; a link that the new robot lacks is no longer chosen."""
    robot = Robot(PANDA)
    with Stream(serve(robot.serve()), link="panda_hand") as stream:
        stream.frames(2)
        robot.model = dd.load_urdf(page_fixture.ARM)
        robot.serve()
        layout = stream.next(LAYOUT)
        assert (layout["dofs"], layout["link"]) == (list(robot.model.dof_names), "")
        assert np.isnan(stream.next(FRAME)["link_velocity"]).all()
        assert stream.next(HEARTBEAT, lambda beat: beat["robot"] == "arm")["link"] == ""
