"""Camera wires: the newest picture with its age, from a device that a thread reads, or from a recording.

A camera's exposure is known from the driver's time stamp if there is one, else from the arrival less a set delay.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

import cv2
import numpy as np

from hil.wires import WireError

SILENCE_NS = 1_000_000_000  # a device without a picture for this time is lost
_OLDEST_STAMP_NS = 500_000_000  # an older stamp of a driver is of another clock


class Mode(NamedTuple):
    """Picture size (px) and rate (Hz), asked of a device."""

    width: int
    height: int
    rate_hz: float

    def __str__(self) -> str:
        return f"{self.width}x{self.height} at {self.rate_hz:g} Hz"


class Picture(NamedTuple):
    """One picture. `age_ns`: time since the middle of its exposure. `pixels`: (height, width) uint8."""

    age_ns: int
    pixels: np.ndarray
    sequence: int


class Damaged(NamedTuple):
    """A picture that came and could not be decoded, with the reason."""

    why: str


class CameraWire(Protocol):
    """A camera. `lost`: empty, or why no more pictures come; `dropped`: pictures that were replaced untaken;
    `damaged`: pictures that could not be decoded."""

    mode: Mode
    source: str

    @property
    def lost(self) -> str: ...
    @property
    def dropped(self) -> int: ...
    @property
    def damaged(self) -> int: ...

    def take(self, now_ns: int, /) -> Picture | None:
        """The newest picture that was not taken yet, or None. Never blocks, never raises."""
        ...

    def close(self) -> None: ...


class Capture(Protocol):
    """A device as its library gives it: `read` blocks until the next picture, and gives None once the device is gone.

    The number is the driver's time stamp on the monotonic clock (ns), or None. `trouble`: the device's last error.
    """

    def read(self) -> tuple[np.ndarray, int | None] | Damaged | None: ...

    @property
    def trouble(self) -> str: ...

    def stop(self) -> None:
        """End a `read` that waits in another thread, where that is possible."""
        ...

    def close(self) -> None: ...


class NewestPicture:
    """Reads a capture in a thread of its own and keeps the newest picture only."""

    def __init__(
        self,
        capture: Capture,
        mode: Mode,
        source: str,
        *,
        arrival_delay_ns: int,
        stamp_offset_ns: int = 0,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        """`arrival_delay_ns`: from the middle of the exposure to the arrival, where the driver gives no stamp;
        `stamp_offset_ns`: from the driver's stamp to that middle."""
        self.mode, self.source = mode, source
        self._capture, self._clock = capture, clock
        self._delay_ns, self._offset_ns = arrival_delay_ns, stamp_offset_ns
        self._lock = threading.Lock()
        self._newest: tuple[int, np.ndarray, int] | None = None
        self._count = self._dropped = self._damaged = self.unstamped = 0
        self._lost = ""
        self._last_ns = clock()
        self._closing = False
        self._thread = threading.Thread(target=self._run, name=f"camera {source}", daemon=True)
        self._thread.start()

    @property
    def lost(self) -> str:
        """Why no more pictures come; empty while they do."""
        if not self._lost and self._clock() - self._last_ns > SILENCE_NS and not self._closing:
            damaged = f" ({self._damaged} damaged ones came)" if self._damaged else ""
            self._lost = f"camera {self.source} is silent: no picture for {SILENCE_NS / 1e9:g} s{damaged}"
        return self._lost

    @property
    def dropped(self) -> int:
        """Pictures that a newer one replaced before they were taken."""
        return self._dropped

    @property
    def damaged(self) -> int:
        """Pictures that could not be decoded: they are left out, and the age limit alone makes the camera lost."""
        return self._damaged

    def take(self, now_ns: int, /) -> Picture | None:
        """The newest picture not taken yet. A device keeps real time and does not use `now_ns`."""
        with self._lock:
            newest, self._newest = self._newest, None
        if newest is None:
            return None
        exposed_ns, pixels, sequence = newest
        return Picture(max(0, self._clock() - exposed_ns), pixels, sequence)

    def close(self) -> None:
        """Close the device; may be called twice."""
        if not self._closing:
            self._closing = True
            self._capture.stop()
            self._thread.join(2.0)
            if not self._thread.is_alive():  # a driver that hangs must keep its device
                self._capture.close()

    def _run(self) -> None:
        while not self._closing:
            try:
                read = self._capture.read()
            except Exception as error:  # any exception of a driver's library: the device cannot be used
                read, why = None, str(error)
            else:
                why = self._capture.trouble
            if read is None:
                self._end(f"camera {self.source} is gone" + (f": {why}" if why else ""))
                return
            if isinstance(read, Damaged):
                self._damaged += 1
                continue
            pixels, stamp_ns = read
            if pixels.shape != (self.mode.height, self.mode.width):
                self._end(
                    f"camera {self.source} sends {pixels.shape[1]}x{pixels.shape[0]}, "
                    f"asked for was {self.mode.width}x{self.mode.height}"
                )
                return
            self._keep(pixels, stamp_ns)

    def _keep(self, pixels: np.ndarray, stamp_ns: int | None) -> None:
        now = self._clock()
        usable = stamp_ns is not None and 0 <= now - stamp_ns <= _OLDEST_STAMP_NS
        self.unstamped += not usable
        exposed_ns = stamp_ns + self._offset_ns if usable and stamp_ns is not None else now - self._delay_ns
        with self._lock:
            self._dropped += self._newest is not None
            self._newest = (exposed_ns, pixels, self._count)
            self._count += 1
            self._last_ns = now

    def _end(self, why: str) -> None:
        if not self._closing:
            self._lost = self._lost or why


def grey(frame: np.ndarray) -> np.ndarray:
    """A picture of one, three (BGR) or two (YUYV) channels as mono8, (height, width)."""
    if frame.ndim == 2:
        return frame
    if frame.shape[2] == 2:
        return cv2.cvtColor(frame, cv2.COLOR_YUV2GRAY_YUY2)
    return frame[:, :, 0] if frame.shape[2] == 1 else cv2.cvtColor(frame, cv2.COLOR_BGR2GRAY)


def wait_for_picture(camera: NewestPicture, limit_s: float = 5.0) -> NewestPicture:
    """`camera` once its first picture has come. Raises WireError (and closes it) if none does."""
    until = time.monotonic() + limit_s
    while camera._count == 0:
        lost = camera._lost
        if lost or time.monotonic() > until:
            camera.close()
            raise WireError(lost or f"camera {camera.source} gives no picture for {limit_s:g} s")
        camera._last_ns = camera._clock()
        time.sleep(0.01)
    return camera


def measured_rate(camera: NewestPicture, seconds: float = 1.0) -> float:
    """Rate (Hz) at which pictures arrive at `camera`, decodable or not, measured over `seconds`; 0 without pictures."""
    first, began = camera._count + camera._damaged, time.monotonic()
    at_first = at_last = 0.0
    seen = first
    while time.monotonic() - began < seconds:
        count = camera._count + camera._damaged
        if count > seen:
            at_last = time.monotonic()
            if not at_first:
                first, at_first = count, at_last
            seen = count
        time.sleep(0.001)
    return (seen - first) / (at_last - at_first) if at_last > at_first else 0.0
