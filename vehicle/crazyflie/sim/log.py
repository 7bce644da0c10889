"""The log service: table of contents, blocks of variables, and their packets at their periods."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from vehicle.crazyflie.crtp import Errno, Log, LogControl, Packet, Port
from vehicle.crazyflie.table import LOG_KINDS, Contents, Variable, packed

MOST_BLOCKS, MOST_VARIABLES, MOST_BYTES = 16, 128, 26
_BY_NUMBER = {number: form for number, form in LOG_KINDS.values()}
_SIZE = {1: 1, 2: 2, 3: 4, 4: 1, 5: 2, 6: 4, 7: 4, 8: 2}


@dataclass
class _Block:
    reads: list[tuple[Callable[[], float], str]] = field(default_factory=list)
    size: int = 0
    period_ns: int = 0  # 0: stopped
    due_ns: int = 0


class LogService:
    """`sources`: what reads each variable, by its full name."""

    def __init__(self, variables: Sequence[Variable], sources: Mapping[str, Callable[[], float]]) -> None:
        self.contents = Contents(variables, LOG_KINDS)
        self._sources = [sources[variable.full] for variable in self.contents.variables]
        self._blocks: dict[int, _Block] = {}

    def handle(self, now_ns: int, packet: Packet) -> Packet | None:
        """The answer to a request on the log's port."""
        if packet.channel == Log.TABLE:
            answer = self.contents.answer(packet.data, (MOST_BLOCKS, MOST_VARIABLES))
            return None if answer is None else Packet(Port.LOG, Log.TABLE, answer)
        if packet.channel != Log.CONTROL or not packet.data:
            return None
        command, block = packet.data[0], packet.data[1] if len(packet.data) > 1 else 0
        result = self._control(now_ns, command, block, packet.data[2:])
        return Packet(Port.LOG, Log.CONTROL, bytes((command, block, result)))

    def _control(self, now_ns: int, command: int, number: int, rest: bytes) -> int:
        if command == LogControl.RESET:
            self._blocks.clear()
            return 0
        if command == LogControl.CREATE:
            if number in self._blocks:
                return Errno.EXISTS
            if len(self._blocks) >= MOST_BLOCKS:
                return Errno.NO_MEMORY
            self._blocks[number] = _Block()
            return self._append(self._blocks[number], rest)
        if command not in LogControl.__members__.values():
            return Errno.NO_COMMAND
        block = self._blocks.get(number)
        if block is None:
            return Errno.NO_ENTRY
        if command == LogControl.APPEND:
            return self._append(block, rest)
        if command == LogControl.DELETE:
            del self._blocks[number]
        elif command == LogControl.STOP:
            block.period_ns = 0
        else:
            period_ms = (
                int.from_bytes(rest[:2], "little") if command == LogControl.START_MS else 10 * (rest or b"\0")[0]
            )
            block.period_ns = period_ms * 1_000_000
            block.due_ns = now_ns + block.period_ns
        return 0

    def _append(self, block: _Block, rest: bytes) -> int:
        for at in range(0, len(rest) - 2, 3):
            kind, number = rest[at] & 0x0F, int.from_bytes(rest[at + 1 : at + 3], "little")
            if number >= len(self._sources) or kind not in _BY_NUMBER:
                return Errno.NO_ENTRY
            if block.size + _SIZE[kind] > MOST_BYTES:
                return Errno.TOO_BIG
            if sum(len(other.reads) for other in self._blocks.values()) >= MOST_VARIABLES:
                return Errno.NO_MEMORY
            block.reads.append((self._sources[number], _BY_NUMBER[kind]))
            block.size += _SIZE[kind]
        return 0

    def due(self, now_ns: int) -> list[Packet]:
        """The packets of the blocks whose period is over."""
        packets = []
        for number, block in self._blocks.items():
            if block.period_ns and now_ns >= block.due_ns:
                block.due_ns += block.period_ns
                if block.due_ns <= now_ns:  # asked for more often than the loop runs
                    block.due_ns = now_ns + block.period_ns
                head = bytes((number,)) + (now_ns // 1_000_000 & 0xFFFFFF).to_bytes(3, "little")
                packets.append(
                    Packet(Port.LOG, Log.DATA, head + b"".join(packed(read(), f) for read, f in block.reads))
                )
        return packets
