"""A pilot's sticks by MANUAL_CONTROL: Position and Altitude mode.

Speeds and turn rate are proportional to the sticks outside their dead zone, within PX4's limits; PX4's exponential
curves and its limits of jerk are left out.
"""

from __future__ import annotations

import math
from typing import Any

from kernel.rotations import yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.rows import control
from vehicle.px4.sim.state import Flight
from vehicle.px4.sim.takeoff import TakeOff
from vehicle.quadrotor.airframe import GRAVITY

_FULL = 1000.0  # a stick at its end


class Manual:
    """Keeps the newest sticks, and writes set-points into the control row while a mode of them runs."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._sticks = (0.0, 0.0, 0.0, 0.0)  # forward, right, up, turn to the right: -1..1
        self._last_ns = -1
        self._held: list[float] = [math.nan] * 3  # m, world: where it holds its place, height
        self._heading = math.nan
        self._takeoff = TakeOff(flight)

    @property
    def fresh(self) -> bool:
        """Whether sticks have come within COM_RC_LOSS_T."""
        limit_ns = self._flight.parameters["COM_RC_LOSS_T"] * 1e9
        return self._last_ns >= 0 and self._flight.now_ns - self._last_ns <= limit_ns

    @property
    def above_centre(self) -> bool:
        """Whether the throttle stick asks for a climb; PX4 is then not armed in these modes."""
        return self._shaped()[2] > 0.0

    def receive(self, m: Any) -> None:
        """MANUAL_CONTROL; a stick outside its range keeps its last value, as on PX4."""
        read = ((m.x, -1000), (m.y, -1000), (m.z, 0), (m.r, -1000))
        good = [least <= value <= 1000 for value, least in read]
        scaled = (m.x / _FULL, m.y / _FULL, m.z / (_FULL / 2) - 1.0, m.r / _FULL)
        forward, right, up, turn = (new if ok else old for new, ok, old in zip(scaled, good, self._sticks, strict=True))
        self._sticks, self._last_ns = (forward, right, up, turn), self._flight.now_ns

    def enter(self) -> None:
        """A mode of sticks has just become active."""
        flight, c = self._flight, self._flight.control
        if c[control.MODE] != control.POSITION:
            reset_cascade(c, flight.estimate)
        c[control.POS_SP : control.YAW_RATE_SP + 1] = math.nan
        self._held, self._heading = [math.nan] * 3, math.nan
        self._takeoff.reset()

    def update(self) -> None:
        """Refresh the set-points."""
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        if not flight.armed:
            c[control.MODE] = control.OFF
            return
        if c[control.MODE] != control.POSITION:
            reset_cascade(c, flight.estimate)
        forward, right, up, turn = self._shaped()
        c[control.SMOOTH], c[control.MAX_TILT] = 1.0, math.radians(p["MPC_TILTMAX_AIR"])
        c[control.MAX_XY], c[control.MAX_UP] = p["MPC_VEL_MANUAL"], p["MPC_Z_VEL_MAX_UP"]
        c[control.MAX_DOWN] = p["MPC_Z_VEL_MAX_DN"]
        c[control.POS_SP : control.YAW_RATE_SP + 1] = math.nan
        self._turn(turn)
        if flight.active == px4.POSCTL:
            speed = float(p["MPC_VEL_MANUAL"])
            self._move(*self._in_world(forward * speed, right * speed))
        else:
            push = GRAVITY * math.tan(math.radians(p["MPC_MAN_TILT_MAX"]))
            c[control.ACC_SP : control.ACC_SP + 2] = self._in_world(forward * push, right * push)
        self._climb(up * float(p["MPC_Z_VEL_MAX_UP" if up > 0.0 else "MPC_Z_VEL_MAX_DN"]))
        self._takeoff.apply(wants_up=up > 0.0)

    def _shaped(self) -> tuple[float, float, float, float]:
        if not self.fresh:
            return 0.0, 0.0, 0.0, 0.0
        dead = float(self._flight.parameters["MAN_DEADZONE"])
        forward, right, up, turn = (
            math.copysign(max(0.0, abs(v) - dead) / (1.0 - dead) if dead < 1.0 else 0.0, v) for v in self._sticks
        )
        return forward, right, up, turn

    def _in_world(self, forward: float, right: float) -> tuple[float, float]:
        heading = yaw(self._flight.attitude)
        along, across = math.cos(heading), math.sin(heading)
        return along * forward + across * right, across * forward - along * right

    def _turn(self, turn: float) -> None:
        c = self._flight.control
        if turn != 0.0:
            self._heading = math.nan
            c[control.YAW_RATE_SP] = -turn * math.radians(self._flight.parameters["MPC_MAN_Y_MAX"])
            return
        if math.isnan(self._heading):
            self._heading = yaw(self._flight.attitude)
        c[control.YAW_SP] = self._heading

    def _move(self, vx: float, vy: float) -> None:
        """Fly at that velocity; without one hold the place, once it is slow enough."""
        flight, c = self._flight, self._flight.control
        slow = math.hypot(*flight.velocity[:2]) < flight.parameters["MPC_HOLD_MAX_XY"]
        if vx != 0.0 or vy != 0.0:
            self._held[:2] = [math.nan] * 2
        elif math.isnan(self._held[0]) and slow:
            self._held[:2] = flight.position[:2]
        c[control.POS_SP : control.POS_SP + 2] = self._held[:2]
        c[control.VEL_SP : control.VEL_SP + 2] = vx, vy

    def _climb(self, speed: float) -> None:
        flight, c = self._flight, self._flight.control
        if speed != 0.0:
            self._held[2] = math.nan
        elif math.isnan(self._held[2]) and abs(flight.velocity[2]) < flight.parameters["MPC_HOLD_MAX_Z"]:
            self._held[2] = flight.position[2]
        c[control.POS_SP + 2], c[control.VEL_SP + 2] = self._held[2], speed
