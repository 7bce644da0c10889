"""What PX4's Mission mode does with the items of a mission, one after the other."""

from __future__ import annotations

import math

import numpy as np

from kernel.rotations import swap_yaw, wrap_angle, yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.protocol import Command as Cmd
from vehicle.px4.sim.services.plan import AT_PLACE, FRAME_MISSION, Item
from vehicle.px4.sim.state import Flight

_LOOK_AHEAD = 1.0  # m to the next place, below which the nose stays as it is


class MissionFlight:
    """Moves `target` (m, world, (3,)) from item to item. `rising`: it takes off to the target's height; `landing`: it
    is above the place where it lands."""

    def __init__(self, flight: Flight, target: np.ndarray) -> None:
        self._flight, self._target = flight, target
        self.rising = self.landing = False
        self.cruise = math.nan  # m/s
        self.heading = math.nan  # rad, world
        self._at: tuple[int, int] | None = None  # what is flown: count of changes, item
        self._arrived_ns = -1
        self._jumps: dict[int, int] = {}  # DO_JUMP's item -> how often it was taken

    def enter(self) -> None:
        """Mission mode has just become active: the current item begins anew; after a finished mission, the first."""
        flight = self._flight
        if flight.plan.finished:
            flight.plan.go_to(0)
            flight.plan.reached = -1
        self._at, self._jumps, self.cruise = None, {}, math.nan
        self.heading = yaw(flight.attitude)
        self.rising = self.landing = False

    def update(self) -> int | None:
        """One run; returns the mode that follows when the mission is done, else None."""
        flight, plan = self._flight, self._flight.plan
        if not flight.armed:
            self._at = None
            return None
        if not plan.mission:
            return px4.HOLD
        item = plan.mission[plan.current]
        if self._at != (plan.changes, plan.current):
            self._at, self._arrived_ns = (plan.changes, plan.current), -1
            self._begin(item)
        self._look()
        if not self._done(item):
            return None
        plan.reached = plan.current
        if item.command == Cmd.NAV_RETURN_TO_LAUNCH:
            plan.finished = plan.current + 1 == len(plan.mission)
            return px4.RTL
        return self._advance(item)

    def _advance(self, item: Item) -> int | None:
        flight, plan = self._flight, self._flight.plan
        if not item.autocontinue:
            return None
        following = plan.current + 1
        taken = self._jumps.get(plan.current, 0)
        if item.command == Cmd.DO_JUMP and taken < item.params[1] and math.isfinite(item.params[0]):
            self._jumps[plan.current] = taken + 1
            following = max(0, int(item.params[0]))
        if following < len(plan.mission):
            plan.current = following
            return None
        plan.finished = True
        flight.text(6, f"Mission finished, {'landed' if flight.landed else 'loitering'}\t")
        return None if flight.landed else px4.HOLD

    def _begin(self, item: Item) -> None:
        flight, p = self._flight, self._flight.parameters
        self.landing = False
        if item.command == Cmd.DO_CHANGE_SPEED and item.params[1] > 0.0:
            self.cruise = item.params[1]
        if item.frame == FRAME_MISSION or item.command not in AT_PLACE:
            return
        height = self._height(item)
        self.rising = flight.landed and item.command != Cmd.NAV_LAND
        if self.rising:
            home = flight.home[2] if flight.home else flight.position[2]
            if item.command != Cmd.NAV_TAKEOFF:
                height = max(height, home + float(p["MIS_TAKEOFF_ALT"]))
            self._target[:] = (*flight.position[:2], height)
            flight.text(6, f"Takeoff to {height - home:.1f} meters above home\t")
        else:
            self._go(item, flight.position[2] if item.command == Cmd.NAV_LAND else height)

    def _go(self, item: Item, height: float) -> None:
        flight = self._flight
        self._target[2] = height
        self._target[:2] = flight.place(item.x / 1e7, item.y / 1e7) if item.x or item.y else flight.position[:2]

    def _height(self, item: Item) -> float:
        flight = self._flight
        if not math.isfinite(item.z):
            return flight.position[2]
        if item.relative:
            return item.z + (flight.home[2] if flight.home else flight.origin[2])
        return flight.height(item.z)

    def _look(self) -> None:
        """The nose: as the item says, else to where it flies."""
        item = self._flight.plan.mission[self._flight.plan.current]
        if self.rising or item.frame == FRAME_MISSION:
            return
        x, y, _ = self._flight.position
        if item.command in AT_PLACE and math.isfinite(item.params[3]):
            self.heading = swap_yaw(math.radians(item.params[3]))
        elif math.hypot(self._target[0] - x, self._target[1] - y) > _LOOK_AHEAD:
            self.heading = math.atan2(self._target[1] - y, self._target[0] - x)

    def _done(self, item: Item) -> bool:
        flight = self._flight
        if item.command == Cmd.NAV_DELAY:
            return self._waited(item.params[0])
        if item.frame == FRAME_MISSION or item.command not in AT_PLACE:
            return True  # a command to a device that is not there, or one that `_begin` has carried out
        if self.rising:
            if flight.landed or not self._at_height():
                return False
            self.rising = False
            self._go(item, self._height(item))
        if item.command == Cmd.NAV_LAND:
            self.landing = self.landing or self._above(float(flight.parameters["NAV_ACC_RAD"]))
            return self.landing and flight.landed
        if self._arrived_ns < 0 and not self._arrived(item):
            return False
        if item.command == Cmd.NAV_LOITER_UNLIM:
            return False
        timed = item.command in (Cmd.NAV_WAYPOINT, Cmd.NAV_LOITER_TIME)
        return self._waited(item.params[0] if timed else 0.0)

    def _arrived(self, item: Item) -> bool:
        flight, p = self._flight, self._flight.parameters
        radius = item.params[1] if item.command == Cmd.NAV_WAYPOINT and item.params[1] > 0.0 else p["NAV_ACC_RAD"]
        turned = abs(wrap_angle(yaw(flight.attitude) - self.heading)) < math.radians(p["MIS_YAW_ERR"])
        return self._above(float(radius)) and self._at_height() and (turned or not math.isfinite(item.params[3]))

    def _above(self, radius: float) -> bool:
        x, y, _ = self._flight.position
        return math.hypot(self._target[0] - x, self._target[1] - y) < radius

    def _at_height(self) -> bool:
        return abs(self._flight.position[2] - self._target[2]) < self._flight.parameters["NAV_MC_ALT_RAD"]

    def _waited(self, seconds: float) -> bool:
        flight = self._flight
        if self._arrived_ns < 0:
            self._arrived_ns = flight.now_ns
        return not (flight.now_ns - self._arrived_ns < seconds * 1e9)
