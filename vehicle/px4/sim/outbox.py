"""What PX4 sends by itself: texts (in chunks) with their events, changed parameters, gimbal commands."""

from __future__ import annotations

import math

from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES as M
from vehicle.px4.protocol import Command as Cmd
from vehicle.px4.sim.motion_messages import gps_global_origin
from vehicle.px4.sim.port import Port
from vehicle.px4.sim.view import View

BOOT_PUSH_NS = 1_004_000_000
# Parameters that a SITL changes while booting and therefore sends on all links.
PUSHED_AT_BOOT = (
    *("CAL_ACC0_ID", "CAL_ACC1_ID", "CAL_ACC2_ID", "CAL_BARO0_ID", "CAL_BARO0_OFF", "CAL_BARO0_PRIO"),
    *("CAL_GYRO0_ID", "CAL_GYRO1_ID", "CAL_GYRO2_ID", "CAL_MAG0_ID", "CAL_MAG0_PRIO", "CAL_MAG1_ID", "CAL_MAG1_PRIO"),
    *("SENS_BOARD_X_OFF", "SENS_DPRES_OFF", "SYS_AUTOCONFIG", "SYS_AUTOSTART"),
)
BAROMETER_PUSH_NS = 5_300_000_000
PUSHED_LATER = ("CAL_BARO0_ID", "CAL_BARO0_OFF", "CAL_BARO0_PRIO")
GIMBAL_REPEATS_S = (0.0, 1.0, 1.5, 2.0)  # PX4 repeats a command that is not acknowledged


class Outbox:
    """Sends to all links."""

    def __init__(self, view: View, ports: dict[str, Port]) -> None:
        self._view, self._ports = view, ports
        self._text_id = 0
        self._pushed = 0
        self._mode = -1
        self._gimbal_since_ns = -1
        self._gimbal_sent = 0

    def text(self, severity: int, text: str, event: int | None = None, arguments: bytes = b"") -> None:
        """STATUSTEXT, in chunks of 50 characters that share an id; and an EVENT if PX4 has one for it."""
        id, self._text_id = self._text_id, (self._text_id + 1) & 0xFFFF
        for chunk in range(0, len(text), px4.STATUSTEXT_CHUNK):
            part = text[chunk : chunk + px4.STATUSTEXT_CHUNK]
            for port in self._ports.values():
                port.send(M["STATUSTEXT"], severity, part, id, chunk // px4.STATUSTEXT_CHUNK)
        if event is not None:
            self.event(event, severity, arguments)

    def event(self, id: int, severity: int, arguments: bytes = b"") -> None:
        """EVENT with the next sequence number."""
        view = self._view
        view.event_sequence += 1
        levels = (severity << 4 | severity) & 0xFF
        for port in self._ports.values():
            port.send(M["EVENT"], 0, 0, id, view.ms, view.event_sequence & 0xFFFF, levels, arguments.ljust(40, b"\0"))

    def update(self) -> None:
        """Run at the commander's rate."""
        flight = self._view.flight
        if self._pushed == 0 and flight.now_ns >= BOOT_PUSH_NS:
            self._pushed = 1
            self._push(PUSHED_AT_BOOT)
            for port in self._ports.values():
                gps_global_origin(self._view, port)
        elif self._pushed == 1 and flight.now_ns >= BAROMETER_PUSH_NS:
            self._pushed = 2
            self._push(PUSHED_LATER)
        if flight.active != self._mode:
            self._mode = flight.active
            self._gimbal_since_ns = flight.now_ns if flight.armed and flight.active in (px4.RTL, px4.LAND) else -1
            self._gimbal_sent = 0
        self._gimbal()

    def _push(self, names: tuple[str, ...]) -> None:
        p = self._view.flight.parameters
        for name in names:
            for port in self._ports.values():
                port.send_param(name, p.wire(name), p.kind(name), len(p), p.index(name))

    def _gimbal(self) -> None:
        """PX4's navigator takes and releases a gimbal that does not exist; a client must not take it for a peer."""
        if self._gimbal_since_ns < 0 or self._gimbal_sent >= len(GIMBAL_REPEATS_S):
            return
        since = (self._view.flight.now_ns - self._gimbal_since_ns) * 1e-9
        if since < 0.25 + GIMBAL_REPEATS_S[self._gimbal_sent]:
            return
        take = (1.0, 1.0, -1.0, -1.0, 0.0, 0.0, 0.0)
        self._command(Cmd.DO_GIMBAL_MANAGER_CONFIGURE, self._gimbal_sent, take)
        if self._gimbal_sent == 0:
            nan = math.nan
            self._command(Cmd.DO_GIMBAL_MANAGER_PITCHYAW, 0, (nan, nan, nan, nan, 2.0, 0.0, 0.0))
            self._command(Cmd.DO_GIMBAL_MANAGER_CONFIGURE, 0, (-3.0, -3.0, -1.0, -1.0, 0.0, 0.0, 0.0))
        self._gimbal_sent += 1

    def _command(self, number: int, confirmation: int, params: tuple[float, ...]) -> None:
        for port in self._ports.values():
            port.send(M["COMMAND_LONG"], px4.PX4_SYSTEM, 0, number, confirmation, *params)
