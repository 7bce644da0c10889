"""What the parts of the software PX4 share: the flight's state, its kernel rows, callbacks for texts and answers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vehicle.px4 import protocol as px4
from vehicle.px4.place import ORIGIN_ALTITUDE, geodetic, local
from vehicle.px4.sim.params import Parameters
from vehicle.px4.sim.rows import control, estimate, situation
from vehicle.px4.sim.services.plan import Plan
from vehicle.quadrotor import state_row


class Command(NamedTuple):
    """A MAVLink command that waits for the commander, with the port and ids to answer to."""

    port: str
    system: int
    component: int
    number: int
    params: tuple[float, ...]


@dataclass
class Setpoint:
    """The OFFBOARD stream: when a set-point last came, and since when there was no loss (PX4 ns; -1: never)."""

    kind: str = ""  # rates, attitude, position
    last_ns: int = -1
    running_since_ns: int = -1


@dataclass
class Flight:
    """State of one software PX4. Times are nanoseconds since its boot; positions ENU, m."""

    parameters: Parameters
    row: np.ndarray
    params: np.ndarray
    control: np.ndarray = field(default_factory=lambda: np.full(control.LENGTH, np.nan))
    estimate: np.ndarray = field(default_factory=lambda: np.zeros(estimate.LENGTH))
    situation: np.ndarray = field(default_factory=lambda: np.zeros(situation.LENGTH))
    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    now_ns: int = 0

    ready: bool = False  # pre-arm checks passed
    armed: bool = False
    armed_ns: int = -1
    landed: bool = True
    took_off: bool = False  # since arming
    landed_ns: int = 0
    contact: bool = False  # on the ground with a descent commanded: thrust is cut in two stages
    contact_ns: int = -1
    terminated: bool = False
    intended: int = px4.HOLD  # the mode that the user requested
    active: int = px4.HOLD  # the mode that runs
    after_disarm: int = px4.HOLD
    mode_since_ns: int = 0
    failsafe: bool = False
    landing: bool = False  # descending to land, in LAND or at the end of RTL
    setpoint: Setpoint = field(default_factory=Setpoint)
    position_valid: bool = False
    global_valid: bool = False
    home: tuple[float, float, float] | None = None  # ENU
    home_ns: int = 0
    discharge: float = 0.0  # 0 full .. 1 at SIM_BAT_MIN_PCT
    plan: Plan = field(default_factory=Plan)
    text: Callable[..., None] = lambda *_, **__: None
    acknowledge: Callable[[Command, int], None] = lambda *_: None

    @property
    def now_s(self) -> float:
        """Seconds since boot."""
        return self.now_ns * 1e-9

    @property
    def position(self) -> tuple[float, float, float]:
        """Estimated position, ENU."""
        e = self.estimate
        return float(e[estimate.POSITION]), float(e[estimate.POSITION + 1]), float(e[estimate.POSITION + 2])

    @property
    def attitude(self) -> tuple[float, float, float, float]:
        """Estimated attitude: quaternion w x y z, ENU from FLU."""
        w, x, y, z = self.estimate[estimate.ATTITUDE : estimate.ATTITUDE + 4].tolist()
        return w, x, y, z

    @property
    def true_position(self) -> tuple[float, float, float]:
        """Where the vehicle really is, ENU."""
        x, y, z = self.row[state_row.P : state_row.P + 3].tolist()
        return x, y, z

    @property
    def velocity(self) -> tuple[float, float, float]:
        """Estimated velocity, ENU."""
        e = self.estimate
        return float(e[estimate.VELOCITY]), float(e[estimate.VELOCITY + 1]), float(e[estimate.VELOCITY + 2])

    def stream_fresh(self) -> bool:
        """True if an OFFBOARD set-point younger than COM_OF_LOSS_T has been received."""
        age = self.now_ns - self.setpoint.last_ns
        return self.setpoint.last_ns >= 0 and age <= self.parameters["COM_OF_LOSS_T"] * 1e9

    def altitude(self, z: float) -> float:
        """Altitude above mean sea level (m) of a height in the world."""
        return ORIGIN_ALTITUDE + z - self.origin[2]

    def height(self, altitude: float) -> float:
        """Height in the world (m) of an altitude above mean sea level."""
        return altitude - ORIGIN_ALTITUDE + self.origin[2]

    def place(self, latitude: float, longitude: float) -> tuple[float, float]:
        """World position (m) of a latitude and a longitude in deg."""
        east, north = local(latitude, longitude)
        return east + self.origin[0], north + self.origin[1]

    def geodetic(self, x: float, y: float) -> tuple[int, int]:
        """Latitude and longitude in 1e-7 deg of a world position."""
        return geodetic(x - self.origin[0], y - self.origin[1])
