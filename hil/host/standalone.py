"""The software PX4 alone on UDP, without a run: for MAVSDK, QGroundControl and a user's own code.

It flies one vehicle from the ground, in PX4's local frame (world ENU, origin where it stands). Like PX4 it sends to the
address at which a client listens, and answers a client that sends to its own port instead; the first sender on a link
stays its partner. Its time is PX4's: it follows the wall clock (`start`) or stands still between calls (`run`).
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from hil.wires import WireError
from hil.wires.udp import Address, UdpWire
from hil.wires.url import check_url
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.px4.sim.estimator import GPS_NOISE
from vehicle.px4.sim.plant import TICK_NS
from vehicle.px4.sim.truth import Truth
from vehicle.quadrotor.airframe import load_airframe

LOOPBACK, ANY = "127.0.0.1", "0.0.0.0"
OFFBOARD, GROUND = (14540, 14580), (14550, 18570)  # where PX4's clients listen, and what it binds itself
BOOTED_S = 5.2  # PX4 time after which its pre-arm checks pass
_STALL_NS = 50_000_000  # of wall time in one go: what a busy machine takes beyond it is not made up for
_AT_ONCE = 8  # ticks between two looks at `ended` where time is not tied to the wall clock


class LinkAddress(NamedTuple):
    """One UDP link. `own`: host and port that PX4 binds; `peer`: where a client listens, None if it has to speak first.

    A port of 0 in `own` is any free one.
    """

    own: Address
    peer: Address | None


FREE = LinkAddress((LOOPBACK, 0), None)


def link_address(url: str, usual: tuple[int, int]) -> LinkAddress:
    """What `udp://HOST:PORT` asks for, the address at which the client listens; without HOST it is this computer.

    PX4's own port lies as far from PORT as in `usual`. Port 0: any free port, on which PX4 waits for its client. A
    client on this computer is served on the loopback only. Raises WireError for another address.
    """
    if url in ("udp://:0", f"udp://{LOOPBACK}:0"):
        return FREE
    kind, host, port = check_url(url)
    own = port - usual[0] + usual[1]
    if not kind.startswith("udp") or not 1 <= own <= 65535:
        raise WireError(f'"{url}" is no UDP address at which a client can listen: write udp://:{usual[0]}')
    if host in (ANY, LOOPBACK, "localhost"):
        return LinkAddress((LOOPBACK, own), (LOOPBACK, port))
    return LinkAddress((ANY, own), (host, port))


class StandalonePx4:
    """One software PX4 on its own, with an offboard link (PX4's Onboard) and, if wanted, a ground station's."""

    def __init__(
        self,
        airframe: str = "sih_quad",
        *,
        offboard: LinkAddress = FREE,
        ground: LinkAddress | None = None,
        seed: int = 0,
        parameters: Mapping[str, float] | None = None,
    ) -> None:
        """Bind the ports; PX4 boots with the first step of its time.

        `airframe`: name, or path to a .toml. `seed`: of its sensors' noise. `parameters`: PX4's, set before it boots.
        Raises ValueError for an unknown airframe or parameter, WireError for a port that cannot be bound.
        """
        frame = load_airframe(airframe)
        self._thread: threading.Thread | None = None
        self._ended = threading.Event()
        self.failure: Exception | None = None  # that ended the thread
        self._wires: dict[str, UdpWire] = {}
        try:
            for name, link in (("api", offboard), ("gcs", ground)):
                if link is not None:
                    self._wires[name] = UdpWire(link.own, link.peer, partner="first", accept_others=True)
            self._sim = Px4Sim(self._wires, frame, seed, parameters=parameters, noise=GPS_NOISE)
        except (WireError, ValueError):
            self.close()
            raise
        self._lock = threading.Lock()
        self._now_ns = 0
        self._sim.step(0)

    @property
    def offboard(self) -> UdpWire:
        """The offboard link."""
        return self._wires["api"]

    @property
    def ground(self) -> UdpWire | None:
        """The ground station's link; None without it."""
        return self._wires.get("gcs")

    @property
    def port(self) -> int:
        """PX4's own port of the offboard link."""
        return self.offboard.address[1]

    @property
    def url(self) -> str:
        """What a MAVSDK client on this computer is given as its connection: it speaks first."""
        return f"udpout://{LOOPBACK}:{self.port}"

    @property
    def seconds(self) -> float:
        """PX4's time since its boot."""
        return self._now_ns * 1e-9

    @contextmanager
    def held(self) -> Iterator[Px4Sim]:
        """The autopilot itself while its time stands still: to break a motor, to switch GPS off, to blow wind."""
        with self._lock:
            yield self._sim

    def truth(self) -> Truth:
        """Where the vehicle really is, and whether it is armed."""
        with self.held() as sim:
            return sim.truth()

    # -- time -----------------------------------------------------------------------------------------------------

    def run(self, seconds: float, every: Callable[[], object] | None = None, period: float = 0.02) -> None:
        """Let `seconds` of PX4's time pass, as fast as they can be computed; nothing waits for a client.

        `every` is called at each `period` s of PX4's time, to send set-points and to read what came: the system keeps
        about a second of one link's messages for a client that does not read.
        """
        if not (math.isfinite(seconds) and seconds >= 0.0 and period > 0.0):
            raise ValueError(f"{seconds} s in periods of {period} s: give times that are finite and not negative")
        end, due = self._now_ns + round(seconds * 1e9), self._now_ns
        while self._now_ns + TICK_NS <= end:
            if every is not None and self._now_ns >= due:
                due += round(period * 1e9)
                every()
            self._tick()

    def start(self, speed: float = 1.0) -> None:
        """Let its time run in a thread until `close`. `speed`: PX4's time over wall time; infinite: as fast as it goes.

        PX4's time stands still while the machine does not run the thread, and does not catch up afterwards.
        """
        if not speed > 0.0:
            raise ValueError(f"a speed of {speed}: PX4's time runs forwards")
        self._thread = threading.Thread(target=self._serve, args=(speed,), daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop and close the ports; may be called twice. Raises what went wrong in the thread."""
        self._ended.set()
        if self._thread is not None:
            self._thread.join()
        for wire in self._wires.values():
            wire.close()
        failure, self.failure = self.failure, None
        if failure is not None:
            raise failure

    def _serve(self, speed: float) -> None:
        try:
            if math.isinf(speed):
                self._race()
            else:
                self._keep_pace(speed)
        except Exception as error:  # `close` raises it, in the thread that can report it
            self.failure = error

    def _race(self) -> None:
        while not self._ended.is_set():
            for _ in range(_AT_ONCE):
                self._tick()
            time.sleep(0.0)

    def _keep_pace(self, speed: float) -> None:
        last, owed = time.monotonic_ns(), 0.0
        while not self._ended.wait(TICK_NS * 1e-9 / max(1.0, speed)):
            now = time.monotonic_ns()
            owed += speed * min(now - last, _STALL_NS)
            last = now
            while owed >= TICK_NS and not self._ended.is_set():
                owed -= TICK_NS
                self._tick()

    def _tick(self) -> None:
        with self._lock:
            self._now_ns += TICK_NS
            self._sim.step(self._now_ns)
