"""The Crazyflie driver's phases on the ground: connect, parameters, streams, ready, verify, arm."""

from __future__ import annotations

import struct

from vehicle.crazyflie import commands
from vehicle.crazyflie.crtp import (
    PROTOCOL_VERSION,
    Info,
    Link,
    Log,
    LogControl,
    Packet,
    Parameters,
    Platform,
    Port,
    SupervisorCommand,
    Version,
)
from vehicle.crazyflie.driver.core import KNOWN_VARIANCE, ByteWire, LinkCore
from vehicle.crazyflie.driver.device import STATE, STATE_BLOCK, STATE_MS, STATUS, STATUS_BLOCK, STATUS_MS
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.table import LOG_KINDS, PARAMETER_KINDS
from vehicle.px4.driver.arming import Arming, Identity

# Set and read back before it is armed: Kalman filter and PID controller; and those that are only read.
SET = {"stabilizer.estimator": 2.0, "stabilizer.controller": 1.0, "stabilizer.stop": 0.0}
READ = ("supervisor.tmblChckEn", "supervisor.prefltTimeout", "supervisor.landedTimeout", "locSrv.extPosStdDev")

_GREETING = b"Bitcraze Crazyflie"
_BLOCKS = ((STATE_BLOCK, STATE, STATE_MS), (STATUS_BLOCK, STATUS, STATUS_MS))
_ENTRIES = 9  # of a block that one packet holds


class GroundPhases(LinkCore):
    """Each `_step_` does the work of its phase and enters the next one."""

    def __init__(self, wire: ByteWire, config: CrazyflieConfig) -> None:
        super().__init__(wire, config)
        self._greeted = False
        self._unset = dict(SET)
        self._unread = [*SET, *READ]
        self._requests: list[tuple[Packet, bytes]] = []  # of the streams: each with the answer that ends it
        self._ground_z = 0.0
        self._ours = False  # this driver armed it and may land it

    def allow_arming(self, arming: Arming) -> None:
        """Where the configuration has `arm = False`, it is armed and takes off only after this call, and only if it is
        and holds what `arming` says."""
        if not self._config.arm:
            self._arming = arming

    def refuse_arming(self) -> None:
        """Give up while waiting for `allow_arming`: phase failed."""
        if self.phase in ("connect", "parameters", "streams", "ready", "verify"):
            self._enter("failed")

    def _step_connect(self) -> None:
        for data in self._answers.get((Port.LINK, Link.SOURCE), []):
            self._greeted = self._greeted or data.startswith(_GREETING)
        protocol, firmware = self._version(Version.PROTOCOL), self._version(Version.FIRMWARE)
        if protocol is not None and protocol[:1] != bytes((PROTOCOL_VERSION,)):
            self._fail(
                f"the Crazyflie's firmware speaks CRTP version {protocol[0] if protocol else '?'}, this driver "
                f"{PROTOCOL_VERSION}: install firmware 2026.08 or the release that has version {PROTOCOL_VERSION}"
            )
            return
        if firmware is not None:
            self.identity = Identity("", firmware.rstrip(b"\0").decode("latin-1"))
            self._enter("parameters")
        elif self._ask(""):
            if self._tries % 25 == 0:
                self._note("warning", "no Crazyflie answers yet: is it on, and are channel, rate and address right?")
            if not self._greeted:
                self._send(Packet(Port.LINK, Link.SOURCE, b"\0"))
            else:
                self._send(Packet(Port.PLATFORM, Platform.VERSION, bytes((Version.PROTOCOL,))))
                self._send(Packet(Port.PLATFORM, Platform.VERSION, bytes((Version.FIRMWARE,))))
        elif self._greeted and self._tries == 1:
            self._asked = None

    def _step_parameters(self) -> None:
        for table, name in ((self._log, "log variables"), (self._table, "parameters")):
            if table.fault:
                self._fail(f"the Crazyflie's table of {name} cannot be used: {table.fault}")
                return
            if not table.done:
                for request in table.requests(self._now):
                    self._send(request)
                if self._elapsed(60.0):
                    self._fail(f"the Crazyflie's table of {name} was not read within 60 s")
                return
        missing = [name for name in (*SET, *READ) if name not in self._table.numbers]
        missing += [name for name, _ in (*STATE, *STATUS) if name not in self._log.numbers]
        if missing:
            self._fail(f"the Crazyflie's firmware has no {', '.join(missing)}")
            return
        self._take_values()
        if not self._unset and not self._unread:
            self._requests = [pair for block in _BLOCKS for pair in self._block_requests(*block)]
            reset = Packet(Port.LOG, Log.CONTROL, bytes((LogControl.RESET,)))
            self._requests.insert(0, (reset, bytes((LogControl.RESET,))))
            self._enter("streams")
        elif self._ask(f"{', '.join(self._unset or self._unread)} could not be set and read"):
            for name in self._unset:
                number, variable = self._table.numbers[name]
                value = struct.pack(PARAMETER_KINDS[variable.kind][1], int(SET[name]))
                self._send(Packet(Port.PARAMETERS, Parameters.WRITE, number.to_bytes(2, "little") + value))
            for name in self._unread if not self._unset else ():
                number = self._table.numbers[name][0].to_bytes(2, "little")
                self._send(Packet(Port.PARAMETERS, Parameters.READ, number))

    def _take_values(self) -> None:
        names = {number: (name, variable.kind) for name, (number, variable) in self._table.numbers.items()}
        for channel, head in ((Parameters.WRITE, 2), (Parameters.READ, 3)):
            for data in self._answers.get((Port.PARAMETERS, channel), []):
                name, kind = names.get(int.from_bytes(data[:2], "little"), ("", "uint8"))
                form = PARAMETER_KINDS[kind][1]
                if name not in (*SET, *READ) or len(data) != head + struct.calcsize(form):
                    continue
                (value,) = struct.unpack(form, data[head:])
                if channel == Parameters.WRITE and value == self._unset.get(name):
                    del self._unset[name]
                    self._asked = None
                elif channel == Parameters.READ and name in self._unread:
                    self._unread.remove(name)
                    self._values[name] = float(value)

    def _block_requests(self, block: int, names: tuple[tuple[str, str], ...], period_ms: int) -> list:
        entries = [struct.pack("<BH", LOG_KINDS[kind][0], self._log.numbers[name][0]) for name, kind in names]
        requests = []
        for at in range(0, len(entries), _ENTRIES):
            head = bytes((LogControl.APPEND if at else LogControl.CREATE, block))
            requests.append((Packet(Port.LOG, Log.CONTROL, head + b"".join(entries[at : at + _ENTRIES])), head))
        head = bytes((LogControl.START_MS, block))
        start = Packet(Port.LOG, Log.CONTROL, head + period_ms.to_bytes(2, "little"))
        return [*requests, (start, head)]

    def _step_streams(self) -> None:
        for data in self._answers.get((Port.LOG, Log.CONTROL), []):
            if self._requests and data.startswith(self._requests[0][1]) and len(data) > 2:
                if data[2]:
                    self._fail(f"the Crazyflie refuses a log block: error {data[2]}")
                    return
                self._requests.pop(0)
                self._tries, self._asked = 0, None
        if not self._requests:
            self._enter("ready")
        elif self._ask("a log block was not answered"):
            self._send(self._requests[0][0])

    def _not_ready(self) -> str:
        """Why it cannot be armed now; empty if it can."""
        status, device = self._device.status, self._device
        if status is None or device.odometry is None or not device.connected(self._now):
            return "no log data comes"
        if status.has(Info.LOCKED):
            return "it is locked: switch it off and on"
        if status.has(Info.CRASHED):
            return "it has crashed: put it upright and request recovery"
        if status.has(Info.TUMBLED):
            return "it is not upright"
        if status.variance > KNOWN_VARIANCE:
            return "it does not know where it is: no external pose reaches its estimator"
        if status.battery_v < self._config.least_battery:
            return f"its battery has {status.battery_v:.2f} V, {self._config.least_battery:g} V are needed"
        if not (status.has(Info.CAN_BE_ARMED) or status.has(Info.CAN_FLY)):
            return "its supervisor's checks do not pass"
        return ""

    def _step_ready(self) -> None:
        why = self._not_ready()
        if not why:
            self._since = self._now
            if self._arming is not None:
                self._enter("verify")
            elif self._config.arm:
                self._enter("arm")
        elif self._elapsed(self._config.ready_limit):
            self._fail(f"the Crazyflie is not ready after {self._config.ready_limit:g} s: {why}")

    def _step_verify(self) -> None:
        faults = (self._arming or Arming()).faults(self.identity or Identity(), self.parameters)
        if faults:
            self._fail(f"not armed, this is not as it was checked: {'; '.join(faults)}")
        else:
            self._note("info", f"Crazyflie, firmware {(self.identity or Identity()).firmware or 'unknown'}")
            self._enter("arm")

    def _step_arm(self) -> None:
        status, odometry = self._device.status, self._device.odometry
        if status is not None and status.has(Info.CAN_FLY) and odometry is not None:
            self._ours = True
            self._ground_z = odometry.position[2]
            self._enter("takeoff")
        elif self._ask("arming was refused"):
            self._send(commands.supervisor(SupervisorCommand.ARM, 1))
