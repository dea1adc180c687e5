# SPDX-FileCopyrightText: diag_dynamics maintainers
# SPDX-License-Identifier: Apache-2.0

"""A client of the page's server over a real connection."""

import contextlib
import http.client
import json
import socket
import struct
import time
from urllib.parse import urlencode, urlsplit

import numpy as np

from limits import HANG

LAYOUT, FRAME, DIAGNOSTICS, HEARTBEAT = "layout", "frame", "diagnostics", "heartbeat"


def get(address, path, method="GET", **headers):
    """Send one request; return status, headers and body."""
    url = urlsplit(address)
    connection = http.client.HTTPConnection(url.hostname, url.port, timeout=HANG)
    try:
        connection.request(method, path, headers=headers)
        answer = connection.getresponse()
        return answer.status, dict(answer.headers), answer.read()
    finally:
        connection.close()


def get_json(address, path):
    """Return the JSON of a successful response."""
    status, _, body = get(address, path)
    assert status == 200, body
    return json.loads(body)


def wait_for_robot(address, accept=lambda _: True, timeout=HANG):
    """Return the entry of the first accepted robot; wait until the server runs."""
    end = time.monotonic() + timeout
    robots = "nothing"
    while time.monotonic() < end:
        with contextlib.suppress(OSError):
            robots = get_json(address, "/robots")
            if result := next(filter(accept, robots), None):
                return result
        time.sleep(0.1)
    raise TimeoutError(f"no such robot within {timeout} s at {address}: {robots}")


class Stream:
    """A stream of the server, over a websocket."""

    def __init__(self, address, timeout=HANG, room=None, origin=None, **query):
        """Request the stream; `room` is the size of the receiving buffer [bytes]."""
        url = urlsplit(address)
        self.socket = socket.socket()
        if room:
            self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
        self.socket.settimeout(timeout)
        self.socket.connect((url.hostname, url.port))
        headers = [
            f"GET /stream?{urlencode(query)} HTTP/1.1",
            f"Host: {url.netloc}",
            "Sec-WebSocket-Version: 13",
        ]
        headers += [
            "Connection: Upgrade",
            "Upgrade: websocket",
            "Sec-WebSocket-Key: MDEyMzQ1Njc4OWFiY2RlZg==",
        ]
        headers += [f"Origin: {origin}"] if origin else []
        self.socket.sendall("\r\n".join([*headers, "", ""]).encode())
        self._buffer = b""
        self._news = []
        self.layout = None

    def __enter__(self):
        """Read the headers."""
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += self._exactly(1)
        self.head = head.decode()
        return self

    def __exit__(self, *_):
        """Close the connection."""
        self.socket.close()

    def send(self, text):
        """Send a short text to the server: one masked frame, with a mask of zeros."""
        self.socket.sendall(bytes([0x81, 0x80 | len(text)]) + bytes(4) + text.encode())

    def _exactly(self, count):
        while len(self._buffer) < count:
            some = self.socket.recv(65536)
            if not some:
                raise EOFError("the stream has ended")
            self._buffer += some
        some = self._buffer[:count]
        self._buffer = self._buffer[count:]
        return some

    def _message(self):
        """Return opcode and payload of a websocket's next message, which is one frame of the
        server.
        """
        first, length = self._exactly(2)
        if length > 125:
            length = int.from_bytes(self._exactly({126: 2, 127: 8}[length]), "big")
        return first & 15, self._exactly(length)

    def packet(self):
        """Return the name of what comes next and its content, JSON or a :class:`Frame`."""
        if self._news:
            return self._news.pop(0)
        opcode, payload = self._message()
        if opcode == 8:
            raise EOFError(int.from_bytes(payload[:2], "big"), payload[2:].decode())
        if opcode == 2:
            return FRAME, Frame(self.layout, payload)
        news = json.loads(payload)
        self.layout = news.get(LAYOUT, self.layout)
        self._news = list(news.items())
        return self.packet()

    def next(self, kind, accept=lambda _: True, timeout=HANG):
        """Return the next accepted content of a kind."""
        end = time.monotonic() + timeout
        while time.monotonic() < end:
            result, content = self.packet()
            if result == kind and accept(content):
                return content
        raise TimeoutError(f"no such {kind} within {timeout} s")

    def frames(self, count):
        """Return some frames."""
        return [self.next(FRAME) for _ in range(count)]


class Frame:
    """A frame, by the names of its fields."""

    def __init__(self, layout, payload):
        """Split the numbers by the layout."""
        (self.t,) = struct.unpack_from("<d", payload)
        numbers = np.frombuffer(payload, "<f4", offset=8)
        self._fields = {}
        at = 0
        for field in layout["fields"]:
            self._fields[field["name"]] = numbers[at : at + field["size"]]
            at += field["size"]
        assert at == len(numbers)
        self._causes = layout["causes"]

    def __getitem__(self, name):
        """Return the numbers of a field, or its only number."""
        values = self._fields[name]
        return float(values[0]) if len(values) == 1 else values

    @property
    def flags(self):
        """Names of the flags of the state."""
        return {name for name, bit in self._causes.items() if int(self["flags"]) & bit}
