"""What the software Crazyflie makes of a packet, port by port, and what it answers."""

from __future__ import annotations

from vehicle.crazyflie import commands
from vehicle.crazyflie.crtp import (
    ANSWER,
    MOST_DATA,
    STATE_BITFIELD,
    Link,
    Packet,
    Platform,
    Port,
    SupervisorChannel,
    SupervisorCommand,
    Version,
)
from vehicle.crazyflie.sim.log import LogService
from vehicle.crazyflie.sim.parameters import ParameterService
from vehicle.crazyflie.sim.state import Flight

FIRMWARE = "2026.08"
DEVICE = "Crazyflie 2.1"
_SOURCE = b"Bitcraze Crazyflie".ljust(MOST_DATA, b"\0")


class Receiver:
    """All of the firmware's services but the sending of log data and console texts."""

    def __init__(self, flight: Flight, log: LogService, protocol_version: int) -> None:
        self._flight, self._log, self._version = flight, log, protocol_version
        self._parameters = ParameterService(self._parameter_changed)
        self.ignored = 0  # packets that are malformed, or ask for what is not simulated here

    def handle(self, packet: Packet) -> Packet | None:
        """What one packet does, and its answer."""
        if packet.null:
            return packet  # a client that looks for a Crazyflie here
        if packet.port == Port.LINK:
            return packet if packet.channel == Link.ECHO else self._source(packet)
        if packet.port == Port.PLATFORM:
            return self._platform(packet)
        if packet.port == Port.LOG:
            return self._log.handle(self._flight.now_ns, packet)
        if packet.port == Port.PARAMETERS:
            return self._parameters.handle(packet)
        if packet.port == Port.MEMORY:
            return Packet(Port.MEMORY, packet.channel, b"\x01\x00") if packet.data[:1] == b"\x01" else None
        if packet.port == Port.SUPERVISOR:
            return self._supervise(packet)
        if packet.port == Port.HIGH_LEVEL:
            return self._high_level(packet)
        self._setpoint(packet)
        return None

    def _source(self, packet: Packet) -> Packet | None:
        return Packet(Port.LINK, Link.SOURCE, _SOURCE) if packet.channel == Link.SOURCE else None

    def _platform(self, packet: Packet) -> Packet | None:
        if packet.channel == Platform.VERSION and packet.data:
            answers = {
                Version.PROTOCOL: self._version.to_bytes(4, "little"),
                Version.FIRMWARE: FIRMWARE.encode(),
                Version.DEVICE: DEVICE.encode(),
            }
            answer = answers.get(Version(packet.data[0])) if packet.data[0] in Version.__members__.values() else None
            return None if answer is None else Packet(Port.PLATFORM, Platform.VERSION, packet.data[:1] + answer)
        if packet.channel == Platform.COMMAND and packet.data[:1] == bytes((SupervisorCommand.ARM,)):
            done = self._flight.supervisor.request_arming(packet.data[1:2] not in (b"", b"\0"))
            return Packet(
                Port.PLATFORM, Platform.COMMAND, bytes((SupervisorCommand.ARM, done, self._flight.supervisor.armed))
            )
        return None

    def _supervise(self, packet: Packet) -> Packet | None:
        command = packet.data[0] if packet.data else 0
        if packet.channel == SupervisorChannel.INFO:
            answer = self._flight.info.to_bytes(2, "little")
            if 1 <= command < STATE_BITFIELD:
                answer = bytes((self._flight.info >> (command - 1) & 1,))
            elif command != STATE_BITFIELD:
                return None
            return Packet(Port.SUPERVISOR, SupervisorChannel.INFO, bytes((ANSWER | command,)) + answer)
        if command == SupervisorCommand.EMERGENCY_STOP:
            self._flight.supervisor.emergency_stop()
        elif command == SupervisorCommand.EMERGENCY_STOP_WATCHDOG:
            self._flight.supervisor.feed_emergency_watchdog(self._flight.now_ns)
        elif command == SupervisorCommand.ARM and len(packet.data) > 1:
            done = self._flight.supervisor.request_arming(packet.data[1] != 0)
            return Packet(packet.port, packet.channel, bytes((ANSWER | command, done, self._flight.supervisor.armed)))
        elif command == SupervisorCommand.RECOVER:
            done = self._flight.supervisor.request_recovery()
            return Packet(
                packet.port, packet.channel, bytes((ANSWER | command, done, not self._flight.supervisor.crashed))
            )
        return None

    def _high_level(self, packet: Packet) -> Packet | None:
        command = commands.read_high_level(packet.data)
        if command is None:
            self.ignored += 1
            return None
        result = self._flight.commander.high_level.command(
            self._flight.now_ns, command, self._flight.supervisor.can_fly
        )
        return Packet(Port.HIGH_LEVEL, packet.channel, packet.data[:3].ljust(3, b"\0") + bytes((result,)))

    def _setpoint(self, packet: Packet) -> None:
        if packet.port == Port.SETPOINT and packet.channel == 0:
            values = self._parameters.values
            modes = tuple(values[f"flightmode.stabMode{axis}"] == 0.0 for axis in ("Roll", "Pitch", "Yaw"))
            setpoint = commands.read_legacy(packet.data, (modes[0], modes[1], modes[2]))
            if setpoint is not None:
                self._flight.commander.legacy(self._flight.now_ns, setpoint)
                return
        elif packet.port == Port.SETPOINT_GENERIC and packet.channel == 0:
            setpoint = commands.read_generic(packet.data)
            if setpoint is not None:
                self._flight.commander.take(self._flight.now_ns, setpoint)
                return
        elif packet.port == Port.SETPOINT_GENERIC and packet.data[:1] == b"\0":
            self._flight.commander.relax(self._flight.position, self._flight.heading)
            return
        elif packet.port == Port.LOCALIZATION and self._localization(packet):
            return
        self.ignored += 1

    def _localization(self, packet: Packet) -> bool:
        if packet.channel == commands.LOCALIZATION_CHANNEL and len(packet.data) == 1:
            if packet.data[0] == commands.OLD_EMERGENCY_STOP:
                self._flight.supervisor.emergency_stop()
                return True
            if packet.data[0] == commands.OLD_EMERGENCY_STOP_WATCHDOG:
                self._flight.supervisor.feed_emergency_watchdog(self._flight.now_ns)
                return True
        pose = commands.read_external(packet)
        if pose is None:
            return False
        self._flight.take_pose(*pose)
        return True

    def _parameter_changed(self, name: str) -> None:
        supervisor, values = self._flight.supervisor, self._parameters.values
        supervisor.stop_parameter = values["stabilizer.stop"] != 0.0
        supervisor.tumble_check = values["supervisor.tmblChckEn"] != 0.0
        supervisor.preflight_timeout_ns = round(values["supervisor.prefltTimeout"]) * 1_000_000
        supervisor.landed_timeout_ns = round(values["supervisor.landedTimeout"]) * 1_000_000
        if name == "kalman.resetEstimation" and values[name] != 0.0:
            self._flight.estimator.forget()
