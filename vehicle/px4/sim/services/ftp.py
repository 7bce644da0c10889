"""MAVLink FTP over a few files that can be read, listed and checked, and not changed."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import Any

from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.codec import Frame
from vehicle.px4.sim.services.files import crc
from vehicle.px4.sim.services.partner import Handler, Link

_HEAD = struct.Struct("<HBBBBBxI")  # sequence, session, opcode, size, asked opcode, burst complete, offset
PAYLOAD = 251
MOST_DATA = PAYLOAD - _HEAD.size
BURST = 70  # packets in a row, then the client asks for more
PACKETS_PER_UPDATE = 8


class Op(IntEnum):
    """Opcodes."""

    NONE = 0
    TERMINATE = 1
    RESET = 2
    LIST = 3
    OPEN_READ = 4
    READ = 5
    CREATE = 6
    WRITE = 7
    REMOVE = 8
    MAKE_FOLDER = 9
    REMOVE_FOLDER = 10
    OPEN_WRITE = 11
    TRUNCATE = 12
    RENAME = 13
    CRC = 14
    BURST = 15
    ACK = 128
    NAK = 129


class Error(IntEnum):
    """The first byte of a NAK."""

    SIZE = 3
    SESSION = 4
    NO_SESSIONS = 5
    EOF = 6
    UNKNOWN = 7
    PROTECTED = 9
    NOT_FOUND = 10


_CHANGES = (
    Op.CREATE, Op.WRITE, Op.REMOVE, Op.MAKE_FOLDER, Op.REMOVE_FOLDER, Op.OPEN_WRITE, Op.TRUNCATE, Op.RENAME,
)  # fmt: skip


class _RefusedError(Exception):
    pass


class Ftp:
    """One session, as PX4 has. `files` gives path -> content when it is first asked."""

    def __init__(self, files: Callable[[], Mapping[str, bytes]]) -> None:
        self._files = files
        self._open: bytes | None = None
        self._burst: tuple[Link, int, int] | None = None  # to whom: link, system, component
        self._sequence = self._offset = self._left = 0

    @property
    def handlers(self) -> dict[str, Handler]:
        """By message name."""
        return {"FILE_TRANSFER_PROTOCOL": self._on_packet}

    def _on_packet(self, link: Link, frame: Frame, m: Any) -> None:
        data = bytes(m.payload)
        sequence, session, opcode, size, _, _, offset = _HEAD.unpack_from(data)
        text = data[_HEAD.size : _HEAD.size + min(size, MOST_DATA)]
        to = (link, frame.system, frame.component)
        self._burst = None
        try:
            if size > MOST_DATA:
                raise _RefusedError(Error.SIZE)
            if opcode == Op.BURST:
                self._content(session)
                self._burst, self._sequence, self._offset, self._left = to, sequence, offset, BURST
                return
            answer = self._carried_out(opcode, session, offset, text)
            self._send(to, sequence + 1, session, Op.ACK, opcode, offset, answer)
        except _RefusedError as refused:
            self._send(to, sequence + 1, session, Op.NAK, opcode, offset, bytes((refused.args[0],)))

    def _carried_out(self, opcode: int, session: int, offset: int, text: bytes) -> bytes:
        """The answer's data. Raises _RefusedError."""
        path = text.split(b"\0", 1)[0].decode("utf-8", "replace").strip("/")
        if opcode == Op.LIST:
            return self._listed(path, offset)
        if opcode == Op.OPEN_READ:
            if self._open is not None:
                raise _RefusedError(Error.NO_SESSIONS)
            self._open = self._file(path)
            return len(self._open).to_bytes(4, "little")
        if opcode == Op.READ:
            content = self._content(session)
            if offset >= len(content):
                raise _RefusedError(Error.EOF)
            return content[offset : offset + MOST_DATA]
        if opcode == Op.CRC:
            return crc(self._file(path)).to_bytes(4, "little")
        if opcode in (Op.TERMINATE, Op.RESET):
            if opcode == Op.TERMINATE:
                self._content(session)
            self._open = None
        elif opcode in _CHANGES:
            raise _RefusedError(Error.PROTECTED)
        elif opcode != Op.NONE:
            raise _RefusedError(Error.UNKNOWN)
        return b""

    def _content(self, session: int) -> bytes:
        if self._open is None or session != 0:
            raise _RefusedError(Error.SESSION)
        return self._open

    def _file(self, path: str) -> bytes:
        try:
            return self._files()[path]
        except KeyError:
            raise _RefusedError(Error.NOT_FOUND) from None

    def _listed(self, folder: str, offset: int) -> bytes:
        inside = f"{folder}/" if folder not in ("", ".") else ""
        entries = {}
        for path, content in self._files().items():
            if path.startswith(inside):
                name, slash, _ = path.removeprefix(inside).partition("/")
                entries[name] = f"D{name}\0" if slash else f"F{name}\t{len(content)}\0"
        if not entries:
            raise _RefusedError(Error.NOT_FOUND)
        if offset >= len(entries):
            raise _RefusedError(Error.EOF)
        data = b""
        for name in sorted(entries)[offset:]:
            if len(data) + len(entries[name]) > MOST_DATA:
                break
            data += entries[name].encode()
        return data

    def update(self) -> None:
        """Send the next packets of a burst."""
        for _ in range(PACKETS_PER_UPDATE):
            if self._burst is None or self._open is None:
                return
            to, at = self._burst, self._offset
            self._sequence += 1
            data = self._open[at : at + MOST_DATA]
            if not data:
                self._burst = None
                self._send(to, self._sequence, 0, Op.NAK, Op.BURST, at, bytes((Error.EOF,)))
                return
            self._offset, self._left = at + len(data), self._left - 1
            last = self._left == 0 or self._offset >= len(self._open)
            self._send(to, self._sequence, 0, Op.ACK, Op.BURST, at, data, complete=last)
            if last:
                self._burst = None

    @staticmethod
    def _send(
        to: tuple[Link, int, int],
        sequence: int,
        session: int,
        opcode: int,
        asked: int,
        offset: int,
        data: bytes,
        complete: bool = False,
    ) -> None:
        link, system, component = to
        head = _HEAD.pack(sequence & 0xFFFF, session, opcode, len(data), asked, complete, offset)
        link.send(M["FILE_TRANSFER_PROTOCOL"], 0, system, component, (head + data).ljust(PAYLOAD, b"\0"))
