# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page's server over real connections: what it serves, to whom, and that nobody's slowness costs anything."""

import resource
import socket
import threading
import time

import numpy as np
import pytest

import diag_dynamics as dd
from diag_dynamics.demos.moving_robot import MovingRobot, show_of
from diag_dynamics.page.server import HEADERS, Limits, PageServer
from diag_dynamics.page.show import Show
from robots import robot_path
from streams import DIAGNOSTICS, FRAME, HEARTBEAT, LAYOUT, PATIENCE, Stream, get, get_json

PANDA = robot_path("panda_description/urdf/panda.urdf")


@pytest.fixture(scope="module")
def shows():
    """Two robots, of which the second one is not known yet."""
    return [show_of(PANDA, 200.0, "/arm"), Show("/other", lambda _: None)]


@pytest.fixture
def page(tmp_path):
    """A page that has been built."""
    (tmp_path / "index.html").write_text("<!doctype html><title>page</title>" + 1000 * "hello ")
    (tmp_path / "page.js").write_text("1;")
    (tmp_path / "page.css").write_text("body {}")
    (tmp_path / "licences.txt").write_text("MIT")
    return tmp_path


@pytest.fixture
def server(shows, page):
    faults = []
    server = PageServer(lambda: shows, static=page, log=faults.append)
    server.faults = faults
    server.start()
    yield server
    server.stop()


def eventually(condition, timeout=PATIENCE):
    end = time.monotonic() + timeout
    while not condition():
        assert time.monotonic() < end, "it never became so"
        time.sleep(0.02)


# --- What is served ---


def test_files(server):
    for path, kind in (("/", "text/html"), ("/page.js", "text/javascript"), ("/page.css", "text/css")):
        status, headers, body = get(server.address, path)
        assert (status, headers["Content-Type"].split(";")[0]) == (200, kind)
        assert len(body) == int(headers["Content-Length"]) > 0
        assert HEADERS.items() <= headers.items()
    policy = HEADERS["Content-Security-Policy"]
    assert "default-src 'none'" in policy
    assert "connect-src 'self'" in policy
    assert not {"http:", "https:", "*"} & set(policy.replace(";", " ").split())
    status, headers, body = get(server.address, "/", **{"Accept-Encoding": "gzip"})
    assert headers["Content-Encoding"] == "gzip"
    assert len(body) < 1000


@pytest.mark.parametrize(
    "path", ["/../server.py", "/..%2f..%2fserver.py", "/static/index.html", "//etc/passwd", "/mesh/.."]
)
def test_nothing_else_is_served(server, path):
    status, _, body = get(server.address, path)
    assert status == 404
    assert b"PageServer" not in body


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "HEAD"])
def test_get_only(server, method):
    status, headers, _ = get(server.address, "/robots", method)
    assert (status, headers["Allow"]) == (405, "GET")


def test_other_names_are_refused(server):
    """A page of elsewhere whose name is made to lead here reads nothing (DNS rebinding)."""
    assert get(server.address, "/robots", Host="evil.example")[0] == 403
    for name in ("localhost:1234", "127.0.0.1", "[::1]:80"):
        assert get(server.address, "/robots", Host=name)[0] == 200


def test_a_page_that_was_not_built(shows, tmp_path):
    server = PageServer(lambda: shows, static=tmp_path)
    server.start()
    status, headers, body = get(server.address, "/", Accept="text/html")
    server.stop()
    assert status == 503
    assert headers["Content-Type"].startswith("text/html")
    assert "index.html is missing" in body.decode()
    assert "make page" in body.decode()


def test_listens_on_loopback_and_says_where(shows):
    server = PageServer(lambda: shows)
    assert server.address.startswith("http://127.0.0.1:")
    with pytest.raises(dd.InputError, match=f"port {server.server_port}: Address already in use"):
        PageServer(lambda: shows, port=server.server_port)
    server.stop()
    with pytest.raises(dd.InputError, match=r"host '300\.1\.1\.1'"):
        PageServer(lambda: shows, host="300.1.1.1")
    with pytest.raises(dd.InputError, match="host '', which stands for all"):
        PageServer(lambda: shows, host="")
    with pytest.raises(dd.InputError, match="port 70000"):
        PageServer(lambda: shows, port=70000)


def test_robots_layout_and_meshes(server):
    arm, other = get_json(server.address, "/robots")
    assert (arm["name"], arm["robot"]) == ("/arm", "panda")
    assert (other["name"], other["robot"], other["alive"]) == ("/other", None, False)
    layout = get_json(server.address, "/layout?robot=/arm")
    assert layout["robot"] == "panda"
    shas = {shape["mesh"] for link in layout["scene"]["links"] for shape in link["visuals"]}
    for sha in shas:
        status, headers, body = get(server.address, f"/mesh/{sha}")
        assert status == 200
        assert headers["Content-Type"] == "application/octet-stream"
        vertices, triangles = np.frombuffer(body, "<u4", 2)
        assert len(body) == 8 + 12 * (int(vertices) + int(triangles))
    assert get(server.address, "/mesh/" + 64 * "0")[0] == 404
    assert get(server.address, "/layout?robot=/other")[0] == 503
    assert get(server.address, "/layout?robot=/nobody")[0] == 404
    assert get(server.address, "/layout")[0] == 404  # there are two


@pytest.mark.parametrize("query", ["hz=nan", "hz=0", "hz=fast", "link=nobody", "hz=-1"])
def test_streams_that_make_no_sense(server, query):
    status, _, body = get(server.address, f"/stream?robot=/arm&{query}")
    assert status == 400
    assert query.split("=")[0] in body.decode()


def test_stream(server):
    """The layout first, then frames whose numbers are those of the robot's evaluation, diagnostics and heartbeats."""
    model = dd.load_urdf(PANDA)
    dyn = dd.DiagonalDynamics(model)
    with Stream(server.address, robot="/arm", hz=50, link="panda_hand") as stream:
        assert "200 OK" in stream.head
        kind, layout = stream.packet()
        assert kind == LAYOUT
        assert layout["dofs"] == list(model.dof_names)
        assert layout["link"] == "panda_hand"
        assert layout["thresholds"]["external_torque"] == [12.0] * 8
        assert layout["thresholds"]["norm"] == 8.0
        for frame in stream.frames(20):
            q, qd, tau = (frame[name].astype(float) for name in ("q", "qd", "effort"))
            s = dyn.evaluate(q, qd, tau)
            for name, value in (("nu", s.nu), ("coriolis", s.coriolis), ("D", s.articulated_inertia)):
                np.testing.assert_allclose(frame[name], value, rtol=1e-4, atol=1e-4)
            np.testing.assert_allclose(frame["K"], s.kinetic_energy, rtol=1e-4)
            np.testing.assert_allclose(frame["link_energy"].sum(), s.kinetic_energy, rtol=1e-4)
            twist = dyn.link_velocity(q, qd, "panda_hand", frame="world")
            np.testing.assert_allclose(frame["twist"], twist, atol=1e-4)
            assert frame["latency"] < 1.0
        beat = stream.next(HEARTBEAT)
        assert beat["alive"]
        assert beat["link"] == "panda_hand"
        (told,) = Stream(server.address, robot="/arm").__enter__().next(DIAGNOSTICS)
        assert told["values"] == {"joint states": "200/s"}


def test_a_robot_that_is_not_there_yet(server, shows):
    """Heartbeats come all the same, and say what is waited for."""
    shows[1].wait_for("waiting for robot_description of /other")
    with Stream(server.address, robot="/other") as stream:
        kind, beat = stream.packet()
        assert kind == HEARTBEAT
        assert beat["waiting"] == "waiting for robot_description of /other"
        assert not beat["alive"]
    told = [(0, "model", "fits"), (1, "joint states", "rejected: no joint 'elbow'"), (0, "rates", "well")]
    statuses = [{"level": level, "name": f"arm/diag_dynamics: {name}", "message": m} for level, name, m in told]
    shows[1].wait_for("")
    assert shows[1].about()["waiting"] == "waiting for the first state"
    shows[1].tell(statuses)  # that no state has come is no reason: what the robot's nodes say is
    assert shows[1].about()["waiting"] == "joint states: rejected: no joint 'elbow'"


# --- Rates, and many readers ---


def test_clients_at_other_rates_get_their_own(server):
    """Two tabs, 10 Hz and 50 Hz of 200 states a second: by its frames' stamps each has what it asks for, and never more."""
    with Stream(server.address, robot="/arm", hz=50) as fast, Stream(server.address, robot="/arm", hz=10) as slow:
        found = {}
        asked = {50: fast, 10: slow}
        readers = [threading.Thread(target=lambda hz=hz: found.update({hz: read(asked[hz], hz)})) for hz in asked]
        for reader in readers:
            reader.start()
        for reader in readers:
            reader.join()
    assert found.keys() == asked.keys()  # nobody has waited in vain
    for hz, stamps in found.items():
        assert (len(stamps) - 2) / hz <= stamps[-1] - stamps[0] + 2 / 200


def read(stream, hz, window=10):
    """Read frames until some in a row come at more than half the rate, the last of them soon; a busy machine may be late."""
    stamps = [stream.next(FRAME).t]
    while len(stamps) < 3 * window or stamps[-1] - stamps[-window] > 2 * window / hz or time.time() - stamps[-1] > 0.5:
        stamps.append(stream.next(FRAME).t)
        assert len(stamps) < 100 * window, "never at its rate"
    return stamps


def test_a_slow_reader_gets_the_newest_frame(server):
    """Who reads again after two seconds finds a few frames that were on their way, and then the present."""
    with Stream(server.address, robot="/arm", hz=50, room=4096) as stream:
        stream.frames(3)
        time.sleep(3.0)
        lags = []
        while not lags or lags[-1] > 0.5:
            lags.append(time.time() - stream.next(FRAME).t)
            assert len(lags) < 100, "old frames do not end"
        beat = stream.next(HEARTBEAT, lambda told: told["skipped"] > 300)
        assert beat["served"] < 200


def test_nobody_waits_for_a_reader_who_never_reads(server, monkeypatch):
    """Seven who read nothing: memory stays as it is, robots and requests go on, and one of them may go.

    The server has patience with them for so long that who waited for them would wait in vain.
    """
    monkeypatch.setattr("diag_dynamics.page.server.PATIENCE", 10.0 * PATIENCE)
    idle = [Stream(server.address, robot="/arm", hz=60, room=4096) for _ in range(7)]
    try:
        eventually(lambda: server.streams == 7)
        with Stream(server.address, robot="/arm", hz=50) as stream:
            stream.frames(10)
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
            stream.frames(60)
            get_json(server.address, "/robots")
            assert server.streams == 8
            grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
            assert grown < 4096, f"grown by {grown} kB"
            status, _, body = get(server.address, "/stream?robot=/arm")  # the ninth
            assert status == 503
            assert "All 8 streams are taken" in body.decode()
        idle.pop().socket.close()
        eventually(lambda: server.streams == 6)
    finally:
        for stream in idle:
            stream.socket.close()
    eventually(lambda: server.streams == 0)


def test_who_never_reads_is_let_go(server, monkeypatch):
    monkeypatch.setattr("diag_dynamics.page.server.PATIENCE", 0.5)
    with Stream(server.address, robot="/arm", hz=60, room=4096) as stream:
        assert "200 OK" in stream.head  # by then it is one of them
        eventually(lambda: server.streams == 0)


def test_many_tabs_share_what_they_may_cost(shows, page):
    server = PageServer(lambda: shows, limits=Limits(rate=50.0, streams=4, frames=60.0), static=page)
    assert server.period(1000.0) == 1.0 / 50.0
    server.streams = 4
    assert server.period(50.0) == pytest.approx(4.0 / 60.0)
    assert server.period(5.0) == pytest.approx(1.0 / 5.0)
    server.stop()


def test_connections_that_ask_for_nothing_are_few(server):
    """Who only connects is let go after a time, and cannot take all threads there are."""
    host, port = server.server_address[:2]
    idle = [socket.create_connection((host, port)) for _ in range(60)]
    try:
        eventually(lambda: threading.active_count() > 30)
        assert threading.active_count() < 60
        idle[-1].settimeout(PATIENCE)
        assert idle[-1].recv(1) == b""
    finally:
        for one in idle:
            one.close()


def test_frames_are_made_once_for_all(shows):
    """Any number of readers of one state take one evaluation, and each link that somebody has chosen one more."""
    show = shows[0]
    first = show.newest()
    assert first.number > 0
    counted = []
    still = Show("/still", counting(MovingRobot(dd.load_urdf(PANDA), 1000.0), counted))
    still.use(dd.DiagonalDynamics(dd.load_urdf(PANDA)), None, None)
    frames = {still.newest(link).frame for link in ("", "", "panda_hand", "panda_hand", "panda_link3")}
    assert len(frames) == 3
    assert len(counted) == 1
    assert len({frame[:400] for frame in frames}) == 1


def test_a_link_is_refused_before_there_is_a_state():
    """A page is told whose ellipsoid its frames have with the layout, which comes before the first of them."""
    show = Show("/", lambda _: None)
    assert show.newest("panda_hand").frame == b""  # nobody knows yet
    show.use(dd.DiagonalDynamics(dd.load_urdf(PANDA)), None, None)
    assert show.newest("panda_hand").number == 0
    with pytest.raises(dd.InputError, match="'tool0' is not a link"):
        show.newest("tool0")


def counting(robot, counted):
    """The robot's first state, and no other."""

    def take(dynamics):
        if counted:
            return None
        counted.append(robot.take(dynamics))
        return counted[0]

    return take


def test_streams_end_with_the_server(shows, page):
    """A restart: the stream ends at once, and the same port serves again."""
    server = PageServer(lambda: shows, static=page)
    server.start()
    port = server.server_port
    with Stream(server.address, robot="/arm") as stream:
        stream.frames(2)
        server.stop()
        with pytest.raises((EOFError, ConnectionError)):
            stream.next(HEARTBEAT, lambda _: False)
    again = PageServer(lambda: shows, port=port, static=page)
    again.start()
    with Stream(again.address, robot="/arm") as stream:
        assert stream.next(FRAME)["K"] >= 0.0
    again.stop()


def test_another_robot_comes_with_a_layout_of_its_own(page):
    """The stream goes on when the robot changes; a link that it lacks is no longer chosen."""
    moving = [MovingRobot(dd.load_urdf(PANDA))]

    def take(dynamics):
        """What is of another robot than the one in force is not for it."""
        return moving[0].take(dynamics) if dynamics.model.dof_names == moving[0].model.dof_names else None

    show = Show("/", take)
    show.use(dd.DiagonalDynamics(moving[0].model), None, None)
    server = PageServer(lambda: [show], static=page)
    server.start()
    with Stream(server.address, link="panda_hand") as stream:
        stream.frames(2)
        model = dd.load_urdf(robot_path("ur_description/urdf/ur5_robot.urdf"))
        moving[0] = MovingRobot(model)
        show.use(dd.DiagonalDynamics(model), None, None)
        layout = stream.next(LAYOUT)
        assert (layout["dofs"], layout["link"]) == (list(model.dof_names), "")
        assert np.isnan(stream.next(FRAME)["twist"]).all()
        assert stream.next(HEARTBEAT, lambda beat: beat["robot"] == "ur5")["link"] == ""
    server.stop()


def test_requests_that_are_none(server):
    """Whatever comes: an answer that says no, or the end of the connection; the next one is served."""
    rng = np.random.default_rng(5)
    host, port = server.server_address[:2]
    nonsense = [rng.integers(0, 256, 400, dtype=np.uint8).tobytes() for _ in range(20)]
    nonsense += [
        b"GET\r\n\r\n",
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET /%ff%00 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET /stream?robot=%2Farm&hz=1e999 HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET http://[ HTTP/1.1\r\nHost: localhost\r\n\r\n",
        b"GET / HTTP/1.1\r\nHost: [\r\n\r\n",
        b"GET /" + 100_000 * b"a" + b" HTTP/1.1\r\n\r\n",
        b"GET / HTTP/1.1\r\n" + 300 * b"X: y\r\n" + b"\r\n",
        b"GET /robots HTTP/1.1\r\nContent-Length: 99999999\r\nHost: localhost\r\n\r\n",
    ]
    for data in nonsense:
        with socket.create_connection((host, port), timeout=PATIENCE) as one:
            try:
                one.sendall(data)
                one.shutdown(socket.SHUT_WR)
                answer = one.recv(4096)
            except OSError:  # it was hung up on
                continue
            assert b"200 OK" not in answer or b"/robots" in data, (data[:60], answer[:60])
    assert get(server.address, "/robots")[0] == 200
    assert server.faults == []
