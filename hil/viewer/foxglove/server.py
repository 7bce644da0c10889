"""Foxglove's WebSocket protocol on loopback: the channels of a recording, as they are published.

It only sends: no client may publish, call or change anything. What a client is too slow for is dropped by the SDK, the
oldest first; nothing here waits for a client.
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import foxglove

from hil.contract.codec import codec
from hil.contract.topics import TOPICS
from hil.recording.foxglove import FoxgloveView, schema_set
from hil.recording.recorder import PICTURES, PREFIX

_BACKLOG = 1024  # messages that wait for one client
_AGAIN_NS = 1_000_000_000  # a client that joins later sees the scene's boxes within a second
_SCENE = "/scene"
_VIEWED_PICTURES = "/camera/image"


class FoxgloveServer:
    """Serves until closed. `view` makes the topics for viewers, as in the recording."""

    def __init__(self, port: int, view: FoxgloveView, name: str) -> None:
        """`port` 0: a free one. Raises OSError or RuntimeError if it cannot be listened on."""
        self._view = view
        context = self._context = foxglove.Context()  # its channels live as long as it is held
        self._codecs = {
            topic: codec(row.message) for topic, row in TOPICS.items() if row.recorded and topic != PICTURES
        }

        def channel(topic: str, schema: str, data: bytes) -> foxglove.Channel:
            described = foxglove.Schema(name=schema, encoding="protobuf", data=data)
            return foxglove.Channel(topic, message_encoding="protobuf", schema=described, context=context)

        self._channels = {t: channel(PREFIX + t, kind.name, kind.schema) for t, kind in self._codecs.items()}
        self._views = {
            topic: channel(topic, kind.DESCRIPTOR.full_name, schema_set(kind))
            for topic, kind, _ in FoxgloveView.CHANNELS
        }
        self._boxes: list[bytes] = []
        self._again_ns = 0
        self._server = foxglove.start_server(
            name=name, host="127.0.0.1", port=port, context=context, message_backlog_size=_BACKLOG
        )
        self.port = self._server.port
        self.shown = self.not_shown = 0

    def show(self, now_ns: int, topic: str, message: Any) -> None:
        """Send `message`, published on `topic` at `now_ns`, to the clients that subscribe to it."""
        at = max(0, now_ns)
        channel = self._channels.get(topic)
        if channel is not None and channel.has_sinks():
            channel.log(self._codecs[topic].encode(message), log_time=at)
        if topic == PICTURES and not self._views[_VIEWED_PICTURES].has_sinks():
            return  # without a client that asked for it a picture is not compressed
        try:
            views = self._view(topic, message)
        except Exception:  # whatever a codec of pictures or protobuf raises for a value from the bus
            self.not_shown += 1
            return
        for name, data in views:
            if name == _SCENE:
                self._boxes.append(data)
            self._views[name].log(data, log_time=at)
        if now_ns >= self._again_ns:
            self._again_ns = now_ns + _AGAIN_NS
            for data in self._boxes:
                self._views[_SCENE].log(data, log_time=at)
        self.shown += 1

    def close(self) -> None:
        """End the server and its connections; may be called twice."""
        with suppress(RuntimeError):
            self._server.stop()
