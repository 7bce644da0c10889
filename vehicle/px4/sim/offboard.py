"""OFFBOARD set-points: which messages PX4 accepts, their conversion to ENU/FLU, and the control row."""

from __future__ import annotations

import math
from typing import Any

from kernel.rotations import from_euler, normalise, rotate, swap_attitude, swap_body, swap_yaw, yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import AttitudeMask, PositionMask
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.rows import control
from vehicle.px4.sim.state import Flight
from vehicle.px4.sim.takeoff import TakeOff

Vec3 = tuple[float, float, float]


class Offboard:
    """Keeps the newest set-point and writes it to the control row while OFFBOARD runs."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._values: tuple[Any, ...] = ()
        self._takeoff = TakeOff(flight)
        self.rejected = 0  # set-points with a mask or frame that PX4 ignores, or that are not finite

    def attitude_target(self, m: Any) -> None:
        """SET_ATTITUDE_TARGET, addressed to this autopilot."""
        mask = m.type_mask
        thrust = 0.0 if mask & AttitudeMask.THROTTLE else m.thrust
        yaw_rate = math.nan if mask & AttitudeMask.YAW_RATE else -m.body_yaw_rate
        if px4.counts_as_rates(mask):
            if not math.isfinite(thrust) or math.isinf(m.body_roll_rate + m.body_pitch_rate + m.body_yaw_rate):
                self.rejected += 1
                return
            self._store("rates", ((m.body_roll_rate, -m.body_pitch_rate, yaw_rate), thrust))
        elif px4.counts_as_attitude(mask):
            if not all(map(math.isfinite, (*m.q, thrust))):
                self.rejected += 1
                return
            attitude = swap_attitude(normalise(m.q))
            self._store("attitude", (attitude, thrust, yaw_rate if math.isfinite(yaw_rate) else math.nan))
        else:
            self.rejected += 1

    def position_target(self, m: Any) -> None:
        """SET_POSITION_TARGET_LOCAL_NED, addressed to this autopilot; ignored fields become NaN.

        In the frame BODY_NED PX4 takes velocity and acceleration, each whole or not at all, and turns them by the
        heading (it turns the acceleration by the whole attitude).
        """
        mask = m.type_mask
        body = m.coordinate_frame == px4.FRAME_BODY_NED
        if not body and m.coordinate_frame != px4.FRAME_LOCAL_NED:
            self._refuse(f"SET_POSITION_TARGET_LOCAL_NED coordinate frame {m.coordinate_frame} unsupported\t")
            return
        if body:
            mask |= PositionMask.POSITION
            for group in (PositionMask.VELOCITY, PositionMask.ACCELERATION):
                mask |= group if mask & group else 0
        if not px4.counts_as_position(mask):
            self._refuse("SET_POSITION_TARGET_LOCAL_NED invalid\t")
            return
        if mask & PositionMask.FORCE and mask & PositionMask.ACCELERATION != PositionMask.ACCELERATION:
            self._refuse("SET_POSITION_TARGET_LOCAL_NED force not supported\t")
            return

        def pick(bits: int, x: float, y: float, z: float) -> tuple[float, float, float]:
            lowest = bits & -bits
            given = [math.nan if mask & lowest << i else v for i, v in enumerate((x, y, z))]
            return given[1], given[0], -given[2]

        ox, oy, oz = self._flight.origin
        east, north, up = pick(PositionMask.POSITION, m.x, m.y, m.z)
        velocity = pick(PositionMask.VELOCITY, m.vx, m.vy, m.vz)
        acceleration = pick(PositionMask.ACCELERATION, m.afx, m.afy, m.afz)
        if body:
            velocity, acceleration = self._from_body(m, velocity, acceleration)
        position = (east + ox, north + oy, up + oz)
        heading = math.nan if mask & PositionMask.YAW or not math.isfinite(m.yaw) else swap_yaw(m.yaw)
        rate = math.nan if mask & PositionMask.YAW_RATE else -m.yaw_rate
        if any(map(math.isinf, (*position, *velocity, *acceleration))):
            self.rejected += 1
            return
        self._store("position", (position, velocity, acceleration, heading, rate))

    def _from_body(self, m: Any, velocity: Vec3, acceleration: Vec3) -> tuple[Vec3, Vec3]:
        """Velocity and acceleration of BODY_NED in the world; what is NaN stays so."""
        attitude = self._flight.attitude
        if not math.isnan(velocity[0]):
            velocity = rotate(from_euler(0.0, 0.0, yaw(attitude)), *swap_body(m.vx, m.vy, m.vz))
        if not math.isnan(acceleration[0]):
            acceleration = rotate(attitude, *swap_body(m.afx, m.afy, m.afz))
        return velocity, acceleration

    def _refuse(self, text: str) -> None:
        self.rejected += 1
        self._flight.text(2, text)

    def _store(self, kind: str, values: tuple[Any, ...]) -> None:
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
        c[control.MODE], c[control.RAMP], c[control.SMOOTH] = control.OFF, math.inf, 0.0
        c[control.POS_SP : control.YAW_RATE_SP + 1] = math.nan
        self._takeoff.reset()

    def apply(self) -> None:
        """Write the newest set-point, if any, into the control row."""
        flight, c = self._flight, self._flight.control
        if not self._values or not flight.armed:
            c[control.MODE] = control.OFF
            return
        kind = flight.setpoint.kind
        if kind == "rates":
            c[control.RATE_SP : control.RATE_SP + 3], c[control.THRUST_SP] = self._values
            c[control.MODE] = control.RATES
        elif kind == "attitude":
            c[control.ATT_SP : control.ATT_SP + 4], c[control.THRUST_SP], c[control.YAW_RATE_SP] = self._values
            c[control.MODE] = control.ATTITUDE
        else:
            self._apply_position()

    def _apply_position(self) -> None:
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        if c[control.MODE] != control.POSITION:
            reset_cascade(c, flight.estimate)
        position, velocity, acceleration, c[control.YAW_SP], c[control.YAW_RATE_SP] = self._values
        c[control.POS_SP : control.POS_SP + 3] = position
        c[control.VEL_SP : control.VEL_SP + 3] = velocity
        c[control.ACC_SP : control.ACC_SP + 3] = acceleration
        c[control.MAX_XY], c[control.MAX_TILT] = p["MPC_XY_VEL_MAX"], math.radians(p["MPC_TILTMAX_AIR"])
        c[control.MAX_UP], c[control.MAX_DOWN], c[control.SMOOTH] = p["MPC_Z_VEL_MAX_UP"], p["MPC_Z_VEL_MAX_DN"], 0.0
        self._takeoff.apply(self._wants_up(position[2], velocity[2], acceleration[2]))

    def _wants_up(self, height: float, climb: float, acceleration: float) -> bool:
        """Whether a set-point asks for a take-off; NaN where it says nothing."""
        return height > self._flight.position[2] or climb > 0.0 or acceleration > 0.0
