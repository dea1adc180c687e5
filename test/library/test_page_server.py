# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page's server over real connections. A test waits for messages and answers, never for time to
pass.
"""

import asyncio
import contextlib
import errno
import http.client
import itertools
import queue
import socket
import threading
import time

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.page import server
from diag_dynamics.page.frames import States
from diag_dynamics.page.meshes import MeshLibrary
from diag_dynamics.page.scene import mesh_folders, scene_of
from diag_dynamics.page.server import PageServer
from diag_dynamics.page.stream import Received, RobotStream
from limits import HANG
from robots import description, joint, link, robot_path
from streams import DIAGNOSTICS, FRAME, HEARTBEAT, LAYOUT, Stream, get, get_json

PANDA = robot_path("panda_description/urdf/panda.urdf")


class Robot:
    """A robot with another random state whenever a frame is made; the stamp of state k is k."""

    def __init__(self, urdf, name="/arm"):
        self.model = dd.load_urdf(urdf, massless="lock")
        self.rng = np.random.default_rng(4)
        self.numbers = itertools.count(1)
        self.stream = RobotStream(name, self.read)

    def serve(self, scene=None, meshes=None):
        self.stream.set_robot(dd.DiagonalDynamics(self.model), scene, meshes)
        return self.stream

    def read(self, dynamics):
        q = dynamics.model.random(self.rng)
        nv = dynamics.model.nv
        qd, tau = self.rng.normal(size=(2, nv))
        states = States.of(next(self.numbers), q, qd, tau, dynamics.evaluate(q, qd, tau))
        return Received(states, time.monotonic(), limits=(*np.full(nv, 12.0), np.inf, 8.0))


@pytest.fixture(scope="module")
def arm():
    robot = Robot(PANDA)
    meshes = MeshLibrary(mesh_folders(str(PANDA)))
    robot.serve(scene_of(robot.model, str(PANDA), meshes), meshes)
    robot.stream.set_diagnostics(
        [{"level": 0, "name": "rates", "message": "well", "values": {"gaps": 0}}]
    )
    return robot


@pytest.fixture
def serve():
    """Return a function that serves some streams and returns the address."""
    with contextlib.ExitStack() as stack:

        def start(*streams, **options):
            server = PageServer(lambda: streams, **options)
            server.start()
            stack.callback(server.stop)
            return server.address

        yield start


@pytest.fixture
def address(serve, arm):
    """Return the address of a server with two robots; the second one has no model."""
    return serve(arm.stream, RobotStream("/other", lambda _: None))


def rejected(address, **query):
    """Return code and reason with which the server closes a stream."""
    with Stream(address, **query) as stream, pytest.raises(EOFError) as caught:
        stream.next(HEARTBEAT, lambda _: False)
    return caught.value.args


# --- Requests ---


def test_a_port_that_cannot_be_served():
    with pytest.raises(dd.InputError, match="port 70000"):
        PageServer(list, port=70000)


def test_files_and_their_headers(serve, arm, tmp_path, monkeypatch):
    """Files may be symlinks, as colcon --symlink-install installs them."""
    for path in server.STATIC.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.setattr(server, "STATIC", tmp_path)
    address = serve(arm.stream)
    for path, kind in {"/": "text/html", "/page.js": "javascript", "/page.css": "text/css"}.items():
        status, headers, body = get(address, path)
        assert (status, kind in headers["Content-Type"], len(body) > 0) == (200, True, True)
        assert headers["X-Content-Type-Options"] == "nosniff"
        policy = headers["Content-Security-Policy"].replace(";", " ").split()
        assert {"default-src", "'none'", "connect-src", "'self'"} <= set(policy)
        assert not {"http:", "https:", "*"} & set(policy)


@pytest.mark.parametrize(
    ("status", "path"),
    [
        *(
            (404, f"/{path}")
            for path in ("../server.py", "..%2f..%2fserver.py", "/etc/passwd", "mesh/..", "x")
        ),
        (404, f"/mesh/{64 * '0'}"),
        (400, "/stream?robot=/arm"),
    ],
)
def test_requests_that_are_rejected(address, status, path):
    result, headers, _ = get(address, path)
    assert result == status or (result, status) == (403, 404)
    assert headers["X-Content-Type-Options"] == "nosniff"


def test_only_get_by_its_own_name_and_its_own_page(address):
    """The server rejects host names of others (DNS rebinding), and pages of others: these may open
    websockets.
    """
    for method in ("POST", "PUT", "DELETE", "PATCH", "OPTIONS"):
        assert get(address, "/robots", method)[0] == 405
    names = {
        "evil.example": 403,
        "localhost:1234": 200,
        "127.0.0.1": 200,
        "[::1]:80": 200,
        "robot.local": 403,
        "localhost:65536": 403,
        f"{socket.gethostname()}.local:80": 200,
    }
    assert {name: get(address, "/robots", Host=name)[0] for name in names} == names
    for origin, answer in {
        "http://evil.example": "403 Forbidden",
        address.rstrip("/"): "101 Switching",
    }.items():
        with Stream(address, origin=origin, robot="/arm") as stream:
            assert answer in stream.head


def test_connections_above_the_maximum_are_refused(address):
    """Idle ones count. A connection that closes makes room."""
    where = "127.0.0.1", int(address.split(":")[-1].strip("/"))
    with contextlib.ExitStack() as stack:
        others = [
            stack.enter_context(socket.create_connection(where, HANG))
            for _ in range(server.MAX_CONNECTIONS)
        ]
        with socket.create_connection(where, HANG) as refused:
            assert refused.recv(1) == b""
        others[-1].sendall(b"GET /robots HTTP/1.0\r\nHost: localhost\r\n\r\n")
        assert others[-1].recv(12) == b"HTTP/1.0 200"
        others.pop().close()
        assert get_json_when_free(address)


def test_errors_of_accepting_are_logged_once_a_minute(serve, arm, monkeypatch, caplog):
    """Then connections are accepted again."""
    loop = asyncio.SelectorEventLoop
    errors = iter([OSError(errno.EMFILE, "no descriptor")] * 20)
    accept = loop.sock_accept

    async def fail_at_first(*arguments):
        for error in errors:
            raise error
        return await accept(*arguments)

    monkeypatch.setattr(loop, "sock_accept", fail_at_first)
    monkeypatch.setattr(server, "ACCEPT_RETRY_PERIOD", 1e-3)
    assert get_json(serve(arm.stream), "/robots")
    assert len(caplog.messages) == 1 and "no descriptor" in caplog.text


def get_json_when_free(address):
    """Return the list of robots when the server has noticed that a connection has closed."""
    for _ in range(1000):
        with contextlib.suppress(ConnectionError, http.client.BadStatusLine):
            return get_json(address, "/robots")
    raise AssertionError("no room after a connection has closed")


def test_robots_and_meshes(address):
    arm, other = get_json(address, "/robots")
    assert [arm[key] for key in ("name", "robot", "alive")] == ["/arm", "panda", True]
    assert [other[key] for key in ("name", "robot", "alive")] == ["/other", None, False]
    with Stream(address, robot="/other") as stream:
        assert stream.next(HEARTBEAT)["waiting"] == "waiting for a robot"
    with Stream(address, robot="/arm") as stream:
        layout = stream.next(LAYOUT)
    shas = {shape["mesh"] for element in layout["scene"]["links"] for shape in element["visuals"]}
    assert len(shas) == 10
    for sha in shas:
        status, headers, body = get(address, f"/mesh/{sha}")
        assert (status, "immutable" in headers["Cache-Control"]) == (200, True)
        assert len(body) == 8 + 12 * int(np.frombuffer(body, "<u4", 2).sum())


# --- Streams ---


def test_contents_of_a_stream(address, arm):
    """The layout comes first. Later states have later frames."""
    with Stream(address, robot="/arm", hz=50, link="panda_link5") as stream:
        kind, layout = stream.packet()
        assert (kind, layout["dofs"]) == (LAYOUT, list(arm.model.dof_names))
        assert layout["thresholds"]["external_torque"] == [12.0] * arm.model.nv
        assert layout["thresholds"]["norm"] == 8.0
        assert stream.next(DIAGNOSTICS)[0]["values"] == {"gaps": 0}
        frames = stream.frames(10)
        assert (np.diff([frame.t for frame in frames]) > 0.0).all()
        energies = [[frame["K"], frame["link_energy"].sum()] for frame in frames]
        np.testing.assert_allclose(*np.transpose(energies), rtol=1e-4)
        heartbeat = stream.next(HEARTBEAT)
        assert (heartbeat["alive"], heartbeat["link"]) == (True, "panda_link5")


def test_a_robot_that_is_not_shown(serve, arm):
    """The answer has the robots that are shown, or what to do without any."""
    for streams, reason in (([arm.stream], "expected one of /arm"), ([], "Start a monitor")):
        status, text = rejected(serve(*streams), robot="/nothing")
        assert status == 4404 and text.startswith("robot is '/nothing'; ") and reason in text


def test_a_stream_that_fails_names_the_error(serve):
    """The page shows it as an error."""
    arm = Robot(PANDA)
    arm.serve()
    address = serve(arm.stream)
    arm.stream.read = arm.stream.newest = lambda _: 1 / 0
    assert rejected(address) == (4500, "internal error: ZeroDivisionError('division by zero')")


@pytest.mark.parametrize(
    ("hz", "served"), [(10, 10.0), (1000, 50.0), ("nan", 1.0), (-1, 1.0), ("1e999", 50.0)]
)
def test_the_rate_of_a_stream(serve, arm, hz, served):
    with Stream(serve(arm.stream, rate=50.0), hz=hz) as stream:
        assert stream.next(HEARTBEAT)["hz"] == pytest.approx(served)


def test_streams_share_the_maximum_of_frames(serve, arm, monkeypatch):
    monkeypatch.setattr("diag_dynamics.page.server.MAX_FRAMES", 60.0)
    address = serve(arm.stream, rate=50.0)
    with Stream(address) as stream, Stream(address), Stream(address):
        assert stream.next(HEARTBEAT, lambda beat: beat["streams"] == 3)["hz"] == pytest.approx(20)


def test_a_tab_pushes_the_link_that_it_shows(serve, arm):
    """Other texts do nothing, a failure ends no stream, and a tab pushes ten times per second at
    most.
    """
    links = queue.Queue()

    def push(link):
        links.put(link)
        raise RuntimeError("no robot")

    with Stream(serve(arm.stream, on_push=push), link="panda_link4") as stream:
        assert stream.next(HEARTBEAT)["pushes"]
        stream.next(FRAME)
        for text in ("pull", *10 * ["push"]):
            stream.send(text)
        assert links.get(timeout=HANG) == "panda_link4"
        stream.frames(3)
        assert links.qsize() < 9


def test_a_slow_reader_gets_the_present_and_delays_nobody(serve):
    """Other readers receive their frames. The slow one finds few old frames."""
    links = [link(f"l{k}", 1.0, (0, 0, 0.1), (0.01, 0, 0, 0.01, 0, 0.01)) for k in range(61)]
    joints = [
        joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", (k % 2, 1 - k % 2, 0)) for k in range(60)
    ]
    address = serve(Robot(description("chain", *links, *joints)).serve())
    with Stream(address, hz=60, room=4096) as slow:
        first = slow.next(FRAME).t
        with Stream(address, hz=60) as quick:
            present = quick.frames(150)[-1].t
        old = sum(
            1
            for _ in itertools.takewhile(
                lambda frame: frame.t < present, iter(lambda: slow.next(FRAME), None)
            )
        )
        assert old < 75 < present - first


def test_whoever_never_reads_loses_the_stream(serve, arm, monkeypatch):
    monkeypatch.setattr("diag_dynamics.page.server.READ_TIMEOUT", 0.5)
    address = serve(arm.stream)
    with Stream(address, hz=60, room=4096) as idle, Stream(address, hz=60) as reader:
        assert "101 Switching Protocols" in idle.head
        reader.next(HEARTBEAT, lambda beat: beat["streams"] == 1)


@pytest.mark.full
def test_readers_leave_while_the_server_stops(arm, caplog):
    """A request that ended while aiohttp cancelled the waiting for it was an error."""
    for _ in range(10):
        page = PageServer(lambda: [arm.stream])
        page.start()
        with contextlib.ExitStack() as stack:
            leaving = []
            for k in range(6):
                stream = stack.enter_context(Stream(page.address))
                leaving.append(threading.Timer(0.096 + 0.0015 * k, stream.socket.close))
            for timer in leaving:
                timer.start()
            page.stop()
            for timer in leaving:
                timer.join()
    assert not caplog.records
