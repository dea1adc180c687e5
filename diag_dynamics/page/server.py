# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""The page's server: the page, what it draws, and one endless stream of frames for each tab. It reads, and changes nothing.

By Python's own HTTP server, a thread for each connection. Whoever reads slowly makes nobody wait: a frame is made of the
newest state when there is room for it on the way to the reader, so that no frame ever stands in a queue here.
"""

from __future__ import annotations

import gzip
import ipaddress
import json
import select
import socket
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterable
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import SplitResult, parse_qs, unquote, urlsplit

from diag_dynamics.exceptions import InputError
from diag_dynamics.page.show import Show
from diag_dynamics.text import plain

STATIC = Path(__file__).parent / "static"
"""Where the page lies: it is built from web/ by ``make page``."""

FILES = {
    "/": ("index.html", "text/html; charset=utf-8"),
    "/index.html": ("index.html", "text/html; charset=utf-8"),
    "/page.js": ("page.js", "text/javascript; charset=utf-8"),
    "/page.css": ("page.css", "text/css; charset=utf-8"),
    "/licences.txt": ("licences.txt", "text/plain; charset=utf-8"),
}
"""All files that are served, by path: there is no other, whatever is asked for."""

LAYOUT, FRAME, DIAGNOSTICS, HEARTBEAT, CONTACT = range(5)
"""Kinds of packets in a stream."""

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "connect-src 'self'; font-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""What a page may load, and whom it may ask: this server."""

HEADERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}

ROOM = 64 * 1024
"""What the kernel may hold for a reader who does not read [bytes]."""

UNSENT = 4 * 1024
"""What of it may not have been sent yet before the next frame waits [bytes]."""

PATIENCE = 20.0
"""How long a reader may read nothing before it is let go [s]; the page comes back by itself."""

BEAT = 1.0
"""Time between two heartbeats of a stream [s]."""

REQUEST, PART = 10.0, 64 * 1024
"""How long a request may take to arrive, and a part of an answer to be taken [s]; and how large one is [bytes]."""

OTHERS = 32
"""Connections beside the streams."""


class Limits(NamedTuple):
    """What pages may cost."""

    rate: float = 60.0
    """Most frames per second of a stream."""
    streams: int = 8
    """Most streams at a time."""
    frames: float = 200.0
    """Most frames per second of all streams together: where there are more of them, each gets less."""


class RefusedError(Exception):
    """An answer that is none: its status, and why."""

    def __init__(self, status: HTTPStatus, why: str) -> None:
        super().__init__(why)
        self.status = status


class PageServer(ThreadingHTTPServer):
    """Serves some robots.

    Parameters
    ----------
    shows : callable
        Returns the robots there are, in the order in which they are listed.
    host : str
        Address to listen on; nobody else's machine reaches a loopback one.
    port : int
        0: any free one.
    limits : Limits
    log : callable
        Takes a line on what went wrong here.
    static : Path
        Folder of the page.

    Attributes
    ----------
    address : str
        What to type into a browser.

    Raises
    ------
    InputError
        That address cannot be listened on.
    """

    daemon_threads = True
    request_queue_size = 64

    def __init__(
        self,
        shows: Callable[[], Iterable[Show]],
        host: str = "127.0.0.1",
        port: int = 0,
        limits: Limits = Limits(),  # noqa: B008 (immutable)
        log: Callable[[str], None] = lambda _: None,
        static: Path = STATIC,
    ) -> None:
        self.shows, self.limits, self.static, self._log = shows, limits, static, log
        self.closing = threading.Event()
        self._lock, self._open, self.streams = threading.Lock(), 0, 0
        self._thread: threading.Thread | None = None
        self._host = host
        self._compressed: dict[Path, tuple[int, bytes]] = {}
        if not host:
            raise InputError(
                "The page cannot be served on host '', which stands for all: say 0.0.0.0 if that is meant."
            )
        if not 0 <= port <= 65535:
            raise InputError(f"The page cannot be served on port {port}, expected a whole number from 0 to 65535.")
        try:
            found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
            self.address_family, _, _, _, place = found[0]
            super().__init__(place[:2], _Handler)  # type: ignore[arg-type]
        except (OSError, UnicodeError) as error:
            why = getattr(error, "strerror", None) or error
            raise InputError(
                f"The page cannot be served on host '{plain(host)}', port {port}: {why}. Port 0 takes a free one."
            ) from error

    def server_bind(self) -> None:
        """Bind, and look no name up: that may take seconds."""
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = self._host, self.server_address[1]

    @property
    def address(self) -> str:
        """See above."""
        host = str(self.server_address[0])
        if ipaddress.ip_address(host.partition("%")[0]).is_unspecified:
            host = "localhost"
        return f"http://{f'[{host}]' if ':' in host else host}:{self.server_port}/"

    def start(self) -> None:
        """Serve, in a thread of its own."""
        self._thread = threading.Thread(
            target=self.serve_forever, name="page", kwargs={"poll_interval": 0.2}, daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End all streams, and serve nobody any more."""
        self.closing.set()
        if self._thread is not None:
            self.shutdown()
            self._thread.join()
            self._thread = None
        self.server_close()

    def file(self, path: str, compressed: bool) -> tuple[bytes, str, bool]:
        """A file of the page: its bytes, their type, and whether they are compressed.

        Raises
        ------
        RefusedError
            There is none at this path, or the page has not been built.
        """
        if path not in FILES:
            raise RefusedError(HTTPStatus.NOT_FOUND, f"There is nothing at '{path}'.")
        name, kind = FILES[path]
        file = self.static / name
        try:
            changed, data = file.stat().st_mtime_ns, file.read_bytes()
        except OSError as error:
            raise RefusedError(
                HTTPStatus.SERVICE_UNAVAILABLE,
                f"The page is not there: {name} is missing from {self.static}. In a checkout, `make page` builds it.",
            ) from error
        if not compressed:
            return data, kind, False
        known = self._compressed.get(file)
        if known is None or known[0] != changed:
            known = self._compressed[file] = changed, gzip.compress(data, 6)
        return known[1], kind, True

    def period(self, hz: float) -> float:
        """Time between two frames of a stream that asks for so many a second, as many as there are now [s]."""
        return max(1.0 / min(hz, self.limits.rate), self.streams / self.limits.frames)

    def process_request(self, request: Any, client_address: Any) -> None:
        """Serve a connection in a thread of its own, or refuse it at once where there are too many."""
        with self._lock:
            refused = self._open >= self.limits.streams + OTHERS
            self._open += not refused
        if refused:
            self.shutdown_request(request)
        else:
            super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Serve a connection."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self._lock:
                self._open -= 1

    def enter(self) -> bool:
        """Count a stream that begins; whether there is room for it."""
        with self._lock:
            if self.streams >= self.limits.streams:
                return False
            self.streams += 1
            return True

    def leave(self) -> None:
        """Count a stream that has ended."""
        with self._lock:
            self.streams -= 1

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Say a line on what went wrong: neither a reader who has gone nor a mistake here ends anything."""
        error = sys.exc_info()[1]
        if not isinstance(error, (ConnectionError, TimeoutError)):
            self._log(plain(f"page: {type(error).__name__}: {error}"))


class _Handler(BaseHTTPRequestHandler):
    """One request."""

    server: PageServer  # type: ignore[assignment]
    server_version, sys_version = "diag_dynamics", ""
    timeout = REQUEST

    def log_message(self, format: str, *args: Any) -> None:
        """Say nothing of requests: a page asks for many."""

    def do_GET(self) -> None:
        """Answer."""
        try:
            self._require_own_name()
            url = _split(self.path)
            asked = {name: values[-1] for name, values in parse_qs(url.query).items()}
            path = unquote(url.path)
            if path == "/robots":
                self._send_json([show.about() for show in self.server.shows()])
            elif path == "/layout":
                self._send(self._require_layout(self._show(asked)), "application/json")
            elif path.startswith("/mesh/"):
                self._send_mesh(path.removeprefix("/mesh/"))
            elif path == "/stream":
                self._stream(asked)
            else:
                self._send_file(path)
        except RefusedError as refusal:
            self._refuse(refusal.status, str(refusal))
        except InputError as error:
            self._refuse(HTTPStatus.BAD_REQUEST, str(error))

    def _refuse_method(self) -> None:
        self._refuse(HTTPStatus.METHOD_NOT_ALLOWED, f"{plain(self.command)}: only GET is served here.", Allow="GET")

    do_HEAD = do_POST = do_PUT = do_DELETE = do_PATCH = do_OPTIONS = do_TRACE = do_CONNECT = _refuse_method

    # --- Who asks for what ---

    def _require_own_name(self) -> None:
        """Refuse a request to another host's name: a page of elsewhere could have that name lead here, and read."""
        name = _split(f"//{self.headers.get('Host', '')}").hostname or ""
        own = {"localhost", socket.gethostname().lower(), self.server.server_name.lower()}
        if name in own or name.endswith((".localhost", ".local")):
            return
        try:
            ipaddress.ip_address(name.partition("%")[0])
        except ValueError as error:
            why = f"This server is not called '{plain(name)}': ask for it by its address, or start it with that host."
            raise RefusedError(HTTPStatus.FORBIDDEN, why) from error

    def _show(self, asked: dict[str, str]) -> Show:
        """The robot that is asked for; the only one, where none is named."""
        shows = {show.name: show for show in self.server.shows()}
        name = asked.get("robot")
        if name is None and len(shows) == 1:
            return next(iter(shows.values()))
        if name not in shows:
            there = ", ".join(shows) or "none"
            raise RefusedError(HTTPStatus.NOT_FOUND, f"There is no robot '{plain(name or '')}'; there are: {there}.")
        return shows[name]

    def _require_layout(self, show: Show) -> bytes:
        layout = show.layout()
        if not layout:
            raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, f"Nothing is known of '{show.name}' yet.")
        return layout

    # --- Answers ---

    def _begin(self, status: HTTPStatus, kind: str, **more: str) -> None:
        self.send_response(status)
        headers = {"Content-Type": kind, "Cache-Control": "no-store", **HEADERS}
        for name, value in (headers | {name.replace("_", "-"): value for name, value in more.items()}).items():
            self.send_header(name, value)
        self.end_headers()

    def _send(self, data: bytes, kind: str, status: HTTPStatus = HTTPStatus.OK, **more: str) -> None:
        self._begin(status, kind, Content_Length=str(len(data)), **more)
        for begin in range(0, len(data), PART):  # each has its own time: the way may be slow
            self.wfile.write(data[begin : begin + PART])

    def _send_json(self, value: Any) -> None:
        self._send(json.dumps(value, allow_nan=False).encode(), "application/json")

    def _refuse(self, status: HTTPStatus, why: str, **more: str) -> None:
        """Say why not; a browser that asks for the page gets one that says so."""
        if "text/html" in self.headers.get("Accept", ""):
            text = why.replace("&", "&amp;").replace("<", "&lt;")
            page = f'<!doctype html><meta charset="utf-8"><title>diag_dynamics</title><h1>{status.phrase}</h1><p>{text}</p>'
            self._send(page.encode(), "text/html; charset=utf-8", status, **more)
        else:
            self._send(json.dumps({"error": why}).encode(), "application/json", status, **more)

    def _send_file(self, path: str) -> None:
        compressed = "gzip" in self.headers.get("Accept-Encoding", "")
        data, kind, is_compressed = self.server.file(path, compressed)
        more = {"Content_Encoding": "gzip"} if is_compressed else {}
        self._send(data, kind, Vary="Accept-Encoding", **more)

    def _send_mesh(self, sha: str) -> None:
        for show in self.server.shows():
            data = show.mesh(sha)
            if data is not None:
                self._send(data, "application/octet-stream", Cache_Control="max-age=31536000, immutable")
                return
        raise RefusedError(HTTPStatus.NOT_FOUND, "There is no such mesh.")

    # --- The stream ---

    def _stream(self, asked: dict[str, str]) -> None:
        show, link = self._show(asked), asked.get("link", "")
        try:
            hz = float(asked.get("hz", self.server.limits.rate))
        except ValueError:
            hz = 0.0
        if not 0.1 <= hz < float("inf"):
            raise RefusedError(HTTPStatus.BAD_REQUEST, f"hz is {plain(asked['hz'])!r}, expected a number >= 0.1.")
        show.newest(link)  # refuses a link that there is none of
        if not self.server.enter():
            why = f"All {self.server.limits.streams} streams are taken: close a tab."
            raise RefusedError(HTTPStatus.SERVICE_UNAVAILABLE, why)
        try:
            self._begin(HTTPStatus.OK, "application/octet-stream", X_Accel_Buffering="no")
            self._bound_room()
            _Stream(self.server, self.connection, show, hz, link).run()
        finally:
            self.server.leave()
            self.close_connection = True

    def _bound_room(self) -> None:
        """Have the kernel hold little of what is not read."""
        self.connection.settimeout(PATIENCE)
        self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, ROOM)
        self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        if hasattr(socket, "TCP_NOTSENT_LOWAT"):
            self.connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NOTSENT_LOWAT, UNSENT)


def _split(url: str) -> SplitResult:
    """Parts of an address, which anybody may have made up."""
    try:
        return urlsplit(url)
    except ValueError as error:
        raise RefusedError(HTTPStatus.BAD_REQUEST, f"'{plain(url)}' is no address.") from error


class _Stream:
    """What one tab gets, until it goes or reads no more."""

    def __init__(self, server: PageServer, connection: socket.socket, show: Show, hz: float, link: str) -> None:
        self._server, self._connection, self._show, self._hz, self._link = server, connection, show, hz, link
        self._layout = self._number = self._told = self._touch = 0
        self._served = self._skipped = 0
        self._due = self._beat = self._began = time.monotonic()

    def run(self) -> None:
        """Send, as often as is asked for, what is new then; and a heartbeat each second, in any case."""
        while not self._server.closing.is_set():
            if not self._is_writable():
                return
            packets = [*self._frame(), *self._contact(), *self._beats()]
            if packets:
                self._connection.sendall(b"".join(packets))
            self._wait(bool(packets))

    def _is_writable(self) -> bool:
        """Whether there is room on the way to the reader, before long."""
        return bool(select.select([], [self._connection], [], PATIENCE)[1])

    def _wait(self, sent: bool) -> None:
        """Wait for the next frame's time; where that is over, and no state has come, for a part of it."""
        now, period = time.monotonic(), self._server.period(self._hz)
        if sent:
            self._due = max(self._due + period, now)
        wait = max(self._due - now, 0.0 if sent else min(0.25 * period, 0.05))
        self._server.closing.wait(min(wait, BEAT))

    def _frame(self) -> list[bytes]:
        try:
            newest = self._show.newest(self._link)
        except InputError:  # another robot has come, which has no such link
            self._link = ""
            newest = self._show.newest()
        packets = []
        if newest.layout != self._layout:
            self._layout = newest.layout
            packets.append(packet(LAYOUT, _with_link(self._show.layout(), self._link)))
        if newest.number != self._number:
            if self._number and newest.number > self._number:
                self._skipped += newest.number - self._number - 1
            self._number = newest.number
            if newest.frame:
                self._served += 1
                packets.append(packet(FRAME, newest.frame))
        return packets

    def _contact(self) -> list[bytes]:
        number, told = self._show.touch()
        if number == self._touch:
            return []
        self._touch = number
        return [packet(CONTACT, told)] if told else []

    def _beats(self) -> list[bytes]:
        now = time.monotonic()
        if now < self._beat:
            return []
        self._beat = now + BEAT
        number, told = self._show.diagnostics()
        packets = [packet(DIAGNOSTICS, told)] if number != self._told else []
        self._told = number
        beat = {
            **self._show.about(),
            "link": self._link,
            "hz": 1.0 / self._server.period(self._hz),
            "served": self._served,
            "skipped": self._skipped,
            "seconds": now - self._began,
            "streams": self._server.streams,
        }
        return [*packets, packet(HEARTBEAT, json.dumps(beat, allow_nan=False).encode())]


def _with_link(layout: bytes, link: str) -> bytes:
    """A layout that says whose mobility and twist its frames have."""
    return layout[:-1] + b', "link": ' + json.dumps(link).encode() + b"}"


def packet(kind: int, payload: bytes) -> bytes:
    """A packet of a stream: u32 length of the payload, u8 kind, payload; little-endian."""
    return struct.pack("<IB", len(payload), kind) + payload
