"""Receipts: the messages that each step of each node consumed, so that the step can be repeated exactly.

One MCAP file per process in the run's folder (`receipts-NAME.mcap`), one topic per node. A receipt holds the step's
time and, for each of the node's inputs in order, the numbers of the messages that were new: their place in the topic.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType

from hil.contract.codec import codec
from hil.contract.node import Inbox, Node
from hil.recording.mcap_writer import McapWriter
from hil.recording.reader import Recording
from hil.recording.recorder import RecordingError

PREFIX = "/perch/receipt/"


@dataclass(frozen=True, slots=True)
class Receipt:
    """One step. `consumed`: for each input of the node in order, how many messages were new, then their numbers."""

    stamp_ns: int
    consumed: tuple[int, ...]


_encoded = codec(Receipt).encode_fields


class ReceiptBook:
    """Writes the receipts of the nodes of one process. Raises RecordingError if it cannot."""

    def __init__(self, path: Path, nodes: Sequence[Node]) -> None:
        kind, self._path = codec(Receipt), path
        try:
            self._writer = McapWriter(path)
        except OSError as error:
            raise RecordingError(f"cannot write receipts to {path}: {error.strerror}") from error
        self._channels = {node.name: self._writer.channel(PREFIX + node.name, kind.name, kind.schema) for node in nodes}
        self._writer.metadata("inputs", {node.name: " ".join(node.inputs) for node in nodes})

    def add(self, node: str, now_ns: int, consumed: Sequence[int]) -> None:
        """Note one step of `node`."""
        try:
            self._writer.add(self._channels[node], now_ns, _encoded(stamp_ns=now_ns, consumed=consumed))
        except OSError as error:
            raise RecordingError(f"writing receipts to {self._path} failed: {error.strerror}") from error

    def close(self) -> None:
        """Finish the file; may be called twice. Raises RecordingError if its end cannot be written."""
        try:
            self._writer.close()
        except OSError as error:
            raise RecordingError(f"writing receipts to {self._path} failed: {error.strerror}") from error

    def __enter__(self) -> ReceiptBook:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(RecordingError) if error is not None else nullcontext():  # the first cause counts
            self.close()


class Counted:
    """Receipts of one node in a host that delivers every message in order (lockstep): it only has to count."""

    def __init__(self, node: Node, book: ReceiptBook) -> None:
        self._node, self._inputs, self._book = node.name, node.inputs, book
        self._seen = dict.fromkeys(node.inputs, 0)

    def add(self, now_ns: int, inbox: Inbox) -> None:
        """Note a step at `now_ns` that consumes what is new in `inbox`."""
        consumed: list[int] = []
        for topic in self._inputs:
            count = len(inbox.new(topic))
            if not count:
                consumed.append(0)
                continue
            first = self._seen[topic]
            consumed += (count, *range(first, first + count))
            self._seen[topic] = first + count
        self._book.add(self._node, now_ns, consumed)


def read_receipts(run: Path) -> dict[str, tuple[tuple[str, ...], list[Receipt]]]:
    """node -> (its inputs then, its receipts in order), of all receipt files in the run's folder."""
    found: dict[str, tuple[tuple[str, ...], list[Receipt]]] = {}
    kind = codec(Receipt)
    for path in sorted(run.glob("receipts*.mcap")):
        recording = Recording(path)
        inputs = recording.metadata.get("inputs", {})
        for raw in recording.raw():
            node = raw.topic.removeprefix(PREFIX)
            if node not in found:
                found[node] = (tuple(inputs.get(node, "").split()), [])
            found[node][1].append(kind.decode(raw.data))
    return found
