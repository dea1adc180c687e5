# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page's server: files, meshes and one websocket per tab, which can push a simulated robot."""

import asyncio
import ipaddress
import json
import logging
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path

from aiohttp import web

from diag_dynamics.exceptions import InputError
from diag_dynamics.text import plain

logger = logging.getLogger(__name__)

STATIC = Path(__file__).parent / "static"

FILES = {
    "": ("index.html", "text/html"),
    "page.js": ("page.js", "text/javascript"),
    "page.css": ("page.css", "text/css"),
    "licences.txt": ("licences.txt", "text/plain"),
}
"""The page's files by path: name in the folder and type."""

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; "
    "style-src 'self' 'unsafe-inline'; connect-src 'self'; img-src 'self' data: blob:; "
    "font-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-cache",
}

SEND_BUFFER = 16 * 1024
"""Bytes that the kernel holds for a reader; above them the next frame waits."""

READ_TIMEOUT = 20.0
"""Time after which a reader whose socket stays full is disconnected [s]."""

MAX_CONNECTIONS = 64
"""Connections, above which the next one is refused."""

ACCEPT_RETRY_PERIOD, ACCEPT_REPORT_PERIOD = 1.0, 60.0
"""Time until the next attempt to accept connections after an error, and between two reports [s]."""

KEEPALIVE_TIMEOUT = 15.0
"""Time after which a connection without requests is closed [s]."""

END_TIMEOUT = 2.0
"""Time for open requests to end with the server [s]."""

HEARTBEAT = 1.0
"""Time between two heartbeats [s]."""

MAX_FRAMES = 200.0
"""Frames per second of all streams together."""


PUSH_PERIOD = 0.1
"""Shortest time between two pushes of a tab [s]."""


class PageServer:
    """Serve robots in a thread of its own.

    Parameters
    ----------
    robots : callable
        Returns the :class:`~diag_dynamics.page.stream.RobotStream` of each robot, in the order of
        the list.
    host, port : str, int
        Address to listen on; port 0 is any free one.
    rate : float
        Maximum frames per second of a stream.
    on_push : callable, optional
        Called with the link that a tab shows when its button pushes a simulated robot. Without it,
        pages have no button.

    Attributes
    ----------
    address : str
        URL of the page.
    streams : int
        Number of open streams.

    Raises
    ------
    InputError
        The address cannot be listened on.
    """

    def __init__(self, robots, host="127.0.0.1", port=0, rate=60.0, on_push=None):
        self._robots = robots
        self.streams = 0
        self._host = host
        self._rate = rate
        self._started = threading.Event()
        self._on_push = on_push
        self._files = {
            path: ((STATIC / name).read_bytes(), kind) for path, (name, kind) in FILES.items()
        }
        self._socket = listen(host, port)
        address, port = self._socket.getsockname()[:2]
        name = f"[{address}]" if ":" in address else address
        if ipaddress.ip_address(address.partition("%")[0]).is_unspecified:
            name = "localhost"
        self.address = f"http://{name}:{port}/"
        self._thread = threading.Thread(
            target=lambda: asyncio.run(self._serve()), name="page", daemon=True
        )

    def start(self):
        """Start to serve."""
        self._thread.start()
        self._started.wait()

    def stop(self):
        """End all streams and the thread."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
            self._thread.join()
        self._socket.close()

    async def _serve(self):
        app = web.Application(middlewares=[self._guard])
        routes = {
            "/robots": self._get_robots,
            "/mesh/{sha}": self._get_mesh,
        }
        routes |= {"/stream": self._get_stream, "/{file:[a-z.]*}": self._get_file}
        app.add_routes(
            [web.get(path, handler, allow_head=False) for path, handler in routes.items()]
        )
        runner = web.AppRunner(
            app, access_log=None, shutdown_timeout=0.1, keepalive_timeout=KEEPALIVE_TIMEOUT
        )
        await runner.setup()
        self._loop = asyncio.get_running_loop()
        self._end = asyncio.Event()
        accepting = asyncio.ensure_future(self._accept_connections(runner.server))
        self._started.set()
        await self._end.wait()
        self._socket.shutdown(socket.SHUT_RDWR)
        await accepting
        # Requests end first: one that ends while aiohttp cancels the waiting for it is an error.
        deadline = time.monotonic() + END_TIMEOUT
        while runner.server.connections and time.monotonic() < deadline:
            for connection in runner.server.connections:
                if connection.transport:
                    connection.transport.abort()
            await asyncio.sleep(0.01)
        await runner.cleanup()

    async def _accept_connections(self, server):
        """Accept connections: servers of asyncio have no maximum and log every error."""
        next_report = time.monotonic()
        while not self._end.is_set():
            try:
                connection, _ = await self._loop.sock_accept(self._socket)
                if len(server.connections) >= MAX_CONNECTIONS:
                    connection.close()
                else:
                    await self._loop.connect_accepted_socket(server, connection)
            except OSError as error:  # as without free file descriptors
                if self._end.is_set():
                    return
                if time.monotonic() >= next_report:
                    next_report = time.monotonic() + ACCEPT_REPORT_PERIOD
                    logger.warning(
                        "The page accepts no connections: %s. Close other programs.", error
                    )
                with suppress(asyncio.TimeoutError):
                    await asyncio.wait_for(self._end.wait(), ACCEPT_RETRY_PERIOD)

    @web.middleware
    async def _guard(self, request, handler):
        """Reject requests by a foreign name or of a foreign page; add headers to responses."""
        try:
            if not is_own(request, self._host):
                text = f"Host is '{plain(request.host)}'; expected this server's address."
                raise web.HTTPForbidden(text=text)
            response = await handler(request)
        except web.HTTPException as error:
            error.headers.update(HEADERS)
            raise
        if not response.prepared:
            response.headers.update(HEADERS | dict(response.headers))
        return response

    def _robot(self, request):
        robots = {robot.name: robot for robot in self._robots()}
        name = request.query.get("robot", next(iter(robots)) if len(robots) == 1 else "")
        if name not in robots:
            shown = ", ".join(name for name in robots if name.startswith("/"))
            expected = f"expected one of {shown}" if shown else "no robot is shown. Start a monitor"
            raise InputError(f"robot is '{plain(name)}'; {expected}.")
        return robots[name]

    async def _get_file(self, request):
        name = request.match_info["file"]
        if name not in self._files:
            raise web.HTTPNotFound
        body, kind = self._files[name]
        return web.Response(body=body, content_type=kind, charset="utf-8")

    async def _get_robots(self, _):
        return web.json_response([robot.about() for robot in self._robots()])

    async def _get_mesh(self, request):
        for robot in self._robots():
            if (data := robot.mesh(request.match_info["sha"])) is not None:
                return web.Response(
                    body=data, headers={"Cache-Control": "max-age=31536000, immutable"}
                )
        raise web.HTTPNotFound

    async def _get_stream(self, request):
        ws = web.WebSocketResponse(compress=False)  # frames of floats hardly shrink
        await ws.prepare(request)
        if request.transport is None:  # the reader has left
            return ws
        try:
            robot = self._robot(request)
            hz = float(request.query.get("hz", self._rate))
        except ValueError as error:  # InputError is one
            await ws.close(code=4404, message=str(error).encode()[:120])
            return ws
        self.streams += 1
        try:
            with suppress(OSError):  # the reader has left
                await self._send(ws, request, robot, min(self._rate, max(1.0, hz)))
        except Exception as error:
            logger.exception("The stream of robot %s ended.", plain(robot.name))
            await ws.close(code=4500, message=plain(f"internal error: {error!r}").encode()[:120])
        finally:
            self.streams -= 1
        return ws

    async def _receive(self, ws, shown):
        """Receive until the reader leaves; the text "push" pushes the link that it shows."""
        pushed = -PUSH_PERIOD
        async for message in ws:
            now = time.monotonic()
            if message.data == "push" and self._on_push and now > pushed + PUSH_PERIOD:
                pushed = now
                try:
                    self._on_push(*shown)
                except Exception:
                    logger.exception("The robot could not be pushed.")

    async def _send(self, ws, request, robot, hz):
        """Send frames and texts until the reader leaves. A slow one gets the newest frame alone."""
        transport = request.transport
        shown = [""]
        end = asyncio.ensure_future(self._receive(ws, shown))
        connection = transport.get_extra_info("socket")
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
        layout = diagnostics = number = 0
        due = beat = ready = time.monotonic()
        while True:
            await asyncio.wait({end}, timeout=due - time.monotonic())
            if end.done() or transport.is_closing():
                return
            now = time.monotonic()
            period = max(1.0 / hz, self.streams / MAX_FRAMES)
            due = max(due + period, now)
            if transport.get_write_buffer_size():
                if now - ready > READ_TIMEOUT:
                    return transport.abort()
                continue
            ready = now
            new = robot.newest(request.query.get("link", ""))
            texts = {}
            shown[0] = new.link
            if new.layout[0] != layout:
                layout, texts["layout"] = new.layout
            if new.diagnostics[0] != diagnostics:
                diagnostics, texts["diagnostics"] = new.diagnostics
            if texts or now >= beat:
                if robot not in self._robots():
                    return await ws.close(code=4404, message=b"The monitor has gone.")
                beat = now + HEARTBEAT
                about = {"link": new.link, "hz": 1.0 / period, "streams": self.streams}
                about["pushes"] = self._on_push is not None
                texts["heartbeat"] = json.dumps(robot.about() | about)
                await ws.send_str(
                    "{" + ", ".join(f'"{name}": {text}' for name, text in texts.items()) + "}"
                )
            if new.frame and new.number != number:
                await ws.send_bytes(new.frame)
                number = new.number


def listen(host, port):
    """Return a socket that listens on an address."""
    try:
        if not host:
            raise OSError("expected an address, 0.0.0.0 for all")
        family = socket.AF_INET6 if ":" in host else socket.AF_INET
        server = socket.create_server((host, port), family=family)
    except (OSError, OverflowError, UnicodeError) as error:
        reason = str(error).rstrip(".")
        address = f"host '{plain(host)}', port {port}"
        text = f"The page cannot be served on {address}: {reason}. Port 0 is any free one."
        raise InputError(text) from error
    server.setblocking(False)
    return server


def is_own(request, host):
    """Return whether a request has this server's name and no foreign origin (DNS rebinding)."""
    try:
        name = (request.url.host or "").lower()
        origin = request.headers.get("Origin")
    except ValueError:  # a port above 65535
        return False
    if origin is not None and origin.partition("://")[2] != request.host:
        return False  # browsers let every page open a websocket
    local = socket.gethostname().lower()
    if name in ("localhost", local, f"{local}.local", host.lower()) or name.endswith(".localhost"):
        return True
    try:
        return bool(ipaddress.ip_address(name.partition("%")[0]))
    except ValueError:
        return False
