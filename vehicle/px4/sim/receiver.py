"""What the software PX4 does with a received frame: answer, store, queue for the commander, forward."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from kernel.rotations import yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.codec import Frame
from vehicle.px4.protocol import Command as Cmd
from vehicle.px4.protocol import Result
from vehicle.px4.sim.messages import GIT_HASH, autopilot_version, available_modes
from vehicle.px4.sim.motion_messages import gps_global_origin
from vehicle.px4.sim.params import HASH_NAME, NO_INDEX, UINT32, Parameters
from vehicle.px4.sim.port import Port
from vehicle.px4.sim.services.files import GENERAL, crc, metadata
from vehicle.px4.sim.services.ftp import Ftp
from vehicle.px4.sim.services.logs import Logs
from vehicle.px4.sim.services.missions import Missions
from vehicle.px4.sim.state import Command
from vehicle.px4.sim.view import View

TIMESYNC_GARBAGE = (32, 137)  # PX4 leaves the targets of its answers uninitialised
_HANDLED_HERE = (
    Cmd.SET_MESSAGE_INTERVAL,
    Cmd.GET_MESSAGE_INTERVAL,
    Cmd.REQUEST_MESSAGE,
    Cmd.REQUEST_PROTOCOL_VERSION,
    Cmd.REQUEST_AUTOPILOT_CAPABILITIES,
)
_NOT_ON_REQUEST = (436,)
INT_OF_NAN, NO_PLACE = 0x7FF80000, 0x7FFFFFFF  # COMMAND_INT.x and y


class Receiver:
    """Dispatches frames of all ports."""

    def __init__(self, view: View, ports: dict[str, Port], on_parameter: Callable[[], None]) -> None:
        self._view, self._ports, self._on_parameter = view, ports, on_parameter
        self._flight, self._commander = view.flight, view.commander
        self._echo: list[tuple[int, str]] = []  # (PX4 ns, parameter) still to be sent on all links
        self.timesync_offset_ns: int | None = None
        self.ignored = 0  # frames for other systems, or of messages that PX4 does not use
        self._handlers: dict[str, Callable[[Port, Frame, Any], None]] = {
            "SET_ATTITUDE_TARGET": self._attitude_target,
            "SET_POSITION_TARGET_LOCAL_NED": self._position_target,
            "COMMAND_LONG": self._command_long,
            "COMMAND_INT": self._command_int,
            "SET_MODE": self._set_mode,
            "TIMESYNC": self._timesync,
            "PING": self._ping,
            "PARAM_REQUEST_LIST": self._param_list,
            "PARAM_REQUEST_READ": self._param_read,
            "PARAM_SET": self._param_set,
            "ODOMETRY": self._odometry,
            "VISION_POSITION_ESTIMATE": self._vision,
            "MANUAL_CONTROL": self._manual_control,
        }
        flight = self._flight
        defaults = dict(flight.parameters.values)
        self._files = cache(lambda: metadata(defaults.items()))
        self._missions = Missions(flight.plan, lambda: flight.now_ns, lambda *text: flight.text(*text), ports.values())
        self._ftp = Ftp(self._files)
        self._handlers |= self._missions.handlers | self._ftp.handlers | Logs().handlers

    @property
    def _parameters(self) -> Parameters:
        return self._flight.parameters

    def handle(self, port: Port, frame: Frame) -> None:
        """One frame from `port`."""
        fields = frame.fields
        target = getattr(fields, "target_system", 0)
        if frame.system != px4.PX4_SYSTEM and target != px4.PX4_SYSTEM:
            self._forward(port, frame, target)
        handler = self._handlers.get(frame.name)
        if handler is None or target not in (0, px4.PX4_SYSTEM):
            self.ignored += 1
            return
        if getattr(fields, "target_component", 0) not in (0, px4.PX4_COMPONENT) and frame.name != "TIMESYNC":
            self.ignored += 1
            return
        handler(port, frame, fields)

    def _forward(self, port: Port, frame: Frame, target: int) -> None:
        """Broadcasts and frames for other systems are forwarded on the other links, unchanged."""
        if frame.name == "TIMESYNC" or frame.name == "PING":
            return
        for other in self._ports.values():
            if other is not port:
                other.send_raw(frame.raw)

    def update(self) -> None:
        """Send changed parameters on all links, some ms after the change; go on with transfers."""
        self._missions.update()
        self._ftp.update()
        while self._echo and self._echo[0][0] <= self._flight.now_ns:
            _, name = self._echo.pop(0)
            for port in self._ports.values():
                self._param_value(port, name)

    # -- set-points and vision ------------------------------------------------------------------------------------

    def _attitude_target(self, port: Port, frame: Frame, m: Any) -> None:
        self._commander.offboard.attitude_target(m)

    def _position_target(self, port: Port, frame: Frame, m: Any) -> None:
        self._commander.offboard.position_target(m)

    def _odometry(self, port: Port, frame: Frame, m: Any) -> None:
        if m.estimator_type not in (0, px4.ESTIMATOR_VISION, px4.ESTIMATOR_VIO):
            if m.estimator_type != 6:  # motion capture: a topic of its own, which EKF2 does not fuse
                self._flight.text(2, f"ODOMETRY: estimator_type {m.estimator_type} unsupported\t")
            return
        if m.frame_id not in (px4.FRAME_LOCAL_NED, px4.FRAME_LOCAL_FRD) or not all(map(math.isfinite, (m.x, m.y, m.z))):
            self.ignored += 1
            return
        aligned = m.frame_id == px4.FRAME_LOCAL_NED
        heading = yaw(m.q) if all(map(math.isfinite, m.q)) else 0.0
        self._view.estimator.vision((m.x, m.y, m.z), heading, aligned and any(m.q))

    def _vision(self, port: Port, frame: Frame, m: Any) -> None:
        if not all(map(math.isfinite, (m.x, m.y, m.z, m.yaw))):
            self.ignored += 1
            return
        self._view.estimator.vision((m.x, m.y, m.z), m.yaw, True)

    def _manual_control(self, port: Port, frame: Frame, m: Any) -> None:
        if m.target in (0, px4.PX4_SYSTEM):
            self._commander.manual.receive(m)

    # -- commands -------------------------------------------------------------------------------------------------

    def _command_long(self, port: Port, frame: Frame, m: Any) -> None:
        self._command(port, frame, m.command, tuple(m[i] for i in range(len(m) - 7, len(m))))

    def _command_int(self, port: Port, frame: Frame, m: Any) -> None:
        if m.x == m.y == INT_OF_NAN:  # a NaN that was sent as an integer
            self.acknowledge(Command(port.name, frame.system, frame.component, m.command, ()), Result.DENIED)
            return
        place = (math.nan, math.nan) if m.x == m.y == NO_PLACE else (m.x / 1e7, m.y / 1e7)
        self._command(port, frame, m.command, (m.param1, m.param2, m.param3, m.param4, *place, m.z))

    def _command(self, port: Port, frame: Frame, number: int, params: tuple[float, ...]) -> None:
        command = Command(port.name, frame.system, frame.component, number, params)
        if number in _HANDLED_HERE:
            self.acknowledge(command, self._at_once(port, number, params))
            return
        if number == Cmd.DO_SET_MODE:
            self.acknowledge(command, Result.ACCEPTED)  # the receiver's own; the commander's result follows
        self._commander.queue.append(command)

    def _set_mode(self, port: Port, frame: Frame, m: Any) -> None:
        main, sub = px4.split_custom_mode(m.custom_mode)
        params = (float(m.base_mode or 1), float(main), float(sub), 0.0, 0.0, 0.0, 0.0)
        self._commander.queue.append(Command(port.name, frame.system, frame.component, Cmd.DO_SET_MODE, params))

    def acknowledge(self, command: Command, result: int) -> None:
        """COMMAND_ACK to the command's sender."""
        port = self._ports[command.port]
        port.send(M["COMMAND_ACK"], command.number, int(result), 0, 0, command.system, command.component)

    def _at_once(self, port: Port, number: int, params: tuple[float, ...]) -> int:
        if number == Cmd.REQUEST_PROTOCOL_VERSION:
            return self._request(port, 300)
        if number == Cmd.REQUEST_AUTOPILOT_CAPABILITIES:
            return self._request(port, 148)
        id = int(params[0]) if math.isfinite(params[0]) else -1
        if number == Cmd.REQUEST_MESSAGE:
            return self._request(port, id)
        stream = port.streams.get(id)
        if number == Cmd.GET_MESSAGE_INTERVAL:
            interval = -1 if stream is None or not stream.interval_ns else min(0x7FFFFFFF, stream.interval_ns // 1000)
            port.send(M["MESSAGE_INTERVAL"], max(0, min(65535, id)), interval)
            return Result.ACCEPTED
        if stream is None or id == 0 or not math.isfinite(params[1]):
            return Result.FAILED
        stream.set_interval(params[1], self._flight.now_ns)
        port.reschedule()
        return Result.ACCEPTED

    def _request(self, port: Port, id: int) -> int:
        flight = self._flight
        if id == 148:
            autopilot_version(port)
        elif id == 300:
            port.send(M["PROTOCOL_VERSION"], 200, 100, 203, GIT_HASH, (0,) * 8)
        elif id == 397:
            general = self._files()[GENERAL]
            port.send_name("COMPONENT_METADATA", self._view.ms, crc(general), f"mftp://{GENERAL}")
        elif id == 435:
            available_modes(port)
        elif id == 264:
            port.send_name("FLIGHT_INFORMATION", self._view.ms, 0, 0, 1, 0)
        elif id == 49:
            gps_global_origin(self._view, port)
        elif id == 242 and flight.home is None:
            return Result.DENIED
        else:
            stream = port.streams.get(id)
            if stream is None or id in _NOT_ON_REQUEST:
                return Result.DENIED
            stream.build(self._view, port)
        return Result.ACCEPTED

    # -- time -----------------------------------------------------------------------------------------------------

    def _timesync(self, port: Port, frame: Frame, m: Any) -> None:
        now = self._flight.now_ns
        if m.tc1 == 0:
            port.send(M["TIMESYNC"], now, m.ts1, *TIMESYNC_GARBAGE)
        elif m.ts1 <= now:
            self.timesync_offset_ns = m.tc1 - (m.ts1 + now) // 2

    def _ping(self, port: Port, frame: Frame, m: Any) -> None:
        if m.target_system == 0 and m.target_component == 0:
            port.send(M["PING"], m.time_usec, m.seq, frame.system, frame.component)

    # -- parameters -----------------------------------------------------------------------------------------------

    def _param_value(self, port: Port, name: str) -> None:
        p = self._parameters
        port.send_param(name, p.wire(name), p.kind(name), len(p), p.index(name))

    def _param_list(self, port: Port, frame: Frame, m: Any) -> None:
        p = self._parameters
        port.send_param(HASH_NAME, p.hash().to_bytes(4, "little"), UINT32, len(p), NO_INDEX)
        port.queue_params(list(p.names))

    def _param_read(self, port: Port, frame: Frame, m: Any) -> None:
        p = self._parameters
        name = m.param_id
        if m.param_index >= 0:
            if m.param_index >= len(p):
                return
            name = p.names[m.param_index]
        if name == HASH_NAME:
            port.send_param(HASH_NAME, p.hash().to_bytes(4, "little"), UINT32, len(p), NO_INDEX)
        elif name in p.values:
            self._param_value(port, name)

    def _param_set(self, port: Port, frame: Frame, m: Any) -> None:
        four = frame.payload[:4].ljust(4, b"\0")
        changed = self._parameters.set_wire(m.param_id, m.param_type, four)
        if changed is None:
            return
        self._param_value(port, m.param_id)
        if changed:
            self._on_parameter()
            self._echo.append((self._flight.now_ns + 10_000_000, m.param_id))

    def next_parameters(self) -> None:
        """Send what is left of a PARAM_REQUEST_LIST, a few each tick (888 take 0.83 s)."""
        for port in self._ports.values():
            for name in port.take_params():
                self._param_value(port, name)
