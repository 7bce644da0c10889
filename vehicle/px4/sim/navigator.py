"""What PX4's AUTO modes do: hold, take-off, land, return, mission. Writes set-points into the control row."""

from __future__ import annotations

import math

import numpy as np

from kernel.rotations import yaw
from vehicle.px4 import protocol as px4
from vehicle.px4.sim.cascade import reset_cascade
from vehicle.px4.sim.mission_flight import MissionFlight
from vehicle.px4.sim.rows import control, situation
from vehicle.px4.sim.state import Flight
from vehicle.px4.sim.takeoff import RAMP_DELAY_NS, spooled_up, takeoff_ramp

CRAWL_HEIGHT = 0.75  # m above ground; below it the descent is limited to MPC_LAND_CRWL (recorded)
CLIMB_SHARE = 0.5  # of MPC_TKO_SPEED, where the ceiling of take-offs ends (recorded and measured)
RTL_DESCENT_SHARE = 0.86  # of MPC_LAND_SPEED at which recorded returns descend at their end
RTL_ANNOUNCE_S = 0.055
RTL_RETURN_S = 2.4  # of hovering before "land at destination" when home is near (recorded)


class Navigator:
    """Follows the active mode: `enter` when it changes, `update` at the commander's rate."""

    def __init__(self, flight: Flight) -> None:
        self._flight = flight
        self._target = np.zeros(3)
        self._mission = MissionFlight(flight, self._target)
        self._leg = False  # in Hold: on the way to a place that a client asked for
        self._takeoff_ns = -1
        self._keep_target = False  # Hold after take-off keeps the take-off altitude
        self._phase = ""
        self._announced = False

    def enter(self, mode: int) -> None:
        """The mode has just become active."""
        flight, c = self._flight, self._flight.control
        flight.landing = False
        self._phase, self._announced, self._leg = "", False, False
        if px4.split_custom_mode(mode)[0] not in (px4.Main.AUTO, px4.Main.ALTCTL):
            return
        if c[control.MODE] != control.POSITION:
            reset_cascade(c, flight.estimate)
        x, y, z = flight.position
        vx, vy, vz = flight.velocity
        brake = 1.0 / float(flight.parameters["MPC_ACC_HOR"])
        speed = math.hypot(vx, vy)
        if not (mode == px4.HOLD and self._keep_target):
            self._target[:] = (x + 0.5 * vx * speed * brake, y + 0.5 * vy * speed * brake, z + 0.2 * vz)
        self._keep_target = False
        c[control.MODE], c[control.SMOOTH] = control.POSITION, 1.0
        c[control.POS_SP : control.YAW_RATE_SP + 1] = math.nan
        c[control.YAW_SP] = yaw(flight.attitude)
        c[control.RAMP] = math.inf
        self._takeoff_ns = -1
        if mode == px4.TAKEOFF:
            base = flight.home[2] if flight.home else z
            self._target[:] = (x, y, max(z, base + float(flight.parameters["MIS_TAKEOFF_ALT"])))
        if mode == px4.RTL:
            self._phase = "return"
        if mode == px4.MISSION:
            self._mission.enter()

    def reposition(self, place: tuple[float, float], height: float, heading: float) -> None:
        """Hold there instead: m, world, rad; what is NaN stays. No effect on the ground."""
        flight = self._flight
        if flight.active != px4.HOLD or not flight.armed or flight.landed:
            return
        self._leg = True
        if not any(map(math.isnan, place)):
            self._target[:2] = place
        if not math.isnan(height):
            self._target[2] = height
        if not math.isnan(heading):
            flight.control[control.YAW_SP] = heading

    def update(self) -> int | None:
        """Refresh the set-points; returns the mode that follows when the present one is complete, else None."""
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        mode = flight.active
        main = px4.split_custom_mode(mode)[0]
        if main not in (px4.Main.AUTO, px4.Main.ALTCTL):
            return None
        following = self._mission.update() if mode == px4.MISSION else None
        if following is not None:
            self._keep_target = following == px4.HOLD
            return following
        c[control.MODE] = control.POSITION if flight.armed and not self._idle() else control.OFF
        c[control.MAX_XY], c[control.MAX_TILT] = p["MPC_XY_CRUISE"], math.radians(p["MPC_TILTMAX_AIR"])
        c[control.MAX_UP], c[control.MAX_DOWN] = p["MPC_Z_V_AUTO_UP"], p["MPC_Z_V_AUTO_DN"]
        c[control.POS_SP : control.POS_SP + 3] = self._target
        c[control.VEL_SP : control.ACC_SP + 3] = math.nan
        if main == px4.Main.ALTCTL:
            c[control.POS_SP : control.POS_SP + 2] = (
                math.nan
            )  # level without position control: drifts, holds its height
            return None
        if mode == px4.TAKEOFF:
            return self._take_off()
        if mode == px4.LAND:
            self._descend()
        elif mode == px4.RTL:
            self._return_home()
        elif mode == px4.MISSION:
            self._fly_mission()
        elif self._leg:
            c[control.MAX_XY] = self._cruise(math.nan)
        return None

    def _fly_mission(self) -> None:
        c, mission = self._flight.control, self._mission
        c[control.YAW_SP], c[control.MAX_XY] = mission.heading, self._cruise(mission.cruise)
        if mission.rising:
            self._rise()
            return
        c[control.RAMP] = math.inf
        if mission.landing:
            self._descend()

    def _cruise(self, wanted: float) -> float:
        """Speed (m/s) toward the target: MPC_XY_CRUISE or `wanted`, braking in time for its end."""
        p, (x, y, _) = self._flight.parameters, self._flight.position
        left = math.hypot(self._target[0] - x, self._target[1] - y)
        most = float(p["MPC_XY_CRUISE"]) if math.isnan(wanted) else min(wanted, float(p["MPC_XY_VEL_MAX"]))
        return min(most, braking_speed(left, float(p["MPC_ACC_HOR"]), p["MPC_JERK_AUTO"]))

    def _idle(self) -> bool:
        """On the ground without a take-off, or thrust cut after ground contact."""
        flight = self._flight
        if flight.landed:
            rising = flight.active == px4.TAKEOFF or (flight.active == px4.MISSION and self._mission.rising)
            return not (rising and spooled_up(flight))
        cut_s = 0.7 * float(flight.parameters["LNDMC_TRIG_TIME"])
        return flight.contact and flight.now_ns - flight.contact_ns > cut_s * 1e9

    def _take_off(self) -> int | None:
        flight = self._flight
        self._rise()
        if flight.took_off and flight.position[2] > self._target[2] - float(flight.parameters["NAV_MC_ALT_RAD"]):
            self._keep_target = True
            return px4.HOLD
        return None

    def _rise(self) -> None:
        """Leave the ground, and climb to the target's height."""
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        if flight.took_off and self._takeoff_ns < 0:
            c[control.RAMP] = math.inf  # take-off commanded in the air
            c[control.MAX_UP] = self._climb_rate(flight.mode_since_ns)
        elif spooled_up(flight):
            if self._takeoff_ns < 0:
                self._takeoff_ns = flight.now_ns
                reset_cascade(c, flight.estimate)
            c[control.RAMP] = takeoff_ramp(flight, self._takeoff_ns, CLIMB_SHARE * float(p["MPC_TKO_SPEED"]))
            c[control.MAX_UP] = self._climb_rate(self._takeoff_ns + RAMP_DELAY_NS)

    def _climb_rate(self, since_ns: int) -> float:
        """Of PX4's trajectory to the take-off altitude (m/s): slow below MPC_LAND_ALT1, braking in time for its end."""
        flight, p = self._flight, self._flight.parameters
        left = max(0.0, float(self._target[2]) - flight.position[2])
        if flight.true_position[2] - float(flight.situation[situation.GROUND]) >= p["MPC_LAND_ALT1"]:
            return min(float(p["MPC_Z_V_AUTO_UP"]), braking_speed(left, float(p["MPC_ACC_UP_MAX"]), p["MPC_JERK_AUTO"]))
        most = float(p["MPC_TKO_SPEED"])
        acceleration = min(float(p["MPC_ACC_UP_MAX"]), most / max(0.1, float(p["MPC_TKO_RAMP_T"])))
        risen = acceleration * max(0, flight.now_ns - since_ns) * 1e-9
        return min(most, risen, braking_speed(left, acceleration, p["MPC_JERK_AUTO"]))

    def _descend(self, share_of_speed: float = 1.0) -> None:
        flight, c, p = self._flight, self._flight.control, self._flight.parameters
        flight.landing = True
        height = flight.true_position[2] - float(flight.situation[situation.GROUND])  # the distance sensor's
        low, high = float(p["MPC_LAND_ALT2"]), float(p["MPC_LAND_ALT1"])
        slow, fast = share_of_speed * float(p["MPC_LAND_SPEED"]), float(p["MPC_Z_V_AUTO_DN"])
        share = min(1.0, max(0.0, (height - low) / max(0.1, high - low)))
        speed = slow + share * (fast - slow)
        if height < CRAWL_HEIGHT:
            speed = min(speed, float(p["MPC_LAND_CRWL"]))
        c[control.POS_SP + 2] = math.nan
        c[control.VEL_SP + 2] = -speed

    def _return_home(self) -> None:
        flight, p = self._flight, self._flight.parameters
        home = flight.home or flight.position
        x, y, z = flight.position
        distance = math.hypot(home[0] - x, home[1] - y)
        since = (flight.now_ns - flight.mode_since_ns) * 1e-9
        if self._phase == "return":
            if not self._announced and since >= RTL_ANNOUNCE_S:
                self._announced = True
                if distance > p["RTL_MIN_DIST"]:
                    self._target[2] = max(z, home[2] + float(p["RTL_RETURN_ALT"]))
                above = math.ceil(self._target[2] - home[2])
                height = math.ceil(flight.altitude(float(self._target[2])))
                flight.text(6, f"RTL: start return at {height} m ({above} m above destination)\t", 0x01522694)
            if self._announced and z > self._target[2] - float(p["NAV_MC_ALT_RAD"]):
                self._target[:2] = home[:2]
                if distance < p["NAV_ACC_RAD"] and since >= RTL_RETURN_S:
                    self._phase = "land"
                    flight.text(6, "RTL: land at destination\t", 0x0102D3AA)
        if self._phase == "land":
            self._descend(RTL_DESCENT_SHARE)


def braking_speed(distance: float, acceleration: float, jerk: float) -> float:
    """The speed (m/s) from which `distance` (m) is enough to come to rest with limited deceleration and jerk, as PX4's
    smoothing of trajectories computes it."""
    b = 4.0 * acceleration * acceleration / jerk
    return 0.5 * (-b + math.sqrt(b * b + 8.0 * acceleration * distance))
