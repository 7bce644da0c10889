"""What all phases of the Crazyflie driver share: receiving, requests with retries, failure, report."""

from __future__ import annotations

import math
from typing import Protocol

from vehicle.crazyflie import commands
from vehicle.crazyflie.crtp import Info, Log, Packet, Parameters, Platform, Port, Version, pack, unpack
from vehicle.crazyflie.driver.device import Device, Status
from vehicle.crazyflie.driver.table_reader import TableReader
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.table import LOG_KINDS, PARAMETER_KINDS
from vehicle.px4.driver.arming import Arming, Identity
from vehicle.px4.driver.types import ExternalPose, LinkOutput, Note

SECOND = 1_000_000_000
KNOWN_VARIANCE = 1e-2  # m^2: the position is known
LOW_POWER = 3  # pm.state
_ALARMING = ("lock", "crash", "fall", "error", "warning", "fail")


class ByteWire(Protocol):
    """A datagram link: one CRTP packet each."""

    def send(self, data: bytes, /) -> object: ...
    def receive(self) -> list[bytes]: ...


class LinkCore:
    """Base of `CrazyflieLink`."""

    def __init__(self, wire: ByteWire, config: CrazyflieConfig) -> None:
        self._wire, self._config = wire, config
        self._device = Device(config.link_delay, config.clock_drift)
        self._log = TableReader(Port.LOG, LOG_KINDS)
        self._table = TableReader(Port.PARAMETERS, PARAMETER_KINDS)
        self.phase = "connect"
        self.refused = 0  # commands that were not sent: not finite, or not allowed in this phase
        self.identity: Identity | None = None
        self._values: dict[str, float] = {}
        self._answers: dict[tuple[int, int], list[bytes]] = {}
        self._now = self._since = 0
        self._asked: int | None = None
        self._tries = 0
        self._pose_ns = -SECOND
        self._notes: list[Note] = []
        self._console = ""
        self._arming: Arming | None = None
        self._was = (False, "")  # connected, mode
        self._alarms: set[str] = set()  # that were told, and last
        self._garbage = 0

    @property
    def armed(self) -> bool:
        """The supervisor's last report. One that arms itself counts as armed while it flies."""
        status = self._device.status
        if status is None:
            return False
        return status.has(Info.FLYING) or (status.has(Info.ARMED) and not status.has(Info.AUTO_ARMED))

    @property
    def status(self) -> Status | None:
        """Its last report on battery, supervisor and estimate."""
        return self._device.status

    @property
    def parameters(self) -> dict[str, float]:
        """Its parameters that matter here, as read before the flight."""
        return dict(self._values)

    @property
    def garbage(self) -> int:
        """Datagrams and reports that could not be used."""
        return self._garbage + self._device.bad

    @property
    def in_air(self) -> bool:
        """Whether the supervisor says that it flies."""
        return self._device.status is not None and self._device.status.has(Info.FLYING)

    # receiving

    def _receive(self, now_ns: int) -> None:
        self._now = now_ns
        self._answers = {}
        self._device.begin()
        for datagram in self._wire.receive():
            packet = unpack(datagram)
            if packet is None:
                self._garbage += 1
            elif not packet.null:
                self._packet(packet, now_ns)
        if self._device.rebooted and self.phase != "failed":
            self._fail("the Crazyflie has rebooted")

    def _packet(self, packet: Packet, now_ns: int) -> None:
        if packet.port == Port.LOG and packet.channel == Log.DATA:
            self._device.data(packet.data, now_ns)
        elif packet.port == Port.LOG and packet.channel == Log.TABLE:
            self._log.receive(packet.data)
        elif packet.port == Port.PARAMETERS and packet.channel == Parameters.TABLE:
            self._table.receive(packet.data)
        elif packet.port == Port.CONSOLE:
            self._print(packet.data.decode("latin-1"))
        else:
            self._answers.setdefault((packet.port, packet.channel), []).append(packet.data)

    def _print(self, text: str) -> None:
        *lines, self._console = (self._console + text).split("\n")
        for line in lines:
            if line.strip():
                alarming = any(word in line.lower() for word in _ALARMING)
                self._note("warning" if alarming else "info", f"Crazyflie: {line.strip()}")
        self._console = self._console[-200:]

    def _version(self, kind: Version) -> bytes | None:
        """The newest answer about a version in this step."""
        for data in reversed(self._answers.get((Port.PLATFORM, Platform.VERSION), [])):
            if data[:1] == bytes((kind,)):
                return data[1:]
        return None

    # sending

    def _send(self, packet: Packet) -> None:
        self._wire.send(pack(packet))

    def _pass_on(self, pose: ExternalPose | None) -> None:
        """Motion capture's pose to its estimator."""
        if pose is None or self.phase in ("connect", "parameters"):
            return
        due = pose.stamp_ns - self._pose_ns >= 0.95e9 / self._config.external_pose_hz
        if due and all(map(math.isfinite, (*pose.position, *pose.orientation))):
            self._pose_ns = pose.stamp_ns
            self._send(commands.external_pose(pose.position, pose.orientation))

    def _enter(self, phase: str) -> None:
        self.phase, self._since, self._tries, self._asked = phase, self._now, 0, None

    def _elapsed(self, seconds: float) -> bool:
        """True once the phase has lasted that long."""
        return self._now - self._since > seconds * SECOND

    def _ask(self, complaint: str) -> bool:
        """True if a request is to be sent (again); after `tries` of them the link fails with `complaint`, if given."""
        if self._asked is not None and self._now - self._asked < self._config.answer_limit * SECOND:
            return False
        if self._tries >= self._config.tries and complaint:
            self._fail(f"{complaint} after {self._tries} tries")
            return False
        self._tries += 1
        self._asked = self._now
        return True

    def _note(self, severity: str, text: str) -> None:
        self._notes.append(Note(severity, text))

    def _fail(self, why: str) -> None:
        self._enter("failed")
        self._note("error", why)

    # reporting

    def _alarm(self, sounds: bool, text: str) -> None:
        """A warning when it begins."""
        key = text.partition(":")[0]
        if sounds and key not in self._alarms:
            self._note("error", text)
        (self._alarms.add if sounds else self._alarms.discard)(key)

    def _mode(self) -> str:
        status = self._device.status
        if status is None:
            return "unknown"
        for bit, text in (
            (Info.LOCKED, "locked"),
            (Info.CRASHED, "crashed"),
            (Info.TUMBLED, "tumbled"),
            (Info.HIGH_LEVEL_ACTIVE, "high level"),
            (Info.FLYING, "flying"),
            (Info.CAN_FLY, "ready to fly"),
            (Info.CAN_BE_ARMED, "can be armed"),
        ):
            if status.has(bit):
                return text
        return "not ready"

    def _output(self, now_ns: int, sent: float | None, hover_thrust: float) -> LinkOutput:
        status, mode = self._device.status, self._mode()
        connected = self._device.connected(now_ns)
        was_connected, was_mode = self._was
        if was_connected and not connected:
            self._note("error", "link lost: no log data for 1 s")
        if connected and status is not None and self.armed:
            self._alarm(status.power == LOW_POWER, f"its battery is low: {status.battery_v:.2f} V")
            self._alarm(status.variance > KNOWN_VARIANCE, "it no longer knows where it is: no external pose comes")
        if mode != was_mode:
            self._note("error" if mode in ("locked", "crashed") else "info", f"supervisor: {mode}")
        self._was = (connected, mode)
        return LinkOutput(
            phase=self.phase,
            connected=connected,
            armed=self.armed,
            landed=not self.in_air,
            failsafe=mode in ("locked", "crashed"),
            mode=mode,
            battery_v=0.0 if status is None else status.battery_v,
            hover_thrust=hover_thrust,
            odometry=self._device.fresh,
            notes=self._notes,
            sent_thrust=sent,
        )
