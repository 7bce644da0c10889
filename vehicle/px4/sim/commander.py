"""PX4's commander: arming, modes, automatic disarming. Runs every 10 ms of PX4 time."""

from __future__ import annotations

from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import Main, Result
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.commands import Commands
from vehicle.px4.sim.failsafe import Failsafe
from vehicle.px4.sim.landing import LandDetector
from vehicle.px4.sim.manual import Manual
from vehicle.px4.sim.navigator import Navigator
from vehicle.px4.sim.offboard import Offboard
from vehicle.px4.sim.orbit import Orbit
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
    px4.ORBIT: "Orbit",
    px4.custom_mode(Main.MANUAL): "Manual",
    px4.custom_mode(Main.ACRO): "Acro",
    px4.custom_mode(Main.STABILIZED): "Stabilized",
}
_AUTO = (px4.HOLD, px4.TAKEOFF, px4.LAND, px4.RTL, px4.MISSION)
_NOT_FOR_ARMING = (px4.LAND, px4.RTL, px4.ORBIT)  # nor restored after a landing
_ARMING_REASONS = {"external command": 4, "mission start": 5}  # of PX4's event


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
        self.orbit, self.manual = Orbit(flight), Manual(flight)
        self._commands = Commands(flight, self, self.navigator, self.orbit)

    # -- what can run ---------------------------------------------------------------------------------------------

    def can_run(self, mode: int) -> bool:
        """True if a mode's requirements are met now."""
        flight = self._flight
        if mode == px4.OFFBOARD:
            return flight.stream_fresh() and (flight.setpoint.kind != "position" or flight.position_valid)
        if mode in (px4.POSCTL, px4.ALTCTL):
            return self.sticks and (mode == px4.ALTCTL or flight.position_valid)
        if mode == px4.MISSION and not flight.plan.mission:
            return False
        return mode in (*_AUTO, px4.ORBIT) and flight.position_valid

    @property
    def sticks(self) -> bool:
        """Whether a pilot's sticks are received."""
        return self.manual.fresh

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
            self._commands.execute(command)
        self.landing.update()
        self._disarm_by_itself()
        self.failsafe.update()
        following = self.navigator.update()
        if following is not None and flight.intended == flight.active:
            self._choose(following)
        if flight.active == px4.OFFBOARD:
            self.offboard.apply()
        elif flight.active == px4.ORBIT:
            self.orbit.update()
        elif flight.active == px4.POSCTL or (flight.active == px4.ALTCTL and self.sticks):
            self.manual.update()
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
        elif mode in (px4.POSCTL, px4.ALTCTL):
            self.manual.enter()

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
            if mode not in _AUTO:
                return Result.TEMPORARILY_REJECTED, "Unsupported auto mode\t"
        else:
            mode = custom if custom == px4.ORBIT else px4.custom_mode(main)
        if flight.armed and not self.can_run(mode):
            return Result.TEMPORARILY_REJECTED, f"Switching to {_TITLES[mode]} is currently not available\t"
        self._choose(mode)
        return Result.ACCEPTED, ""

    # -- arming ---------------------------------------------------------------------------------------------------

    def arm(self, by: str) -> int:
        """Arm if the checks pass; `by`: who asks, for the text. Returns the Result."""
        flight = self._flight
        if flight.armed:
            return Result.ACCEPTED
        if flight.now_s < SILENT_BOOT_S:
            return Result.TEMPORARILY_REJECTED
        if flight.intended in (px4.POSCTL, px4.ALTCTL) and self.sticks and self.manual.above_centre:
            flight.text(2, "Arming denied: throttle above center\t")
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
        self.manual.enter()
        reason = _ARMING_REASONS[by]
        flight.text(6, f"Armed by {by}\t", 0x0190CAF3, bytes((reason,)))
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
