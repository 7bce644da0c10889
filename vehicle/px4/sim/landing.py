"""PX4's land detector as far as clients can observe it: take-off by thrust, ground contact in steps, landed.

Timing follows recorded flights: take-off about 0.2 s after the thrust passes a low threshold, landed 1.5 times
LNDMC_TRIG_TIME after contact with the ground.
"""

from __future__ import annotations

import math

from vehicle.px4 import protocol as px4
from vehicle.px4.sim.rows import control, situation
from vehicle.px4.sim.state import Flight
from vehicle.quadrotor import state_row

TAKEOFF_THRUST = 0.11  # normalised; below it nothing flies
TAKEOFF_S = 0.18
STAGES = 1.5  # ground contact, maybe landed, landed, in units of LNDMC_TRIG_TIME


class LandDetector:
    """Maintains `flight.landed`, `took_off` and `contact`, and announces both changes."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._lifting_ns = -1

    def update(self) -> None:
        """Run at the commander's rate."""
        flight = self._flight
        thrust = float(flight.control[control.OUT_THRUST])
        if not flight.armed:
            self._lifting_ns = flight.contact_ns = -1
            flight.contact = False
            if not flight.landed and self._still():
                self._land(announce=False)
        elif flight.landed:
            self._look_for_takeoff(thrust)
        else:
            self._look_for_landing(thrust)
        flight.control[control.LANDED] = 1.0 if flight.landed else 0.0

    def _look_for_takeoff(self, thrust: float) -> None:
        flight = self._flight
        if thrust <= TAKEOFF_THRUST:
            self._lifting_ns = -1
        elif self._lifting_ns < 0:
            self._lifting_ns = flight.now_ns
        elif flight.now_ns - self._lifting_ns >= TAKEOFF_S * 1e9:
            flight.landed, flight.took_off = False, True
            flight.contact_ns, flight.contact = -1, False
            flight.text(6, "Takeoff detected\t", 0x01414569)

    def _look_for_landing(self, thrust: float) -> None:
        flight = self._flight
        on_something = flight.situation[situation.RESTING] > 0.0 or flight.situation[situation.ATTACHED] > 0.0
        low = on_something and (flight.landing or self._descending())
        if not (self._still() and (low or thrust < TAKEOFF_THRUST)):
            flight.contact_ns, flight.contact = -1, False
            return
        if flight.contact_ns < 0:
            flight.contact_ns = flight.now_ns
        since = (flight.now_ns - flight.contact_ns) * 1e-9
        trigger = float(flight.parameters["LNDMC_TRIG_TIME"])
        flight.contact = low and since >= 0.35 * trigger
        if since >= STAGES * trigger:
            self._land(announce=True)

    def _descending(self) -> bool:
        """Whether a velocity set-point or a stick asks for a descent faster than what counts as standing."""
        flight = self._flight
        by_setpoint = flight.active == px4.OFFBOARD and flight.setpoint.kind == "position"
        if not by_setpoint and flight.active not in (px4.POSCTL, px4.ALTCTL):
            return False
        down = -float(flight.control[control.VEL_SP + 2])
        return down >= 1.1 * float(flight.parameters["LNDMC_Z_VEL_MAX"])

    def _still(self) -> bool:
        flight = self._flight
        row, parameters = flight.row, flight.parameters
        return (
            abs(row[state_row.V + 2]) < parameters["LNDMC_Z_VEL_MAX"]
            and math.hypot(row[state_row.V], row[state_row.V + 1]) < parameters["LNDMC_XY_VEL_MAX"]
            and abs(row[state_row.W : state_row.W + 3]).max() < math.radians(parameters["LNDMC_ROT_MAX"]) * 2.0
        )

    def _land(self, announce: bool) -> None:
        flight = self._flight
        flight.landed, flight.landed_ns = True, flight.now_ns
        self._lifting_ns = -1
        if announce:
            flight.text(6, "Landing detected\t", 0x019638AC)
