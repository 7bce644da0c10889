"""A camera that plays back the pictures of a recorded run, at the times at which they came."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError

from hil.recording.reader import ReadError, Recording
from hil.recording.recorder import PREFIX
from hil.wires import WireError
from hil.wires.camera import Mode, Picture

_VIEW = "/camera/image"
_OWN = f"{PREFIX}camera/image"


class _Recorded(NamedTuple):
    log_ns: int
    stamp_ns: int
    pixels: np.ndarray


class RecordedCamera:
    """Plays from the first `take` on, which is taken as the moment at which the recorded car started.

    A picture that cannot be decoded is counted in `damaged` and left out.
    """

    def __init__(self, path: Path | str, mode: Mode) -> None:
        """Raises WireError if there is no recording, or it has no pictures, or not of the size in `mode`."""
        self.mode, self.source = mode, f"recording {path}"
        self.dropped = self.damaged = 0
        self.lost = ""
        try:
            self._recording = Recording(path)
        except ReadError as error:
            raise WireError(str(error)) from None
        self._pictures = self._read()
        self._next = next(self._pictures, None)
        if self._next is None:
            raise WireError(f"{self.source} holds no pictures: record them with --pictures all")
        height, width = self._next.pixels.shape
        if (width, height) != mode[:2]:
            raise WireError(
                f"{self.source} holds pictures of {width}x{height}, asked for was {mode.width}x{mode.height}: "
                "previews are of half the size, record with --pictures all"
            )
        self._first_ns = min(self._lead_ns(), self._next.log_ns)
        self._start_ns: int | None = None
        self._count = 0

    def take(self, now_ns: int, /) -> Picture | None:
        """The newest picture that had come by then in the recorded run."""
        if self._start_ns is None:
            self._start_ns = now_ns
        newest: _Recorded | None = None
        shift = self.shift_ns
        while self._next is not None and self._next.log_ns + shift <= now_ns:
            self.dropped += newest is not None
            newest, self._next = self._next, next(self._pictures, None)
            self._count += 1
        if newest is None:
            if self._next is None:
                self.lost = f"{self.source} has no more pictures"
            return None
        return Picture(now_ns - newest.stamp_ns - shift, newest.pixels, self._count - 1)

    def close(self) -> None:
        """There is nothing to close."""

    @property
    def shift_ns(self) -> int:
        """From a time of the recorded run to the time that `take` is given."""
        return 0 if self._start_ns is None else self._start_ns - self._first_ns

    def _lead_ns(self) -> int:
        """When the recorded run began its lead stage; a time after all pictures if that is not recorded."""
        if f"{PREFIX}run/stage" in self._recording.topics:
            for entry in self._recording.messages(["run/stage"]):
                if entry.message.name != "prepare":
                    return entry.log_ns
        return 2**63

    def _read(self) -> Iterator[_Recorded]:
        if _OWN in self._recording.topics:
            for entry in self._recording.messages(["camera/image"]):
                image = entry.message
                pixels = np.frombuffer(image.data, np.uint8)
                if pixels.size == image.width * image.height:
                    yield _Recorded(entry.log_ns, image.stamp_ns, pixels.reshape(image.height, image.width))
                else:
                    self.damaged += 1
        elif _VIEW in self._recording.topics:
            for raw in self._recording.raw([_VIEW]):
                picture = _unpacked(raw.data)
                if picture is None:
                    self.damaged += 1
                else:
                    yield _Recorded(raw.log_ns, *picture)


def _unpacked(data: bytes) -> tuple[int, np.ndarray] | None:
    """(time stamp, pixels) of a compressed picture; None if it cannot be decoded."""
    try:
        view = CompressedImage.FromString(data)
        pixels = cv2.imdecode(np.frombuffer(view.data, np.uint8), cv2.IMREAD_GRAYSCALE)
    except (DecodeError, cv2.error):
        return None
    return None if pixels is None else (view.timestamp.ToNanoseconds(), pixels)
