"""A small client of Foxglove's WebSocket protocol (RFC 6455 by hand), for the tests of the server."""

from __future__ import annotations

import base64
import json
import os
import socket
import struct
from typing import Any, NamedTuple

SUBPROTOCOL = "foxglove.sdk.v1"
TEXT, BINARY, CLOSE, PING, PONG = 1, 2, 8, 9, 10
MESSAGE_DATA = 1
LIMIT_S = 60.0


class Data(NamedTuple):
    """One message of a subscribed channel."""

    topic: str
    time_ns: int
    payload: bytes


class Client:
    """Connects, takes the server's advertisements, subscribes, reads."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S)
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(
            f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n"
            f"Sec-WebSocket-Protocol: {SUBPROTOCOL}\r\n\r\n".encode()
        )
        self._stream = self.socket.makefile("rb")
        status = self._stream.readline()
        assert b"101" in status, status
        while self._stream.readline() not in (b"\r\n", b""):
            pass
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self._topics: dict[int, str] = {}

    def text(self) -> dict[str, Any]:
        """The next message in JSON."""
        while True:
            kind, payload = self._frame()
            if kind == TEXT:
                return json.loads(payload)

    def welcome(self, channels: int) -> None:
        """Read until the server has told of itself and of so many channels."""
        while not self.info or len(self.channels) < channels:
            table = self.text()
            if table["op"] == "serverInfo":
                self.info = table
            elif table["op"] == "advertise":
                self.channels |= {one["topic"]: one for one in table["channels"]}

    def subscribe(self, *topics: str) -> None:
        wanted = [{"id": n, "channelId": self.channels[topic]["id"]} for n, topic in enumerate(topics, 1)]
        self._topics = dict(enumerate(topics, 1))
        self.send(json.dumps({"op": "subscribe", "subscriptions": wanted}).encode())

    def data(self) -> Data:
        """The next message of a subscribed channel."""
        while True:
            kind, payload = self._frame()
            if kind == BINARY and payload[0] == MESSAGE_DATA:
                number, time_ns = struct.unpack_from("<IQ", payload, 1)
                return Data(self._topics[number], time_ns, payload[13:])

    def send(self, payload: bytes, kind: int = TEXT) -> None:
        mask = os.urandom(4)
        length = len(payload)
        head = bytes([0x80 | kind, 0x80 | length]) if length < 126 else struct.pack("!BBH", 0x80 | kind, 0xFE, length)
        self.socket.sendall(head + mask + bytes(b ^ mask[i % 4] for i, b in enumerate(payload)))

    def _frame(self) -> tuple[int, bytes]:
        parts, first = b"", 0
        while True:
            head = self._read(2)
            kind, length = head[0] & 0x0F, head[1] & 0x7F
            if length == 126:
                (length,) = struct.unpack("!H", self._read(2))
            elif length == 127:
                (length,) = struct.unpack("!Q", self._read(8))
            payload = self._read(length)
            if kind == PING:
                self.send(payload, PONG)
                continue
            if kind == CLOSE:
                raise ConnectionError("the server closed the connection")
            first = kind or first
            parts += payload
            if head[0] & 0x80:
                return first, parts

    def _read(self, count: int) -> bytes:
        data = self._stream.read(count)
        if len(data) < count:
            raise ConnectionError("the server is gone")
        return data

    def close(self) -> None:
        self._stream.close()
        self.socket.close()

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
