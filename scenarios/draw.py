"""Random draws of a run: `draw(spec, seed)` turns every range and distribution of a scenario into numbers.

Each quantity has a random stream of its own, keyed by (seed, scenario name, quantity), so that adding one never shifts
the others, and two scenarios with one seed differ. Equal spec and seed give equal numbers on any machine.
"""

from __future__ import annotations

import dataclasses
import math
import zlib
from dataclasses import dataclass
from typing import Any

from kernel.random import next_uint64, normal, stream, uniform
from scenarios.spec import Scenario

MAX_SEED = 2**32 - 1

Vec3 = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Drawn:
    """One run's concrete numbers. Angles in rad; factors multiply the nominal value.

    Seeds are keys for `kernel.random.stream(seed)`, one for each component that draws numbers during the run.
    """

    scenario: str
    seed: int
    # start: polar about the board, see scenarios.spec.Start
    distance: float
    altitude: float
    azimuth: float
    # motion
    lap_start: float  # 0..1 of a lap along a closed path; 0 for static and line
    switch_time: float  # s after the car's start at which path.then begins; inf if it never does
    speed_phase: float  # rad, of a cosine speed law
    # airframe and camera
    mass_factor: float
    inertia_factor: float
    thrust_to_weight_factor: float
    thrust_gain: float  # achieved over asked thrust, beyond what the factors explain
    drag_factor: float
    camera_tilt_offset: float  # the mount's true tilt minus the nominal one, positive further down
    camera_tilt_error: float  # calibrated minus true tilt: an error unknown to the detector
    # bias of the visual noise model (camera model only)
    vision_position_bias: Vec3  # m, world
    vision_orientation_bias: Vec3  # rad, rotation vector in the board frame
    # seeds
    spline_seed: int
    speed_seed: int
    wind_seed: int
    vision_seed: int
    image_seed: int
    vehicle_seed: int
    car_seed: int
    mocap_seed: int

    def table(self) -> dict[str, Any]:
        """All numbers as a plain table for a manifest; an infinite time is None."""
        values = dataclasses.asdict(self)
        return {name: None if value == math.inf else value for name, value in values.items()}


def draw(spec: Scenario, seed: int) -> Drawn:
    """Every random number of the run (`spec`, `seed`). Raises ValueError unless 0 <= seed <= MAX_SEED."""
    if not isinstance(seed, int) or isinstance(seed, bool) or not 0 <= seed <= MAX_SEED:
        raise ValueError(f"seed {seed!r} is out of range: use a whole number from 0 to {MAX_SEED}")
    scenario_key = zlib.crc32(spec.name.encode())

    def own(quantity: str):
        return stream(seed, scenario_key, zlib.crc32(quantity.encode()))

    def between(quantity: str, low: float, high: float) -> float:
        return float(uniform(own(quantity), low, high))

    def factor(quantity: str, half_width: float) -> float:
        return between(quantity, 1.0 - half_width, 1.0 + half_width)

    def sub_seed(quantity: str) -> int:
        return int(next_uint64(own(quantity))) >> 1  # fits an int64

    start, random = spec.start, spec.randomisation
    then = getattr(spec.path, "then", None)
    lap = getattr(spec.path, "lap_start", (0.0, 0.0))
    phase = getattr(spec.speed, "phase_deg", (0.0, 0.0))
    altitude = between("altitude", *start.altitude)
    tilt = math.radians(random.camera_tilt_deg)
    return Drawn(
        scenario=spec.name,
        seed=seed,
        distance=between("distance", start.nearest(altitude), start.distance[1]),
        altitude=altitude,
        azimuth=math.radians(between("azimuth", *start.azimuth_deg)),
        lap_start=between("lap_start", *lap),
        switch_time=between("switch_time", *then.after) if then else math.inf,
        speed_phase=math.radians(between("speed_phase", *phase)),
        mass_factor=factor("mass", random.mass),
        inertia_factor=factor("inertia", random.inertia),
        thrust_to_weight_factor=factor("thrust_to_weight", random.thrust_to_weight),
        thrust_gain=factor("thrust_gain", random.thrust_gain),
        drag_factor=factor("drag", random.drag),
        camera_tilt_offset=between("camera_tilt", -tilt, tilt),
        camera_tilt_error=math.radians(random.camera_calibration_deg) * float(normal(own("camera_calibration"))),
        vision_position_bias=_gaussian(own("vision_position_bias"), random.vision_position_bias),
        vision_orientation_bias=_rotation(
            own("vision_orientation_bias"), math.radians(random.vision_orientation_bias_deg)
        ),
        spline_seed=sub_seed("spline"),
        speed_seed=sub_seed("speed"),
        wind_seed=sub_seed("wind"),
        vision_seed=sub_seed("vision"),
        image_seed=sub_seed("image"),
        vehicle_seed=sub_seed("vehicle"),
        car_seed=sub_seed("car"),
        mocap_seed=sub_seed("mocap"),
    )


def hover_pose(spec: Scenario, drawn: Drawn, x: float, y: float, heading: float) -> tuple[float, float, float, float]:
    """Hover pose (x, y, z in m, yaw in rad, world) for a car at (x, y, heading) at `start.anchor`.

    Behind the board by `distance`, turned by `azimuth` (counter-clockwise from above), `altitude` above its centre.
    """
    bearing = heading + math.pi + drawn.azimuth  # from the board to the vehicle
    yaw = bearing + math.pi if spec.start.yaw == "board" else heading
    return (
        x + drawn.distance * math.cos(bearing),
        y + drawn.distance * math.sin(bearing),
        spec.board.height + drawn.altitude,
        math.remainder(yaw, 2 * math.pi),
    )


def _gaussian(state, sigma: float) -> Vec3:
    return (sigma * float(normal(state)), sigma * float(normal(state)), sigma * float(normal(state)))


def _rotation(state, sigma: float) -> Vec3:
    """A rotation by N(0, sigma) about a direction uniform on the sphere (paper: systematic bias)."""
    z = float(uniform(state, -1.0, 1.0))
    around = float(uniform(state, 0.0, 2 * math.pi))
    angle = sigma * float(normal(state))
    ring = math.sqrt(1.0 - z * z)
    return (angle * ring * math.cos(around), angle * ring * math.sin(around), angle * z)
