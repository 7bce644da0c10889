"""How PX4 leaves the ground: motors that spool up, and a ceiling of the climb rate that rises from nothing."""

from __future__ import annotations

import math

from vehicle.px4.sim.rows import control
from vehicle.px4.sim.state import Flight
from vehicle.quadrotor.airframe import GRAVITY

RAMP_DELAY_NS = 60_000_000  # before the take-off ramp moves (recorded)


def spooled_up(flight: Flight) -> bool:
    """True once the motors have idled for COM_SPOOLUP_TIME after arming."""
    return flight.now_ns - flight.armed_ns >= flight.parameters["COM_SPOOLUP_TIME"] * 1e9


def takeoff_ramp(flight: Flight, started_ns: int, end: float) -> float:
    """Ceiling of the climb rate (m/s): from where its thrust is zero up to `end` in MPC_TKO_RAMP_T; then inf."""
    p = flight.parameters
    started_ns += RAMP_DELAY_NS
    start = -GRAVITY / float(flight.control[control.Z_VEL_P])
    share = (flight.now_ns - started_ns) * 1e-9 / max(0.1, float(p["MPC_TKO_RAMP_T"]))
    return math.inf if share >= 1.0 else start + max(0.0, share) * (end - start)


class TakeOff:
    """Take-off by position and velocity set-points, of OFFBOARD or of a pilot's sticks."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._ramp_ns = -1

    def reset(self) -> None:
        """The mode has just become active."""
        self._ramp_ns = -1

    def apply(self, wants_up: bool) -> None:
        """After the set-points were written: motors off on the ground, the ramp while it leaves it."""
        flight, c = self._flight, self._flight.control
        c[control.RAMP], c[control.MODE] = math.inf, control.POSITION
        if flight.landed and self._ramp_ns < 0:
            if not (spooled_up(flight) and wants_up):
                c[control.MODE] = control.OFF
                return
            self._ramp_ns = flight.now_ns
        elif flight.contact:
            c[control.MODE] = control.OFF
        if self._ramp_ns >= 0:
            c[control.RAMP] = takeoff_ramp(flight, self._ramp_ns, float(flight.parameters["MPC_Z_VEL_MAX_UP"]))
            if math.isinf(c[control.RAMP]) and not flight.landed:
                self._ramp_ns = -1
