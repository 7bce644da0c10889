"""OFFBOARD set-points: which messages count, what they mean in ENU/FLU, and how they reach the control row."""

from __future__ import annotations

import math
from typing import Any

from kernel.rotations import normalise, swap_attitude, swap_yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import AttitudeMask, PositionMask
from vehicle.px4.sim.control import (
    ACC_SP,
    ATT_SP,
    ATTITUDE,
    MAX_DOWN,
    MAX_TILT,
    MAX_UP,
    MAX_XY,
    MODE,
    OFF,
    POS_SP,
    POSITION,
    RAMP,
    RATE_SP,
    RATES,
    SMOOTH,
    THRUST_SP,
    VEL_SP,
    YAW_RATE_SP,
    YAW_SP,
    reset_cascade,
)
from vehicle.px4.sim.navigator import spooled_up, takeoff_ramp
from vehicle.px4.sim.state import Flight


class Offboard:
    """Keeps the newest set-point and writes it to the control row while OFFBOARD runs."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._values: tuple[Any, ...] = ()
        self._ramp_ns = -1
        self.rejected = 0  # set-points that do not count, or are not finite where they must be

    def attitude_target(self, m: Any) -> None:
        """SET_ATTITUDE_TARGET, addressed to us."""
        mask = m.type_mask
        thrust = 0.0 if mask & AttitudeMask.THROTTLE else m.thrust
        yaw_rate = math.nan if mask & AttitudeMask.YAW_RATE else -m.body_yaw_rate
        if px4.counts_as_rates(mask):
            if not math.isfinite(thrust) or math.isinf(m.body_roll_rate + m.body_pitch_rate + m.body_yaw_rate):
                self.rejected += 1
                return
            self._heard("rates", ((m.body_roll_rate, -m.body_pitch_rate, yaw_rate), thrust))
        elif px4.counts_as_attitude(mask):
            if not all(map(math.isfinite, (*m.q, thrust))):
                self.rejected += 1
                return
            attitude = swap_attitude(normalise(m.q))
            self._heard("attitude", (attitude, thrust, yaw_rate if math.isfinite(yaw_rate) else math.nan))
        else:
            self.rejected += 1

    def position_target(self, m: Any) -> None:
        """SET_POSITION_TARGET_LOCAL_NED, addressed to us; only LOCAL_NED counts, ignored fields become NaN."""
        mask = m.type_mask
        if m.coordinate_frame != px4.FRAME_LOCAL_NED or not px4.counts_as_position(mask) or mask & PositionMask.FORCE:
            self.rejected += 1
            return

        def pick(bits: int, x: float, y: float, z: float) -> tuple[float, float, float]:
            lowest = bits & -bits
            given = [math.nan if mask & lowest << i else v for i, v in enumerate((x, y, z))]
            return given[1], given[0], -given[2]

        ox, oy, oz = self._flight.origin
        east, north, up = pick(PositionMask.POSITION, m.x, m.y, m.z)
        velocity = pick(PositionMask.VELOCITY, m.vx, m.vy, m.vz)
        acceleration = pick(PositionMask.ACCELERATION, m.afx, m.afy, m.afz)
        position = (east + ox, north + oy, up + oz)
        heading = math.nan if mask & PositionMask.YAW or not math.isfinite(m.yaw) else swap_yaw(m.yaw)
        rate = math.nan if mask & PositionMask.YAW_RATE else -m.yaw_rate
        if any(map(math.isinf, (*position, *velocity, *acceleration))):
            self.rejected += 1
            return
        self._heard("position", (position, velocity, acceleration, heading, rate))

    def _heard(self, kind: str, values: tuple[Any, ...]) -> None:
        flight, setpoint = self._flight, self._flight.setpoint
        limit = flight.parameters["COM_OF_LOSS_T"] * 1e9
        if setpoint.last_ns < 0 or flight.now_ns - setpoint.last_ns > limit:
            setpoint.running_since_ns = flight.now_ns
        setpoint.kind, setpoint.last_ns = kind, flight.now_ns
        self._values = values
        if flight.active == px4.OFFBOARD:
            self.apply()

    def enter(self) -> None:
        """OFFBOARD has just become active."""
        c = self._flight.control
        c[MODE], c[RAMP], c[SMOOTH] = OFF, math.inf, 0.0
        c[POS_SP : YAW_RATE_SP + 1] = math.nan
        self._ramp_ns = -1

    def apply(self) -> None:
        """Write the newest set-point, if any, into the control row."""
        flight, c = self._flight, self._flight.control
        if not self._values or not flight.armed:
            c[MODE] = OFF
            return
        kind = flight.setpoint.kind
        if kind == "rates":
            (c[RATE_SP], c[RATE_SP + 1], c[RATE_SP + 2]), c[THRUST_SP] = self._values
            c[MODE] = RATES
        elif kind == "attitude":
            (c[ATT_SP], c[ATT_SP + 1], c[ATT_SP + 2], c[ATT_SP + 3]), c[THRUST_SP], c[YAW_RATE_SP] = self._values
            c[MODE] = ATTITUDE
        else:
            self._apply_position()

    def _apply_position(self) -> None:
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        if c[MODE] != POSITION:
            reset_cascade(c, flight.estimate)
        position, velocity, acceleration, c[YAW_SP], c[YAW_RATE_SP] = self._values
        c[POS_SP : POS_SP + 3], c[VEL_SP : VEL_SP + 3], c[ACC_SP : ACC_SP + 3] = position, velocity, acceleration
        c[MAX_XY], c[MAX_TILT] = p["MPC_XY_VEL_MAX"], math.radians(p["MPC_TILTMAX_AIR"])
        c[MAX_UP], c[MAX_DOWN], c[SMOOTH] = p["MPC_Z_VEL_MAX_UP"], p["MPC_Z_VEL_MAX_DN"], 0.0
        c[RAMP], c[MODE] = math.inf, POSITION
        if not flight.took_off and self._ramp_ns < 0:
            if not spooled_up(flight):
                c[MODE] = OFF
                return
            self._ramp_ns = flight.now_ns
        if self._ramp_ns >= 0:
            c[RAMP] = takeoff_ramp(flight, self._ramp_ns)
            if flight.now_ns - self._ramp_ns > p["MPC_TKO_RAMP_T"] * 1e9:
                c[RAMP] = math.inf
                self._ramp_ns = -1 if flight.took_off else self._ramp_ns
