"""What a Crazyflie reports, decoded: estimate, battery, supervisor, console, on our clock."""

from __future__ import annotations

import math
import struct
from typing import NamedTuple

from vehicle.crazyflie.crtp import Info
from vehicle.px4.driver.types import Odometry

STATE_BLOCK, STATUS_BLOCK = 1, 2
STATE_MS, STATUS_MS = 10, 100
# Variables of a block, in order, each with the kind that it is sent as.
STATE = (
    *((f"stateEstimateZ.{name}", "int16") for name in ("x", "y", "z", "vx", "vy", "vz")),
    *((f"stateEstimate.{name}", "half") for name in ("qw", "qx", "qy", "qz")),
    *((f"stateEstimateZ.{name}", "int16") for name in ("rateRoll", "ratePitch", "rateYaw")),
)
STATUS = (
    ("pm.vbat", "float"),
    ("pm.state", "int8"),
    ("supervisor.info", "uint16"),
    ("stabilizer.thrust", "float"),
    *((f"kalman.var{name}", "float") for name in ("PX", "PY", "PZ")),
)
_STATE, _STATUS = struct.Struct("<6h4e3h"), struct.Struct("<fbHf3f")
_DAY_MS = 1 << 24  # its 24-bit milliseconds wrap
_FRESH_NS = 1_000_000_000


class Status(NamedTuple):
    """The slow block: V, pm.state, supervisor bits, thrust word, and the largest variance of the position (m^2)."""

    battery_v: float
    power: int
    info: int
    word: float
    variance: float

    def has(self, bit: Info) -> bool:
        return bool(self.info >> bit & 1)


class Device:
    """Keeps the newest reports. Its clock is ours less an offset, of which the least delayed packet tells."""

    def __init__(self, link_delay: float, clock_drift: float) -> None:
        """`link_delay` (s): the least that a packet takes; `clock_drift`: of its clock against ours."""
        self._delay_ns, self._drift = round(link_delay * 1e9), clock_drift
        self._last_ms = -1
        self._turns = 0
        self._offset: tuple[int, int] | None = None  # ns, and when it was last corrected
        self.odometry: Odometry | None = None
        self.fresh: list[Odometry] = []
        self.status: Status | None = None
        self.words: list[float] = []  # of thrust, since last cleared
        self.bad = 0  # reports that cannot be used
        self.rebooted = False
        self._heard_ns: int | None = None

    def begin(self) -> None:
        """A new step."""
        self.fresh, self.rebooted = [], False

    def connected(self, now_ns: int) -> bool:
        """True while its log data comes."""
        return self._heard_ns is not None and now_ns - self._heard_ns < _FRESH_NS

    def data(self, data: bytes, now_ns: int) -> None:
        """One packet of log data."""
        block, rest = data[0] if data else 0, data[4:]
        if block == STATE_BLOCK and len(rest) == _STATE.size:
            self._heard_ns = now_ns
            self._state(_STATE.unpack(rest), self._time(int.from_bytes(data[1:4], "little"), now_ns), now_ns)
        elif block == STATUS_BLOCK and len(rest) == _STATUS.size:
            self._heard_ns = now_ns
            volts, power, info, word, *variances = _STATUS.unpack(rest)
            if all(map(math.isfinite, (volts, word, *variances))):
                self.status = Status(volts, power, info, word, max(variances))
                self.words.append(word)
            else:
                self.bad += 1
        else:
            self.bad += 1

    def _time(self, ms: int, now_ns: int) -> int:
        """Our time (ns) of its `ms`, never later than now less the link's delay."""
        if self._last_ms >= 0 and ms < self._last_ms - _DAY_MS // 2:
            self._turns += 1
        elif self._last_ms >= 0 and ms < self._last_ms - 1000:
            self.rebooted, self._offset, self._turns = True, None, 0
        self._last_ms = ms
        theirs = (self._turns * _DAY_MS + ms) * 1_000_000
        found = now_ns - self._delay_ns - theirs
        if self._offset is not None:
            before, then = self._offset
            found = min(found, before + round((now_ns - then) * self._drift))
        self._offset = (found, now_ns)
        return theirs + found

    def _state(self, numbers: tuple[float, ...], stamp_ns: int, now_ns: int) -> None:
        x, y, z, vx, vy, vz, qw, qx, qy, qz, roll, pitch, yaw = numbers
        norm = math.sqrt(qw * qw + qx * qx + qy * qy + qz * qz)
        stamp_ns = min(stamp_ns, now_ns)
        if not 0.9 < norm < 1.1 or (self.odometry is not None and stamp_ns <= self.odometry.stamp_ns):
            self.bad += 1
            return
        milli = 1e-3
        self.odometry = Odometry(
            stamp_ns,
            (x * milli, y * milli, z * milli),
            (vx * milli, vy * milli, vz * milli),
            (qw / norm, qx / norm, qy / norm, qz / norm),
            (roll * milli, -pitch * milli, yaw * milli),
        )
        self.fresh.append(self.odometry)
