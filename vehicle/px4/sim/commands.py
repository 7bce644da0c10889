"""Commands that PX4's commander and navigator judge: what each does, and what it is answered."""

from __future__ import annotations

import math
from typing import Protocol

from kernel.rotations import swap_yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import Command as Cmd
from vehicle.px4.protocol import Result
from vehicle.px4.sim.navigator import Navigator
from vehicle.px4.sim.orbit import Orbit
from vehicle.px4.sim.state import Command, Flight

_EVENTS = {"Landing": 0x0132B2DE, "Using d": 0x013B2FC7}


class _Commander(Protocol):
    def request_mode(self, custom: int) -> tuple[int, str]: ...

    def arm(self, by: str) -> int: ...

    def disarm(self, text: str, reason: int) -> None: ...

    def terminate(self) -> None: ...


class Commands:
    """Executes commands through the commander."""

    def __init__(self, flight: Flight, commander: _Commander, navigator: Navigator, orbit: Orbit) -> None:
        self._flight, self._commander, self._navigator, self._orbit = flight, commander, navigator, orbit

    def execute(self, command: Command) -> None:
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
        flight, commander = self._flight, self._commander
        p1, p2 = command.params[0], command.params[1]
        result: int | None = Result.UNSUPPORTED
        text = ""
        if command.number == Cmd.COMPONENT_ARM_DISARM:
            result = self._arm_command(p1, p2)
        elif command.number == Cmd.DO_SET_MODE:
            result, text = Result.TEMPORARILY_REJECTED, ""
            if _integer(p1) & px4.SET_MODE_FLAG:
                sub = _integer(command.params[2])
                result, text = commander.request_mode(px4.custom_mode(_integer(p2) & 0xFF, sub & 0xFF))
        elif command.number == Cmd.NAV_TAKEOFF:
            result, text = commander.request_mode(px4.TAKEOFF)
            if result == Result.ACCEPTED and flight.armed and math.isnan(command.params[6]):
                altitude = float(flight.parameters["MIS_TAKEOFF_ALT"])
                text = f"Using default takeoff altitude: {altitude:.1f} m\t"
        elif command.number == Cmd.NAV_LAND:
            result, text = commander.request_mode(px4.LAND)
            if result == Result.ACCEPTED and flight.armed:
                text = "Landing at current position\t"
        elif command.number == Cmd.NAV_RETURN_TO_LAUNCH:
            result, text = commander.request_mode(px4.RTL)
        elif command.number == Cmd.DO_REPOSITION:
            result, text = self._reposition(command.params)
        elif command.number == Cmd.DO_ORBIT:
            result, text = self._circle(command.params)
        elif command.number == Cmd.MISSION_START:
            result, text = self._start_mission(p1)
        elif command.number == Cmd.DO_FLIGHTTERMINATION:
            result = self._termination_command(p1)
        elif command.number == Cmd.PREFLIGHT_REBOOT_SHUTDOWN:
            result = Result.DENIED
        if text:
            severity = 6 if result == Result.ACCEPTED else 2
            flight.text(severity, text, _EVENTS.get(text[:7]))
        return result

    def _reposition(self, params: tuple[float, ...]) -> tuple[int, str]:
        """PX4 answers for the change to Hold only; the place takes effect where it flies."""
        if _integer(params[1]) != 1:
            return Result.UNSUPPORTED, ""
        result, text = self._commander.request_mode(px4.HOLD)
        if result == Result.ACCEPTED:
            heading = swap_yaw(params[3]) if math.isfinite(params[3]) else math.nan
            self._navigator.reposition(*self._place(params), heading)
        return result, text

    def _circle(self, params: tuple[float, ...]) -> tuple[int, str]:
        result, _ = self._commander.request_mode(px4.ORBIT)
        if result != Result.ACCEPTED:
            return result, "Orbit command rejected"
        self._orbit.start(params[0], params[1], params[2], *self._place(params))
        return result, ""

    def _place(self, params: tuple[float, ...]) -> tuple[tuple[float, float], float]:
        """World position and height (m) of latitude, longitude (deg) and altitude (m above sea level); NaN where they
        are not given."""
        flight, (latitude, longitude, altitude) = self._flight, params[4:7]
        known = abs(latitude) <= 90.0 and abs(longitude) <= 180.0  # not of NaN
        place = flight.place(latitude, longitude) if known else (math.nan, math.nan)
        return place, flight.height(altitude) if math.isfinite(altitude) else math.nan

    def _start_mission(self, first: float) -> tuple[int, str]:
        plan = self._flight.plan
        if not plan.mission:
            return Result.DENIED, "Mission start denied! No valid mission\t"
        if not -1.0 <= first < len(plan.mission):
            return Result.DENIED, ""
        result, text = self._commander.request_mode(px4.MISSION)
        if result != Result.ACCEPTED:
            return result, text
        return self._commander.arm("mission start"), ""

    def _arm_command(self, p1: float, p2: float) -> int | None:
        flight = self._flight
        if p1 not in (0.0, 1.0):
            flight.text(2, f"Unsupported ARM_DISARM param: {p1:.3f}\t")
            return None
        if p1 == 1.0:
            return self._commander.arm("external command")
        if not flight.armed:
            return Result.ACCEPTED
        if not flight.landed and _integer(p2) != px4.FORCE_MAGIC:
            flight.text(2, "Disarming denied: not landed\t")
            return Result.TEMPORARILY_REJECTED
        self._commander.disarm("Disarmed by external command\t", 4)
        return Result.ACCEPTED

    def _termination_command(self, p1: float) -> int:
        if not (self._flight.armed and p1 > 0.5):
            return Result.TEMPORARILY_REJECTED
        self._commander.terminate()
        return Result.ACCEPTED


def _integer(value: float) -> int:
    """A command parameter as PX4 casts it; NaN is 0."""
    return int(value) if math.isfinite(value) else 0
