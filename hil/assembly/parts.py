"""What the nodes of one run are built from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

from groundcar.scout.params import load_scout
from hil.assembly.board_motion import Ride, hover_start
from hil.assembly.rig import Rig
from policies.task.interface import FlyingPolicy
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.quadrotor import airframe as af


class Wires(Protocol):
    """The host's wires: the driver's and the simulated device's end of each, opened when asked for.

    `vehicle_system`: MAV_SYS_ID of the autopilot at the other end of `vehicle_link`."""

    def vehicle_system(self) -> int: ...
    def vehicle_link(self) -> Any: ...
    def vehicle_device(self) -> Any: ...
    def car_link(self) -> Any: ...
    def car_device(self) -> Any: ...


@dataclass(frozen=True)
class Parts:
    """One run's scenario, rig and drawn numbers, and what its host provides.

    `stopwatch` (ns) is given by hosts in which a detection costs real time. `unix_ns` is the date (Unix time) at which
    the run begins, for signatures on a real vehicle's link; 0 in lockstep, in a replay and while warming up.
    """

    scenario: Scenario
    rig: Rig
    drawn: Drawn
    make_policy: Callable[[], FlyingPolicy]
    wires: Wires
    stopwatch: Callable[[], int] | None = None
    unix_ns: int = 0

    @cached_property
    def frame(self) -> af.Airframe:
        return af.load_airframe(self.rig.vehicle.airframe)

    @property
    def inclination(self) -> float:
        """The board's set angle, rad."""
        return math.radians(self.scenario.board.inclination_deg)

    @property
    def steepest(self) -> float:
        """The board's largest inclination during the run, rad."""
        return Ride(self.scenario).steepest

    @property
    def hover_start(self) -> tuple[float, float, float, float]:
        """Where the vehicle hovers before the attempt: x, y, z m (world), yaw rad."""
        return hover_start(self.scenario, self.drawn, load_scout().follower.acceleration)
