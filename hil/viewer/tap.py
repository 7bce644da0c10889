"""The run's side of its viewer: passes thinned messages to a feed process and never waits.

Messages that the feed cannot take in time are dropped and counted; if the feed ends, the run continues.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from hil.contract.codec import codec
from hil.contract.messages import Image
from hil.contract.topics import TOPICS

PICTURES = "camera/image"
_MS = 1_000_000
# what the viewer shows, and how often at most; 0: all of it
SHOWN_NS: dict[str, int] = {
    "truth/vehicle": 40 * _MS, "mocap/vehicle": 40 * _MS, "vehicle/odometry": 40 * _MS, "truth/board": 40 * _MS,
    "mocap/board": 40 * _MS, "belief": 40 * _MS, "policy/action": 40 * _MS, "vehicle/sent": 40 * _MS,
    "run/stage": 100 * _MS, "referee/contact": 100 * _MS, PICTURES: 100 * _MS, "board/detection": 0, "event": 0,
}  # fmt: skip
_NICE = 10
_BUFFER = 1 << 20
_SMALL_PX = 640  # wider pictures are halved
_DRAIN_S = 5.0


@dataclass(frozen=True)
class FeedSpec:
    """Configuration of a feed's process. `sink`: a Rerun address or an .rrd file; m and rad.

    `endpoint`: the hub of a live run, to receive from, `keys` the folder that closes its bus; without a hub the run
    sends on the sockets `pipes`.
    """

    sink: str
    name: str
    board_size: float
    tolerance: float
    camera_offset: tuple[float, float, float]
    camera_tilt: float
    endpoint: str = ""
    keys: str = ""
    pipes: tuple[int, ...] = ()


class Thinner:
    """Lets through what the viewer shows, as often as it shows it."""

    def __init__(self) -> None:
        self._next_ns = dict.fromkeys(SHOWN_NS, -(2**62))

    def lets(self, now_ns: int, topic: str) -> bool:
        """True if a message of `topic` is to be shown at `now_ns`."""
        period = SHOWN_NS.get(topic)
        if period is None or now_ns < self._next_ns[topic]:
            return False
        self._next_ns[topic] = now_ns + period
        return True


def reduced(image: Image) -> Image:
    """A wide picture at half its size: a viewer's, not a detector's."""
    if image.width <= _SMALL_PX:
        return image
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
    width, height = image.width // 2, image.height // 2
    small = cv2.resize(pixels, (width, height), interpolation=cv2.INTER_AREA)
    return replace(image, width=width, height=height, data=small.tobytes())


class Feed:
    """One run's feed process. Called as a host's tap by a run in this process; never raises, never waits."""

    def __init__(self, spec: FeedSpec, log: Path) -> None:
        lanes = [] if spec.endpoint else [socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET) for _ in range(2)]
        self._lanes = [ours for ours, _ in lanes]
        theirs = [their for _, their in lanes]
        for lane in self._lanes:
            lane.setblocking(False)
            lane.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)  # the kernel grants what it allows
        pipes = tuple(their.fileno() for their in theirs)
        with log.open("ab") as output:
            self._process = subprocess.Popen(
                [sys.executable, "-m", "hil.viewer.feed", json.dumps(asdict(replace(spec, pipes=pipes)))],
                stdin=subprocess.DEVNULL, stdout=output, stderr=output, pass_fds=pipes, start_new_session=True,
            )  # fmt: skip
        yield_to_others(self._process)
        for their in theirs:
            their.close()
        self._thinner, self._live = Thinner(), bool(spec.endpoint)
        self.dropped = 0

    def __call__(self, now_ns: int, topic: str, message: Any) -> None:
        """Hand over, or drop, a message."""
        if not self._lanes or not self._thinner.lets(now_ns, topic):
            return
        try:
            if topic == PICTURES:
                message = reduced(message)
            name = topic.encode()
            self._lanes[topic == PICTURES].send(
                bytes([len(name)]) + name + codec(TOPICS[topic].message).encode(message)
            )
        except OSError:  # full, or the feed has ended
            self.dropped += 1

    def close(self) -> None:
        """End the feed; what it has been given is still shown, for a few seconds at most."""
        for lane in self._lanes:
            lane.close()
        self._lanes = []
        if self._live:
            self._process.terminate()
        try:
            self._process.wait(_DRAIN_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def __enter__(self) -> Feed:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def yield_to_others(process: subprocess.Popen[bytes]) -> None:
    """Lower the priority of `process` below that of control processes."""
    with suppress(OSError):
        os.setpriority(os.PRIO_PROCESS, process.pid, _NICE)
