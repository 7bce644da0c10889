"""The devices that a checklist reads: each is opened on first use and then kept."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from hil.assembly.rig import Rig
from hil.bench.camera import CameraBench, Quat
from hil.bench.camera_device import DeviceBench
from hil.bench.car import CarBench
from hil.bench.crazyflie import (
    CrazyflieBench,
    CrazyflieReport,
    CrazyflieTrial,
    SimulatedCrazyflie,
    live_crazyflie,
    read_crazyflie,
    try_crazyflie,
)
from hil.bench.failsafes import TrialReport, try_failsafes
from hil.bench.mocap import CurveReport, MocapReport, measure_curve, measure_mocap
from hil.bench.reading import NotApplicable, Unavailable
from hil.bench.vehicle import Bench, GroundReport, SimulatedBench, live_bench, read_ground
from kernel.rotations import swap_attitude
from scenarios.draw import Drawn, draw
from scenarios.spec import Scenario
from vehicle.px4.driver.arming import Arming, Identity
from vehicle.quadrotor.airframe import Airframe, load_airframe

if TYPE_CHECKING:
    from hil.bench.ground_health import Health
    from hil.bus.clock import Clock

T = TypeVar("T")
_CRAZYFLIES = ("crazyflie-sim", "crazyflie")
_STALE_S = 5.0  # a report of a real device older than this is taken anew


@dataclass
class Context:
    """Rig, policy and scenario of one checklist. `out`: where runs are recorded; `run`: the run to examine.

    `endpoint` and `keys`: the bus of a rig on several hosts.
    """

    rig_name: str
    rig: Rig
    policy: str
    scenario: Scenario
    out: Path
    run: Path | None = None
    endpoint: str = ""
    keys: Path | None = None
    _kept: dict[str, Any] = field(default_factory=dict)
    _reported_s: float = 0.0
    _identity: Identity | None = None
    _parameters: dict[str, float] = field(default_factory=dict)  # that checks have read so far

    @cached_property
    def airframe(self) -> Airframe:
        """The rig's airframe."""
        return load_airframe(self.rig.vehicle.airframe)

    @cached_property
    def drawn(self) -> Drawn:
        """Numbers of the simulated devices."""
        return draw(self.scenario, 0)

    def ground(self) -> GroundReport:
        """The autopilot, on the ground and disarmed."""
        live = not self.rig.vehicle.simulated
        bench: Bench = self._of("vehicle", "bench", self._bench, ("sim", "mavlink", "hitl"))
        if live and time.monotonic() - self._reported_s > _STALE_S:  # the report may be old by now
            self._kept.pop("ground", None)
        if "ground" not in self._kept:
            self._kept["ground"] = read_ground(bench)
            self._reported_s = time.monotonic()
        return self._kept["ground"]

    def identity(self) -> Identity:
        """Which autopilot it is. Raises Unavailable if it does not tell, or is not the one that was read before."""
        self.ground()
        found = self._kept["bench"].identity()
        if self._identity not in (None, found):
            raise Unavailable(f"another autopilot answers: {found.text}; before it was {self._identity.text}")
        self._identity = found
        return found

    def autopilot(self) -> dict[str, Any]:
        """`Arming.table` of the real autopilot and of all its parameters that were read; empty if it is simulated.

        Raises Unavailable if the autopilot does not tell which one it is.
        """
        if self.rig.vehicle.simulated:
            return {}
        if self.rig.vehicle.kind == "crazyflie":
            report = self.crazyflie()
            return Arming(report.identity, report.parameters).table()
        identity = self.identity()
        bench: Bench = self._kept["bench"]
        held = {**self._parameters, **bench.link.parameters, **bench.read}
        return Arming(identity, {name: value for name, value in held.items() if math.isfinite(value)}).table()

    def _bench(self) -> Bench:
        if self.rig.vehicle.simulated:
            return SimulatedBench(self.airframe, self.rig, self.drawn)
        return live_bench(self.airframe, self.rig)

    def trial(self) -> TrialReport:
        """A test flight of the failsafes: simulated vehicles only."""
        if not self.rig.vehicle.simulated:
            raise Unavailable("a trial flight is for simulated vehicles only: try it by hand, under supervision")
        return self._of("vehicle", "trial", lambda: try_failsafes(self.airframe, self.rig, self.drawn))

    def crazyflie(self) -> CrazyflieReport:
        """A Crazyflie, on the ground and not armed."""
        bench: CrazyflieBench = self._of("vehicle", "bench", self._crazyflie_bench, _CRAZYFLIES)
        if not self.rig.vehicle.simulated and time.monotonic() - self._reported_s > _STALE_S:
            self._kept.pop("ground", None)
        if "ground" not in self._kept:
            self._kept["ground"] = read_crazyflie(bench)
            self._reported_s = time.monotonic()
        return self._kept["ground"]

    def _crazyflie_bench(self) -> CrazyflieBench:
        if self.rig.vehicle.simulated:
            return SimulatedCrazyflie(self.airframe, self.rig, self.drawn)
        return live_crazyflie(self.airframe, self.rig)

    def crazyflie_trial(self) -> CrazyflieTrial:
        """A test flight of a simulated Crazyflie."""
        parts = (self.airframe, self.rig, self.drawn)
        return self._of("vehicle", "trial", lambda: try_crazyflie(*parts), ("crazyflie-sim",))

    def car(self) -> CarBench:
        """The ground car in CAN mode."""
        return self._of("groundcar", "car", lambda: CarBench.open(self.rig, self.drawn), ("sim", "can"))

    def camera(self) -> CameraBench | DeviceBench:
        """The camera on its stand in front of the board."""
        parts = (self.scenario, self.rig, self.airframe, self.drawn)
        kinds = ("sim", "v4l2", "gstreamer", "mcap")
        if self.rig.camera.kind == "sim":
            return self._of("camera", "camera", lambda: CameraBench(*parts))
        return self._of("camera", "camera", lambda: DeviceBench(*parts, self._attitude), kinds)

    def _attitude(self) -> Quat | None:
        """Of a real vehicle on its stand, from its autopilot (w, x, y, z); None without one."""
        if self.rig.vehicle.simulated:
            return None
        return swap_attitude(self.ground().latest("ODOMETRY").q)

    def mocap(self) -> MocapReport:
        """A second of motion capture."""
        parts = (self.rig, self.airframe, self.drawn, self.scenario)
        return self._of("mocap", "mocap", lambda: measure_mocap(*parts), ("sim", "vrpn"))

    def curve(self) -> CurveReport:
        """A short drive of the car, by motion capture and by its wheels."""
        if self.rig.mocap.kind == "sim":
            raise NotApplicable("a simulated motion capture does not see a car on the bench")
        return self._of("mocap", "curve", lambda: measure_curve(self.rig.mocap, self.car()), ("vrpn",))

    def clocks(self) -> Clock:
        """This host's clocks against those of the host with the bus's hub."""
        if not self.endpoint:
            raise NotApplicable("one host has one clock; for several give --endpoint, the hub of the other")
        from hil.bench.bus import compare_clocks

        if "clocks" not in self._kept:
            self._kept["clocks"] = compare_clocks(self.endpoint, self.keys)
        return self._kept["clocks"]

    def station(self) -> Health:
        """What a real autopilot says of itself on the ground station's link."""
        slot = self.rig.vehicle
        if not slot.ground_url:
            raise NotApplicable("the rig names no ground station's link (ground_url under [vehicle])")
        from hil.bench.ground import GroundStation

        if "station" not in self._kept:
            with GroundStation(slot.ground_url, slot.system) as station:
                self._kept["station"] = station.health()
        return self._kept["station"]

    def forget(self) -> None:
        """Close the devices, so that a repeated check reads them anew."""
        if isinstance(bench := self._kept.get("bench"), Bench):
            self._parameters |= bench.read
        for name in ("bench", "car"):
            if name in self._kept:
                self._kept[name].close()
        self._kept.clear()

    def _of(self, slot: str, name: str, make: Callable[[], T], kinds: tuple[str, ...] = ("sim",)) -> T:
        kind = getattr(self.rig, slot).kind
        if kind not in kinds:
            raise Unavailable(f'this program cannot read a {slot} of kind "{kind}" for a checklist yet')
        if name not in self._kept:
            self._kept[name] = make()
        return self._kept[name]
