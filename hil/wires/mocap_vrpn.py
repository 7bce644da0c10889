"""Motion capture over VRPN (NOKOV, Vicon, OptiTrack and others stream it), by the package `motioncapture`.

The package looks for new poses every 10 ms and passes no time stamps on: a pose's time is its arrival less a configured
delay, with an uncertainty of those 10 ms.
"""

from __future__ import annotations

import atexit
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NamedTuple

from hil.wires import WireError

PACKAGE = "motioncapture"
SILENCE_NS = 1_000_000_000
_WAITING = 256

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class BodyPose(NamedTuple):
    """One body as it was `age_ns` ago: m (the system's world, z up), w x y z (world from body)."""

    body: str
    age_ns: int
    position: Vec3
    orientation: Quat


def package() -> Any:
    """The client library. Raises WireError if it is not installed."""
    try:
        return import_module(PACKAGE)
    except ImportError as error:
        raise WireError(
            f"kind vrpn needs the Python package {PACKAGE}, which cannot be loaded ({error}): "
            "pip install 'perch-hil[mocap]'"
        ) from None


class VrpnMocap:
    """Follows `bodies` of one server in a thread of its own; the names of other bodies are kept for error texts."""

    def __init__(
        self, server: str, bodies: Sequence[str], delay_ns: int, clock: Callable[[], int] = time.monotonic_ns
    ) -> None:
        """`server`: HOST or HOST:PORT. `delay_ns`: from the pose to its arrival here. Raises WireError.

        A server that does not answer is detected in `wait_for_bodies`, not here.
        """
        self.server = server
        _resolve(server)
        try:
            self._client = package().connect("vrpn", {"hostname": server})
        except (RuntimeError, ValueError) as error:
            raise WireError(f"motion capture at {server} cannot be reached: {error}") from None
        self._delay_ns, self._clock = delay_ns, clock
        self._bodies = tuple(bodies)
        self._lock = threading.Lock()
        self._waiting: deque[tuple[str, int, Vec3, Quat]] = deque(maxlen=_WAITING)
        self._last: dict[str, tuple[Vec3, Quat]] = {}
        self.received: set[str] = set()
        self._last_ns = clock()
        self._trouble = ""
        self._closing = False
        self._thread = threading.Thread(target=self._run, name=f"mocap {server}", daemon=True)
        self._thread.start()
        # the library aborts the process if the interpreter ends while a thread is inside it
        atexit.register(self.close)

    @property
    def lost(self) -> str:
        """Why no more poses come; empty while they do."""
        if self._trouble:
            return self._trouble
        if self._clock() - self._last_ns > SILENCE_NS:
            return f"motion capture at {self.server} is silent: no new pose for {SILENCE_NS / 1e9:g} s"
        return ""

    def wait_for_bodies(self, limit_s: float = 6.0) -> VrpnMocap:
        """Itself, once all bodies were received. Raises WireError (and closes) if they are not."""
        until = time.monotonic() + limit_s
        while not self.received.issuperset(self._bodies):
            if time.monotonic() > until or self._trouble:
                self.close()
                raise WireError(self._trouble or self._missing(limit_s))
            time.sleep(0.02)
        return self

    def _missing(self, limit_s: float) -> str:
        if not self.received:
            return f"motion capture at {self.server} sends nothing for {limit_s:g} s: is VRPN streaming switched on?"
        lacking = ", ".join(f'"{b}"' for b in self._bodies if b not in self.received)
        return f"motion capture at {self.server} does not know the body {lacking}; it streams {_listed(self.received)}"

    def take(self, now_ns: int, /) -> list[BodyPose]:
        """Poses that came since the last call, oldest first. It keeps real time and does not use `now_ns`."""
        with self._lock:
            waiting = list(self._waiting)
            self._waiting.clear()
        now = self._clock()
        return [BodyPose(body, now - stamp, position, turn) for body, stamp, position, turn in waiting]

    def close(self) -> None:
        """Disconnect; may be called twice."""
        if not self._closing:
            self._closing = True
            atexit.unregister(self.close)
            self._thread.join(2.0)

    def _run(self) -> None:
        while not self._closing:
            try:
                self._client.waitForNextFrame()
                bodies = self._client.rigidBodies
            except Exception as error:  # any exception of the library
                self._trouble = f"motion capture at {self.server} is gone: {error}"
                return
            stamp = self._clock() - self._delay_ns
            for name, body in bodies.items():
                self.received.add(name)
                if name in self._bodies:
                    self._keep(name, stamp, body)

    def _keep(self, name: str, stamp_ns: int, body: Any) -> None:
        x, y, z = map(float, body.position)
        turn = body.rotation
        pose = (x, y, z), (float(turn.w), float(turn.x), float(turn.y), float(turn.z))
        if self._last.get(name) == pose:  # the library repeats the last pose of a body that is hidden
            return
        self._last[name] = pose
        with self._lock:
            self._waiting.append((name, stamp_ns, *pose))
            self._last_ns = self._clock()


def _resolve(server: str) -> None:
    """Checked here, as the library continues with an unknown host and prints an error a hundred times a second."""
    host, _, port = server.partition(":")
    fault = "" if not port or (port.isdecimal() and 0 < int(port) < 65536) else "that is not a port"
    try:
        socket.getaddrinfo(host, None, socket.AF_INET, socket.SOCK_DGRAM)
    except OSError as error:
        fault = fault or str(error)
    if fault:
        raise WireError(f'motion capture at "{server}" is not a HOST or HOST:PORT that this machine can find: {fault}')


def _listed(names: set[str]) -> str:
    return ", ".join(f'"{name}"' for name in sorted(names))
