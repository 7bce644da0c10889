"""The feed's process: sends a run's messages to Rerun during the run. `python -m hil.viewer.feed SPEC` (JSON, see
FeedSpec).

It may be slow, hang or end: no control process waits for it.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import socket
import sys
from collections.abc import Iterator
from typing import Any

from hil.contract.codec import CodecError, codec
from hil.contract.topics import TOPICS
from hil.viewer import scene
from hil.viewer.joining import join
from hil.viewer.stream import TABS, ViewStream
from hil.viewer.tap import PICTURES, SHOWN_NS, FeedSpec, Thinner, reduced
from hil.viewer.view import APPLICATION, rerun
from vehicle.camera.pinhole import Camera

_PACKET = 1 << 20
_FLUSH_S = 3.0

Item = tuple[str, Any]


def from_pipes(pipes: tuple[int, ...]) -> Iterator[Item]:
    """(topic, message) from the run's sockets until it closes them."""
    with selectors.DefaultSelector() as selector:
        for pipe in pipes:
            selector.register(socket.socket(fileno=pipe), selectors.EVENT_READ)
        while selector.get_map():
            for key, _ in selector.select():
                lane: socket.socket = key.fileobj  # type: ignore[assignment]
                packet = lane.recv(_PACKET)
                if not packet:
                    selector.unregister(lane)
                    lane.close()
                    continue
                head = 1 + packet[0]
                topic = packet[1:head].decode()
                yield topic, codec(TOPICS[topic].message).decode(packet[head:])


def from_bus(endpoint: str, keys: str, stopped: list[bool]) -> Iterator[Item]:
    """(topic, message) of a live run, thinned, until stopped. Raises BusError if no hub starts."""
    from hil.bus.leaf import Mailbox

    mailbox, thinner = Mailbox(), Thinner()
    with join(endpoint, keys, stopped, mailbox, SHOWN_NS):
        last = False
        while not last:
            last = bool(stopped)  # messages received until then are still shown
            mailbox.wait(100_000_000)
            for delivery in mailbox.drain():
                if thinner.lets(delivery.published_ns, delivery.topic):
                    yield delivery.topic, reduced(delivery.message) if delivery.topic == PICTURES else delivery.message
    mailbox.close()


def feed(spec: FeedSpec) -> int:
    """Show the run until it ends; returns how many messages were shown."""
    stopped: list[bool] = []
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, lambda *_: stopped.append(True))
    sdk, shown = rerun(), 0
    stream = sdk.RecordingStream(APPLICATION)
    layout = scene.layout(scene.RUN, {name: [(p.key, p.title) for p in plots] for name, plots in TABS.items()})
    if spec.sink.endswith(".rrd"):
        stream.save(spec.sink, default_blueprint=layout)
    else:
        stream.connect_grpc(spec.sink, default_blueprint=layout)
    with stream:
        stream.send_recording_name(spec.name)
        camera = Camera(offset=spec.camera_offset, tilt=spec.camera_tilt)
        view = ViewStream(stream, spec.board_size, spec.tolerance, camera)
        items = from_bus(spec.endpoint, spec.keys, stopped) if spec.endpoint else from_pipes(spec.pipes)
        for topic, message in items:
            view.add(topic, message)
            shown += 1
        stream.flush(timeout_sec=_FLUSH_S)
    stream.disconnect()
    return shown


def main() -> int:
    """Read the spec and show."""
    table = json.loads(sys.argv[1])
    spec = FeedSpec(**{**table, "pipes": tuple(table["pipes"]), "camera_offset": tuple(table["camera_offset"])})
    try:
        print(f"{spec.name}: {feed(spec)} messages shown", flush=True)
    except (OSError, RuntimeError, CodecError) as error:
        print(f"{spec.name}: the feed ended: {error}", flush=True)
        return 3
    return 0


if __name__ == "__main__":
    os._exit(main())  # Rerun's and Zenoh's threads are not waited for
