"""The recorder: writes every message of a run into `run.mcap`, unchanged and as views for viewers.

`Recorder` is called as the host's tap. A run that cannot record must not fly: every failure is a RecordingError.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import nullcontext, suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from hil.contract.codec import codec
from hil.contract.topics import TOPICS
from hil.recording.foxglove import FoxgloveView, schema_set
from hil.recording.mcap_writer import McapWriter

PREFIX = "/perch/"
PICTURES = "camera/image"  # the topic, and the end of every topic, whose messages are pictures
FORMAT = "1"


class RecordingError(RuntimeError):
    """The run cannot be recorded."""


class Recorder:
    """Writes the messages of `topics` (default: all the contract marks as recorded) to a new file at `path`.

    `view` adds the topics for viewers; `metadata` is kept in the file (strings only, and nothing of a clock if the
    bytes of two runs are to agree). Use as a context manager, or call `close`.
    """

    def __init__(
        self,
        path: Path,
        *,
        topics: Iterable[str] | None = None,
        view: FoxgloveView | None = None,
        metadata: Mapping[str, str] | None = None,
    ) -> None:
        self.path = path
        self.not_shown = 0
        self._view = view
        self._viewed = view.topics if view is not None else frozenset()
        wanted = sorted(topics) if topics is not None else [name for name, t in TOPICS.items() if t.recorded]
        unknown = [name for name in wanted if name not in TOPICS]
        if unknown:
            raise RecordingError(f"cannot record {', '.join(unknown)}: hil/contract/topics.py does not list it")
        keep_pictures = view is not None and view.pictures == "raw"
        try:
            self._writer = McapWriter(path)
            self._channels: dict[str, int] = {}
            self._codecs = {}
            for name in wanted:
                kind = codec(TOPICS[name].message)
                if name == PICTURES and not keep_pictures:
                    continue
                lane = "pictures" if name == PICTURES else "small"
                self._channels[name] = self._writer.channel(PREFIX + name, kind.name, kind.schema, lane)
                self._codecs[name] = kind
            self._view_channels = {
                topic: self._writer.channel(topic, kind.DESCRIPTOR.full_name, schema_set(kind), lane)
                for topic, kind, lane in (FoxgloveView.CHANNELS if view is not None else ())
            }
            self._writer.metadata("perch-hil", {"format": FORMAT, **(metadata or {})})
        except OSError as error:
            raise RecordingError(f"cannot record to {path}: {error.strerror}") from error

    def __call__(self, now_ns: int, topic: str, message: Any) -> None:
        """Record `message`, published on `topic` at `now_ns` (the host's tap). Raises RecordingError once, when the
        file cannot be written; what follows is not recorded."""
        try:
            kind = self._codecs.get(topic)
            if kind is not None:
                self._writer.add(self._channels[topic], now_ns, kind.encode(message))
            if topic in self._viewed:
                for view_topic, data in self._shown(topic, message):
                    self._writer.add(self._view_channels[view_topic], now_ns, data)
        except OSError as error:
            raise RecordingError(
                f"recording to {self.path} failed at {now_ns / 1e9:.2f} s: {error.strerror}"
            ) from error

    def _shown(self, topic: str, message: Any) -> list[tuple[str, bytes]]:
        """The messages for viewers. One that cannot be shown (a picture of -1 lines, a time of 2^63) is left out of
        the views and counted in `not_shown`: its own topic keeps it, and the recording goes on."""
        if self._view is None:
            return []
        try:
            return self._view(topic, message)
        except OSError:
            raise
        except Exception:  # whatever a codec of pictures or protobuf raises for a value from the bus
            self.not_shown += 1
            return []

    @property
    def counts(self) -> dict[str, int]:
        """Messages recorded so far, by topic, without the views."""
        counts = self._writer.counts()
        return {topic: counts[PREFIX + topic] for topic in self._channels}

    def note(self, name: str, values: Mapping[str, str]) -> None:
        """Put a table of strings beside the messages; in lockstep nothing of a clock, as its bytes are compared."""
        try:
            self._writer.metadata(name, values)
        except OSError as error:
            raise RecordingError(f"recording to {self.path} failed: {error.strerror}") from error

    def flush(self) -> None:
        """Write everything to the operating system now: flushed data survives a killed process."""
        self._writer.flush()

    def close(self) -> None:
        """Finish the file. Safe to call twice. Raises RecordingError if its end cannot be written."""
        try:
            self._writer.close()
        except OSError as error:
            raise RecordingError(f"recording to {self.path} failed at its end: {error.strerror}") from error

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(RecordingError) if error is not None else nullcontext():  # the first cause counts
            self.close()
