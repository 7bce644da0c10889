"""Drives a real car along a board's motion: the reference moves in time, feedback keeps the car on it.

Law of Kanayama et al. (ICRA 1990) with signed speed, so that it also backs along a reciprocating line: with the error
(along, across, heading) seen from the car,
    speed = v_ff cos(e_heading) + K_along e_along
    turn rate = w_ff + K_across v_ref e_across + K_heading sin(e_heading)
The feed-forward is the reference's twist `lead` seconds ahead, because the car responds with a delay.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from groundcar.motion import board_row, motion_row
from groundcar.motion.board_motion import motion_future, motion_reset, motion_step
from groundcar.motion.kinematics import drive
from groundcar.motion.paths import LINE
from groundcar.motion.recorded import RecordedMotion
from groundcar.scout import gains_row
from groundcar.scout.driver import Command
from groundcar.scout.params import ScoutParams, load_scout
from kernel.clip import clip, command_within
from kernel.jit import njit
from kernel.stamps import later_than_now

TICK_NS = 10_000_000  # the reference moves in steps of 10 ms
MAX_AGE_NS = 200_000_000  # a measurement is predicted no further than this


class CarRef(NamedTuple):
    """Reference of the car at `stamp_ns` (m, rad, m/s signed, rad/s; world)."""

    stamp_ns: int
    x: float
    y: float
    heading: float
    speed: float
    turn_rate: float


@njit
def follow(reference, ahead, x, y, heading, gains):
    """(speed, turn rate) for a car at (x, y, heading); `reference` and `ahead`: board rows (8,), now and `lead` on.

    `gains`: a gains row (groundcar.scout.gains_row).
    """
    dx, dy = reference[board_row.X] - x, reference[board_row.Y] - y
    c, s = math.cos(heading), math.sin(heading)
    turned = reference[board_row.HEADING] - heading
    most = gains[gains_row.CORRECTION]
    correction = clip(gains[gains_row.ALONG] * (c * dx + s * dy), -most, most)
    speed = ahead[board_row.SPEED] * math.cos(turned) + correction
    turn = (
        ahead[board_row.TURN_RATE]
        + gains[gains_row.ACROSS] * reference[board_row.SPEED] * (c * dy - s * dx)
        + gains[gains_row.HEADING] * math.sin(turned)
    )
    fastest, hardest = gains[gains_row.SPEED_LIMIT], gains[gains_row.TURN_RATE_LIMIT]
    return command_within(speed, -fastest, fastest), command_within(turn, -hardest, hardest)


class Follower:
    """Follows one board motion. Equal arguments give equal references; only `aux`'s speed law may draw numbers."""

    def __init__(self, aux: np.ndarray, u: float, stream: np.ndarray, params: ScoutParams | None = None) -> None:
        """`aux`: row of `motion.motion_aux` (copied); `u`: where on the path to start; `stream`: of the speed law.

        The reference starts from rest with the gains' acceleration, unless the aux row has a lower limit of its own;
        on a line that starts near its turning point it is at once the closed form.
        """
        params = params or load_scout()
        gains = params.follower
        self._aux, self._stream, self._row = aux.copy(), stream.copy(), np.zeros(board_row.DIM)
        turning = aux[motion_row.PATH_KIND] == LINE and abs(math.cos(u)) < 0.05
        if not turning:
            self._aux[motion_row.ACCEL_LIMIT] = min(aux[motion_row.ACCEL_LIMIT], gains.acceleration)
        motion_reset(self._row, self._aux, u, 0.0, 0.0, turning)
        self._lead = gains.lead
        self._gains = gains_of(params)
        self._start_ns: int | None = None
        self._ticked_ns = 0

    @property
    def start_pose(self) -> tuple[float, float, float]:
        """Pose of the car before the start: x, y (m), heading (rad)."""
        return float(self._row[board_row.X]), float(self._row[board_row.Y]), float(self._row[board_row.HEADING])

    def preview(self, seconds: float) -> np.ndarray:
        """Board row (8,) of the reference `seconds` after now (before the start: after the start), noise frozen."""
        ticks = max(1, math.ceil(seconds * 1e9 / TICK_NS - 1e-6))
        out = np.zeros((ticks, board_row.DIM))
        motion_future(self._row, self._aux, seconds / ticks, ticks, out)
        return out[-1] if seconds > 0.0 else self._row.copy()

    def start(self, now_ns: int) -> None:
        """The reference starts at `now_ns` (may lie ahead); until then the car is held still. A second call has
        no effect."""
        if self._start_ns is None:
            self._start_ns = self._ticked_ns = now_ns

    def step(
        self,
        now_ns: int,
        x: float,
        y: float,
        heading: float,
        speed: float,
        turn_rate: float,
        stamp_ns: int | None = None,
    ) -> tuple[CarRef, Command]:
        """The reference at `now_ns` and the command for the car whose pose and twist were measured at `stamp_ns`.

        Pose: m, m, rad, world; twist: m/s signed, rad/s. An older measurement is predicted to now. Raises ValueError if
        a number is not finite or the stamp later than now: the caller must drop such a measurement.
        """
        pose = _pose_now(now_ns, x, y, heading, speed, turn_rate, stamp_ns)
        if self._start_ns is None or now_ns < self._start_ns:
            return _shown(now_ns, self._row, standing=True), Command(now_ns, 0.0, 0.0)
        while self._ticked_ns + TICK_NS <= now_ns:
            motion_step(self._row, self._aux, TICK_NS * 1e-9, self._stream)
            self._ticked_ns += TICK_NS
        rest = (now_ns - self._ticked_ns) * 1e-9
        reference, ahead = self.preview(rest), self.preview(rest + self._lead)
        v, w = follow(reference, ahead, *pose, self._gains)
        return _shown(now_ns, reference), Command(now_ns, float(v), float(w))


class RecordedFollower:
    """Follows a recorded motion, with the same law and gains."""

    def __init__(self, motion: RecordedMotion, params: ScoutParams | None = None) -> None:
        params = params or load_scout()
        self._motion, self._lead = motion, params.follower.lead
        self._gains = gains_of(params)
        self._start_ns: int | None = None

    def start(self, now_ns: int) -> None:
        """The motion starts at `now_ns`; a second call has no effect."""
        if self._start_ns is None:
            self._start_ns = now_ns

    def step(
        self,
        now_ns: int,
        x: float,
        y: float,
        heading: float,
        speed: float,
        turn_rate: float,
        stamp_ns: int | None = None,
    ) -> tuple[CarRef, Command]:
        """As `Follower.step`."""
        pose = _pose_now(now_ns, x, y, heading, speed, turn_rate, stamp_ns)
        if self._start_ns is None or now_ns < self._start_ns:
            return _shown(now_ns, self._motion.at(0.0), standing=True), Command(now_ns, 0.0, 0.0)
        since = (now_ns - self._start_ns) * 1e-9
        reference, ahead = self._motion.at(since), self._motion.at(since + self._lead)
        v, w = follow(reference, ahead, *pose, self._gains)
        return _shown(now_ns, reference), Command(now_ns, float(v), float(w))


def gains_of(params: ScoutParams) -> np.ndarray:
    """The gains row (groundcar.scout.gains_row) of a car."""
    gains, limits = params.follower, params.limits
    return np.array([gains.along, gains.across, gains.heading, gains.correction, limits.speed, limits.turn_rate])


def _pose_now(
    now_ns: int, x: float, y: float, heading: float, speed: float, turn_rate: float, stamp_ns: int | None
) -> tuple[float, float, float]:
    """The car's pose, predicted from its measurement to now. Raises ValueError as `Follower.step` says."""
    if not all(map(math.isfinite, (x, y, heading, speed, turn_rate))):
        raise ValueError(f"the car's measured state is {x, y, heading, speed, turn_rate}: drop it, do not follow it")
    if stamp_ns is None:
        return x, y, heading
    if later_than_now(stamp_ns, now_ns):
        raise ValueError(f"the car's measured state is stamped {stamp_ns} ns, later than now, {now_ns} ns: drop it")
    return drive(x, y, heading, speed, turn_rate, min(max(now_ns - stamp_ns, 0), MAX_AGE_NS) * 1e-9)


def _shown(now_ns: int, row: np.ndarray, standing: bool = False) -> CarRef:
    x, y, heading, speed, turn_rate = (
        float(row[i]) for i in (board_row.X, board_row.Y, board_row.HEADING, board_row.SPEED, board_row.TURN_RATE)
    )
    return CarRef(now_ns, x, y, heading, 0.0 if standing else speed, 0.0 if standing else turn_rate)
