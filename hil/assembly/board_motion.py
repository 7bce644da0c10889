"""A scenario's board in the kernels' terms: path, speed law and change of path as one aux row, and the start."""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_motion as motion
from groundcar.motion import board_row, motion_row, splines
from groundcar.motion import paths as trajectories
from groundcar.motion import speed_laws as laws
from groundcar.motion.sines import Sines
from hil.assembly.recorded_motion import recorded_motion
from kernel.random import stream
from scenarios import spec
from scenarios.board_laws import HeightSine, HeightSines, InclinationSine, InclinationSines, RecordedLaw
from scenarios.draw import Drawn, hover_pose

_STEP = 0.01  # s
_SINES = (HeightSine, HeightSines, InclinationSine, InclinationSines)


class Ride:
    """The board's height and inclination over time, about those that the scenario sets."""

    def __init__(self, scenario: spec.Scenario) -> None:
        """Raises ConfigError for a recorded law without a usable recording."""
        board = scenario.board
        self._set = (board.height, math.radians(board.inclination_deg))
        self._recorded = recorded_motion(scenario) if isinstance(scenario.path, spec.RecordedPath) else None
        self._laws = (board.height_law, board.inclination_law)
        self._sines = tuple(Sines(law.terms if isinstance(law, _SINES) else ()) for law in self._laws)

    def at(self, seconds: float, since_start: float | None) -> tuple[float, float, float]:
        """(height m, its rate m/s, inclination rad) at `seconds` of the run; `since_start`: s since the car set off."""
        moved = [law.at(seconds) for law in self._sines]
        found = [(base + value, rate) for base, (value, rate) in zip(self._set, moved, strict=True)]
        if self._recorded is not None:
            row = self._recorded.at(since_start or 0.0)
            ahead = self._recorded.at((since_start or 0.0) + _STEP)
            if isinstance(self._laws[0], RecordedLaw):
                found[0] = float(row[board_row.Z]), float(ahead[board_row.Z] - row[board_row.Z]) / _STEP
            if isinstance(self._laws[1], RecordedLaw):
                found[1] = float(row[board_row.INCLINATION]), 0.0
        return found[0][0], found[0][1], found[1][0]

    @property
    def steepest(self) -> float:
        """The largest inclination, rad."""
        return self._set[1] + self._sines[1].most


def path_row(scenario: spec.Scenario, drawn: Drawn) -> tuple[int, np.ndarray]:
    """Kind and row of the scenario's path; a spline's control points come from the seed."""
    path = scenario.path
    kind = trajectories.KINDS[path.kind]
    if isinstance(path, spec.StaticPath):
        return kind, trajectories.static_path(path.x, path.y, math.radians(path.heading_deg))
    if isinstance(path, spec.LinePath):
        return kind, trajectories.line_path(path.amplitude)
    if isinstance(path, spec.RacetrackPath):
        return kind, trajectories.racetrack_path(path.radius, path.straight)
    if isinstance(path, spec.Figure8Path):
        return kind, trajectories.figure8_path(path.scale)
    if isinstance(path, spec.ArcPath):
        return kind, trajectories.arc_path(path.radius, 1 if path.turn == "left" else -1)
    assert isinstance(path, spec.SplinePath)
    row = trajectories.spline_path(np.zeros((path.control_points, 2)))
    law, speed = speed_row(scenario, drawn)
    splines.random_spline(
        stream(drawn.spline_seed),
        row,
        laws.speed_peak(law, speed),
        path.control_points,
        *path.radius,
        path.turn_rate_limit,
    )
    return kind, row


def speed_row(scenario: spec.Scenario, drawn: Drawn) -> tuple[int, np.ndarray]:
    """Kind and row of the scenario's speed law."""
    speed = scenario.speed
    assert not isinstance(speed, spec.RecordedSpeed)
    kind = laws.KINDS[speed.kind]
    if isinstance(speed, spec.ConstantSpeed):
        return kind, laws.constant_speed(speed.speed)
    if isinstance(speed, spec.OuSpeed):
        return kind, laws.ou_speed(speed.speed, speed.tau, speed.sigma)
    if isinstance(speed, spec.CosineSpeed):
        return kind, laws.cosine_speed(speed.minimum, speed.maximum, speed.period, drawn.speed_phase)
    return kind, laws.scheduled_speed(speed.first, speed.second, speed.ramp)


def motion_aux(scenario: spec.Scenario, drawn: Drawn) -> np.ndarray:
    """The aux row of `groundcar.motion.board_motion` for the whole scenario."""
    then = scenario.path.then if isinstance(scenario.path, spec.SplinePath) else None
    radius = 0.0 if then is None else then.radius * (1.0 if then.turn == "left" else -1.0)
    return motion.motion_aux(
        *path_row(scenario, drawn), *speed_row(scenario, drawn), change_time=drawn.switch_time, arc_radius=radius
    )


def start_parameter(scenario: spec.Scenario, drawn: Drawn, aux: np.ndarray) -> float:
    """Path parameter u at which the car waits."""
    if isinstance(scenario.path, spec.LinePath):
        return math.radians(scenario.path.phase_deg)
    kind = int(aux[motion_row.PATH_KIND])
    return drawn.lap_start * trajectories.path_lap(kind, aux[motion_row.PATH : motion_row.DIM])


def start_board(scenario: spec.Scenario, drawn: Drawn) -> np.ndarray:
    """Board row (8,) of the waiting car."""
    if isinstance(scenario.path, spec.RecordedPath):
        return recorded_motion(scenario).at(0.0)
    aux, row = motion_aux(scenario, drawn), np.zeros(8)
    u = start_parameter(scenario, drawn, aux)
    motion.motion_reset(row, aux, u, scenario.board.height, math.radians(scenario.board.inclination_deg), False)
    return row


def hover_start(scenario: spec.Scenario, drawn: Drawn, accel_limit: float) -> tuple[float, float, float, float]:
    """Where the drone hovers (x, y, z m, yaw rad): about the board at the scenario's anchor.

    For an anchor at the attempt's start the reference is driven through the lead from rest within `accel_limit` m/s^2.
    """
    row = start_board(scenario, drawn)
    if scenario.start.anchor == "attempt_start" and isinstance(scenario.path, spec.RecordedPath):
        row = recorded_motion(scenario).at(scenario.car.lead)
    elif scenario.start.anchor == "attempt_start":
        aux = motion_aux(scenario, drawn)
        aux[motion_row.ACCEL_LIMIT] = accel_limit
        motion.motion_reset(row, aux, row[board_row.U], row[board_row.Z], row[board_row.INCLINATION], False)
        speed_stream = stream(drawn.speed_seed)
        for _ in range(round(scenario.car.lead / _STEP)):
            motion.motion_step(row, aux, _STEP, speed_stream)
    return hover_pose(scenario, drawn, float(row[board_row.X]), float(row[board_row.Y]), float(row[board_row.HEADING]))
