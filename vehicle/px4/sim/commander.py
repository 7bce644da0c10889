"""PX4's commander: commands and their results, arming, modes, automatic disarming. Runs every 10 ms of PX4 time."""

from __future__ import annotations

import math

from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import Command as Cmd
from vehicle.px4.protocol import Main, Result
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.failsafe import Failsafe
from vehicle.px4.sim.landing import LandDetector
from vehicle.px4.sim.navigator import Navigator
from vehicle.px4.sim.offboard import Offboard
from vehicle.px4.sim.rows import control, situation
from vehicle.px4.sim.state import Command, Flight
from vehicle.quadrotor.rate_control import reset_rate_control

PERIOD_NS = 10_000_000
SILENT_BOOT_S = 1.0  # until then arming is refused without a text
DENIED = "Arming denied: Resolve system health failures first\t"
_TITLES = {
    px4.OFFBOARD: "Offboard",
    px4.POSCTL: "Position",
    px4.ALTCTL: "Altitude",
    px4.MISSION: "Mission",
    px4.HOLD: "Hold",
    px4.TAKEOFF: "Takeoff",
    px4.LAND: "Land",
    px4.RTL: "Return",
    px4.custom_mode(Main.MANUAL): "Manual",
    px4.custom_mode(Main.ACRO): "Acro",
    px4.custom_mode(Main.STABILIZED): "Stabilized",
}
_AUTO = (px4.HOLD, px4.TAKEOFF, px4.LAND, px4.RTL)
_NOT_FOR_ARMING = (px4.LAND, px4.RTL)  # nor restored after a landing


class Commander:
    """Owns arming and modes of a `Flight`; commands come through `queue` and are answered at its next run."""

    def __init__(self, flight: Flight, ready_ns: int) -> None:
        """`ready_ns`: PX4 time at which the pre-arm checks pass."""
        self._flight, self._ready_ns = flight, ready_ns
        self.queue: list[Command] = []
        self.navigator = Navigator(flight)
        self.offboard = Offboard(flight)
        self.landing = LandDetector(flight)
        self.failsafe = Failsafe(flight, self)

    # -- what can run ---------------------------------------------------------------------------------------------

    def can_run(self, mode: int) -> bool:
        """True if a mode's requirements are met now."""
        flight = self._flight
        if mode == px4.OFFBOARD:
            return flight.stream_fresh() and (flight.setpoint.kind != "position" or flight.position_valid)
        return mode in _AUTO and flight.position_valid

    def can_arm(self) -> bool:
        """True if arming in the selected mode would be allowed."""
        flight = self._flight
        if not flight.ready or flight.terminated or flight.intended in _NOT_FOR_ARMING:
            return False
        if flight.intended in _AUTO and not flight.global_valid:
            return False  # recorded with vision alone: "horizontal position unstable"
        return self.can_run(flight.intended)

    def system_status(self) -> int:
        """HEARTBEAT.system_status."""
        flight = self._flight
        if flight.terminated:
            return px4.State.FLIGHT_TERMINATION
        if flight.armed:
            return px4.State.CRITICAL if flight.failsafe else px4.State.ACTIVE
        return px4.State.STANDBY if self.can_arm() else px4.State.UNINIT

    def base_mode(self) -> int:
        """HEARTBEAT.base_mode."""
        flight = self._flight
        main = px4.split_custom_mode(flight.active)[0]
        bits = int(px4.BaseMode.CUSTOM)
        if main == Main.AUTO:
            bits |= px4.BaseMode.AUTO | px4.BaseMode.GUIDED | px4.BaseMode.STABILIZE
        elif main == Main.OFFBOARD:
            if flight.armed and flight.setpoint.kind != "rates":
                bits |= px4.BaseMode.STABILIZE
        else:
            bits |= px4.BaseMode.MANUAL_INPUT
            if main != Main.ACRO:
                bits |= px4.BaseMode.STABILIZE
        return bits | (px4.BaseMode.ARMED if flight.armed else 0)

    # -- the loop -------------------------------------------------------------------------------------------------

    def update(self) -> None:
        """One run of the commander."""
        flight = self._flight
        if not flight.ready and flight.now_ns >= self._ready_ns:
            flight.ready = True
        queue, self.queue = self.queue, []
        for command in queue:
            self._execute(command)
        self.landing.update()
        self._disarm_by_itself()
        self.failsafe.update()
        following = self.navigator.update()
        if following is not None and flight.intended == flight.active:
            self._choose(following)
        if flight.active == px4.OFFBOARD:
            self.offboard.apply()
        elif px4.split_custom_mode(flight.active)[0] not in (Main.AUTO, Main.ALTCTL):
            flight.control[control.MODE] = control.OFF

    def _disarm_by_itself(self) -> None:
        flight = self._flight
        if not flight.armed or not flight.landed:
            return
        p = flight.parameters
        if flight.took_off:
            if p["COM_DISARM_LAND"] > 0 and flight.now_ns - flight.landed_ns >= p["COM_DISARM_LAND"] * 1e9:
                self.disarm("Disarmed by landing\t", 6)
        elif p["COM_DISARM_PRFLT"] > 0 and flight.now_ns - flight.armed_ns >= p["COM_DISARM_PRFLT"] * 1e9:
            self.disarm("Disarmed by auto preflight disarming\t", 7)

    # -- modes ----------------------------------------------------------------------------------------------------

    def _choose(self, mode: int) -> None:
        """The user's (or a finished mode's) choice; a running failsafe is over."""
        flight = self._flight
        flight.intended = mode
        flight.failsafe = False
        if mode not in _NOT_FOR_ARMING:
            flight.after_disarm = mode
        self.activate(mode)

    def activate(self, mode: int) -> None:
        """Run a mode without changing what the user requested."""
        flight = self._flight
        if mode == flight.active and px4.split_custom_mode(mode)[0] != Main.AUTO:
            return
        previous, flight.active = flight.active, mode
        flight.mode_since_ns = flight.now_ns
        self.navigator.enter(mode)
        if mode == px4.OFFBOARD and previous != mode:
            self.offboard.enter()

    def request_mode(self, custom: int) -> tuple[int, str]:
        """A user's request for a mode: PX4's result and text."""
        flight = self._flight
        main, sub = px4.split_custom_mode(custom)
        if main not in Main.__members__.values():
            return Result.ACCEPTED, ""  # PX4 does nothing, and accepts
        if flight.terminated:
            return Result.TEMPORARILY_REJECTED, ""
        if main == Main.AUTO:
            mode = px4.custom_mode(main, sub) if sub else px4.MISSION
            if mode not in (*_AUTO, px4.MISSION):
                return Result.TEMPORARILY_REJECTED, "Unsupported auto mode\t"
        else:
            mode = px4.custom_mode(main)
        if flight.armed and not self.can_run(mode):
            return Result.TEMPORARILY_REJECTED, f"Switching to {_TITLES[mode]} is currently not available\t"
        self._choose(mode)
        return Result.ACCEPTED, ""

    # -- arming ---------------------------------------------------------------------------------------------------

    def _arm(self) -> int:
        flight = self._flight
        if flight.armed:
            return Result.ACCEPTED
        if flight.now_s < SILENT_BOOT_S:
            return Result.TEMPORARILY_REJECTED
        if not self.can_arm():
            if flight.terminated:
                flight.text(2, "Preflight Fail: Flight termination active\t")
            flight.text(2, DENIED)
            return Result.TEMPORARILY_REJECTED
        flight.armed, flight.armed_ns, flight.took_off = True, flight.now_ns, False
        flight.situation[situation.ARMED] = 1.0
        if flight.global_valid:
            flight.home, flight.home_ns = flight.position, flight.now_ns
        reset_rate_control(flight.row)
        reset_cascade(flight.control, flight.estimate)
        self.navigator.enter(flight.active)
        flight.text(6, "Armed by external command\t", 0x0190CAF3, b"\x04")
        return Result.ACCEPTED

    def disarm(self, text: str, reason: int) -> None:
        """Stop the motors; the mode returns to the last one that the user selected for flight."""
        flight = self._flight
        flight.armed = flight.failsafe = False
        flight.situation[situation.ARMED] = 0.0
        flight.control[control.MODE] = control.OFF
        flight.landing = flight.contact = False
        reset_rate_control(flight.row)
        flight.text(6, text, 0x01F46777, bytes((reason,)))
        if not flight.terminated:
            flight.intended = flight.after_disarm
            self.activate(flight.after_disarm)

    def terminate(self) -> None:
        """Motors off for good."""
        flight = self._flight
        flight.terminated = True
        flight.situation[situation.ARMED] = 0.0
        flight.active = px4.custom_mode(Main.MANUAL)
        flight.control[control.MODE] = control.OFF
        flight.text(2, "Failsafe activated\t", 0x01DEDBD0)

    # -- commands -------------------------------------------------------------------------------------------------

    def _execute(self, command: Command) -> None:
        """Carry a command out; the acknowledgement is sent before any text, as PX4 does."""
        flight = self._flight
        texts: list[tuple] = []
        send_text, flight.text = flight.text, lambda *text: texts.append(text)
        try:
            result = self._carry_out(command)
        finally:
            flight.text = send_text
        if result is not None:
            flight.acknowledge(command, int(result))
        for text in texts:
            send_text(*text)

    def _carry_out(self, command: Command) -> int | None:
        """The result, or None where PX4 sends no acknowledgement."""
        flight = self._flight
        p1, p2 = command.params[0], command.params[1]
        result: int | None = Result.UNSUPPORTED
        text = ""
        if command.number == Cmd.COMPONENT_ARM_DISARM:
            result = self._arm_command(p1, p2)
        elif command.number == Cmd.DO_SET_MODE:
            result, text = Result.TEMPORARILY_REJECTED, ""
            if _integer(p1) & px4.SET_MODE_FLAG:
                sub = _integer(command.params[2])
                result, text = self.request_mode(px4.custom_mode(_integer(p2) & 0xFF, sub & 0xFF))
        elif command.number == Cmd.NAV_TAKEOFF:
            result, text = self.request_mode(px4.TAKEOFF)
            if result == Result.ACCEPTED and flight.armed and math.isnan(command.params[6]):
                altitude = float(flight.parameters["MIS_TAKEOFF_ALT"])
                text = f"Using default takeoff altitude: {altitude:.1f} m\t"
        elif command.number == Cmd.NAV_LAND:
            result, text = self.request_mode(px4.LAND)
            if result == Result.ACCEPTED and flight.armed:
                text = "Landing at current position\t"
        elif command.number == Cmd.NAV_RETURN_TO_LAUNCH:
            result, text = self.request_mode(px4.RTL)
        elif command.number == Cmd.DO_FLIGHTTERMINATION:
            result = self._termination_command(p1)
        elif command.number == Cmd.PREFLIGHT_REBOOT_SHUTDOWN:
            result = Result.DENIED
        if text:
            severity = 6 if result == Result.ACCEPTED else 2
            event = {"Landing": 0x0132B2DE, "Using d": 0x013B2FC7}.get(text[:7])
            flight.text(severity, text, event)
        return result

    def _arm_command(self, p1: float, p2: float) -> int | None:
        flight = self._flight
        if p1 not in (0.0, 1.0):
            flight.text(2, f"Unsupported ARM_DISARM param: {p1:.3f}\t")
            return None
        if p1 == 1.0:
            return self._arm()
        if not flight.armed:
            return Result.ACCEPTED
        if not flight.landed and _integer(p2) != px4.FORCE_MAGIC:
            flight.text(2, "Disarming denied: not landed\t")
            return Result.TEMPORARILY_REJECTED
        self.disarm("Disarmed by external command\t", 4)
        return Result.ACCEPTED

    def _termination_command(self, p1: float) -> int:
        if not (self._flight.armed and p1 > 0.5):
            return Result.TEMPORARILY_REJECTED
        self.terminate()
        return Result.ACCEPTED


def _integer(value: float) -> int:
    """A command parameter as PX4 casts it; NaN is 0."""
    return int(value) if math.isfinite(value) else 0
