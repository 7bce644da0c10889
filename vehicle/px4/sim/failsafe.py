"""When PX4 takes over by itself: a lost OFFBOARD stream, a lost position, an attitude beyond recovery."""

from __future__ import annotations

import math
from typing import Protocol

from kernel.rotations import to_euler
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.rows import situation
from vehicle.px4.sim.state import Flight

LOSS_HYSTERESIS_S = 0.1  # on top of COM_OF_LOSS_T (recorded: 1.10-1.12 s with COM_OF_LOSS_T 1.0)
RETURN_S = 0.028  # of resumed stream before OFFBOARD runs again (recorded: 28-44 ms)
FLIGHTTERM_OFF = 121212  # CBRK_FLIGHTTERM


_NEED_POSITION = (px4.HOLD, px4.TAKEOFF, px4.LAND, px4.RTL, px4.MISSION, px4.ORBIT, px4.POSCTL)


class _Modes(Protocol):
    @property
    def sticks(self) -> bool: ...

    def activate(self, mode: int) -> None: ...

    def disarm(self, text: str, reason: int) -> None: ...

    def terminate(self) -> None: ...

    def can_run(self, mode: int) -> bool: ...


class Failsafe:
    """Monitors a `Flight` at the commander's rate and changes modes through the commander."""

    def __init__(self, flight: Flight, commander: _Modes) -> None:
        self._flight, self._commander = flight, commander
        self._tipped_ns = self._stickless_ns = -1

    def update(self) -> None:
        """One run."""
        flight = self._flight
        if flight.terminated or not flight.armed:
            self._tipped_ns = self._stickless_ns = -1
            if not flight.terminated and flight.active != flight.intended:
                self._commander.activate(flight.intended)
            return
        self._watch_attitude()
        if flight.terminated:
            return
        if flight.intended == px4.OFFBOARD:
            self._watch_stream()
        elif flight.intended in (px4.POSCTL, px4.ALTCTL):
            self._watch_sticks()
        if flight.active in _NEED_POSITION and not flight.position_valid:
            self._fail(px4.ALTCTL)

    def _watch_stream(self) -> None:
        flight, p = self._flight, self._flight.parameters
        age = flight.now_ns - flight.setpoint.last_ns
        lost = flight.setpoint.last_ns < 0 or age >= (p["COM_OF_LOSS_T"] + LOSS_HYSTERESIS_S) * 1e9
        if flight.setpoint.kind == "position" and not flight.position_valid:
            lost = True
        if not flight.failsafe and lost:
            self._react_to_loss(int(p["COM_OBL_RC_ACT"]))
        elif flight.failsafe and not lost:
            running = flight.now_ns - flight.setpoint.running_since_ns
            if running >= RETURN_S * 1e9 and self._commander.can_run(px4.OFFBOARD):
                flight.failsafe = False
                self._commander.activate(px4.OFFBOARD)

    def _watch_sticks(self) -> None:
        """Without sticks: Hold for COM_FAIL_ACT_T, then what NAV_RCL_ACT says; with them again, the pilot's mode."""
        flight, p = self._flight, self._flight.parameters
        if self._commander.sticks:
            self._stickless_ns = -1
            if flight.failsafe and self._commander.can_run(flight.intended):
                flight.failsafe = False
                self._commander.activate(flight.intended)
        elif self._stickless_ns < 0:
            self._stickless_ns = flight.now_ns
            flight.text(2, "Manual control lost\t")
            self._fail(px4.HOLD)
        elif flight.active == px4.HOLD and p["NAV_RCL_ACT"] != 1 and self._held_long_enough():  # 1: it stays in Hold
            self._react_to_loss(0)

    def _held_long_enough(self) -> bool:
        flight = self._flight
        return flight.now_ns - self._stickless_ns >= flight.parameters["COM_FAIL_ACT_T"] * 1e9

    def _react_to_loss(self, action: int) -> None:
        if action in (0, 1, 2):  # a manual mode, for which there is no RC: NAV_RCL_ACT decides
            manual = {1: 5, 2: 3, 3: 4, 5: 6, 6: 7}
            action = manual.get(int(self._flight.parameters["NAV_RCL_ACT"]), 3)
        if action == 6:
            self._commander.terminate()
        elif action == 7:
            self._flight.text(2, "Failsafe activated\t", 0x01DEDBD0)
            self._commander.disarm("Disarmed by failsafe\t", 9)
        else:
            self._fail({4: px4.LAND, 5: px4.HOLD}.get(action, px4.RTL))

    def _fail(self, mode: int) -> None:
        flight = self._flight
        if mode != px4.ALTCTL and not flight.position_valid:
            mode = px4.ALTCTL
        if not flight.failsafe:
            flight.failsafe = True
            flight.text(2, "Failsafe activated\t", 0x01DEDBD0)
        self._commander.activate(mode)

    def _watch_attitude(self) -> None:
        """PX4's failure detector (FD_FAIL_R, FD_FAIL_P): it terminates only if CBRK_FLIGHTTERM is not engaged."""
        flight, p = self._flight, self._flight.parameters
        if p["CBRK_FLIGHTTERM"] == FLIGHTTERM_OFF or flight.landed or flight.situation[situation.ARMED] == 0.0:
            self._tipped_ns = -1
            return
        roll, pitch, _ = to_euler(flight.attitude)
        rolled = p["FD_FAIL_R"] > 0 and abs(roll) > math.radians(p["FD_FAIL_R"])
        pitched = p["FD_FAIL_P"] > 0 and abs(pitch) > math.radians(p["FD_FAIL_P"])
        if not (rolled or pitched):
            self._tipped_ns = -1
        elif self._tipped_ns < 0:
            self._tipped_ns = flight.now_ns
        elif flight.now_ns - self._tipped_ns >= max(p["FD_FAIL_R_TTRI"], p["FD_FAIL_P_TTRI"]) * 1e9:
            self._commander.terminate()
