"""The board's motion in a training episode: path family, speed law and the car's response, drawn at random.

The paper trains on splines with an Ornstein-Uhlenbeck speed. Added here are its three structured paths, circles, a
board at rest, oscillating speeds as in Hard-I, ramps and changes of path as in Hard-II, and a car that responds with a
delay and overshoots.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row, motion_row, path_row, speed_row
from groundcar.motion.board_motion import motion_reset, motion_step
from groundcar.motion.paths import ARC, FIGURE8, LINE, RACETRACK, SPLINE, STATIC, path_lap
from groundcar.motion.speed_laws import CONSTANT, COSINE, OU, SCHEDULED
from groundcar.motion.splines import random_spline
from kernel.jit import njit
from kernel.random import uniform
from policies.environment import config_row
from policies.environment.config import FAMILIES, LAWS, TICK

BOARD_HEIGHT = 1.5  # m, paper
MOTION_DIM = motion_row.DIM + board_row.DIM  # a motion row, then the board row at the end of the track
_KINDS = (SPLINE, LINE, RACETRACK, FIGURE8, ARC, STATIC)
_SPEED_KINDS = (CONSTANT, OU, COSINE, SCHEDULED)
_FIGURE8_SPEED = 2.4  # m/s: at its tips 1.8 rad/s, the most the car turns
# `oscillating`: Hard-I and wider, with the overshoot of real cars (asked for 1.0 to 2.5 m/s, they drive 0.7 to 2.8).
_SPLINE, _COSINE = FAMILIES.index("spline"), LAWS.index("cosine")
_SLOW, _FAST, _PERIOD = (0.6, 1.2), (2.2, 2.9), (2.5, 4.0)  # m/s, m/s, s
_STEEP = (math.radians(45.0), math.radians(75.0))
# `hard_examples`: boards that are hard by their speed, flat ones and steep ones.
_FLAT_SHARE = 1.0 / 3.0
_FLAT_SPEED, _FLAT_INCLINATION = (2.4, 3.2), (0.0, math.radians(20.0))
_STEEP_SPEED, _STEEP_INCLINATION = (1.2, 2.5), (math.radians(62.0), math.radians(75.0))


@njit
def pick(odds, draw):
    """Index of the first of the cumulated `odds` above `draw`."""
    for k in range(odds.shape[0] - 1):
        if draw < odds[k]:
            return k
    return odds.shape[0] - 1


@njit
def _draw_path(path, kind, speed, rng):
    path[:] = 0.0
    angle = uniform(rng, -math.pi, math.pi)
    path[path_row.HEADING], path[path_row.COS], path[path_row.SIN] = angle, math.cos(angle), math.sin(angle)
    if kind == SPLINE:
        random_spline(rng, path, speed)
    elif kind == LINE:
        path[path_row.SIZE] = 12.0
    elif kind == RACETRACK:
        path[path_row.SIZE], path[path_row.LENGTH] = 4.0, 4.0
    elif kind == FIGURE8:
        path[path_row.SIZE] = 4.0
    elif kind == ARC:
        path[path_row.SIZE] = uniform(rng, max(1.5, speed / 1.2), 10.0)
        path[path_row.TURN] = 1.0 if uniform(rng, 0.0, 1.0) < 0.5 else -1.0


@njit
def _draw_speed(law, row, speed, low, high, rng):
    """Fill a speed row whose largest nominal speed is `speed`, but never below `low`."""
    row[:] = 0.0
    row[speed_row.TAU], row[speed_row.PERIOD], row[speed_row.SWITCH], row[speed_row.V] = 1.0, 1.0, math.inf, speed
    if law == OU:
        row[speed_row.SIGMA] = 0.1
    elif law == COSINE:
        row[speed_row.V], row[speed_row.V2] = max(low, speed * uniform(rng, 0.3, 0.9)), speed
        row[speed_row.PERIOD], row[speed_row.PHASE] = uniform(rng, 2.0, 5.0), uniform(rng, -math.pi, math.pi)
    elif law == SCHEDULED:
        row[speed_row.V2] = min(high, max(low, speed * uniform(rng, 0.3, 1.0)))
        row[speed_row.RAMP], row[speed_row.SWITCH] = uniform(rng, 0.3, 1.5), uniform(rng, 0.0, 4.0)
        if uniform(rng, 0.0, 1.0) < 0.5:
            row[speed_row.V], row[speed_row.V2] = row[speed_row.V2], row[speed_row.V]


@njit
def motion_draw(motion, config, rng):
    """Draw an episode's motion into a motion row. Returns (desired speed m/s, family, law)."""
    aux, board = motion[: motion_row.DIM], motion[motion_row.DIM :]
    family = pick(config[config_row.FAMILY : config_row.FAMILY + 6], uniform(rng, 0.0, 1.0))
    law = pick(config[config_row.LAW : config_row.LAW + 4], uniform(rng, 0.0, 1.0))
    low, high = config[config_row.SPEED_LOW], config[config_row.SPEED_HIGH]
    speed = uniform(rng, low, high)
    oscillating = config[config_row.OSCILLATING] > 0.0 and uniform(rng, 0.0, 1.0) < config[config_row.OSCILLATING]
    hard = (
        not oscillating
        and config[config_row.HARD_EXAMPLES] > 0.0
        and uniform(rng, 0.0, 1.0) < config[config_row.HARD_EXAMPLES]
    )
    flat = hard and uniform(rng, 0.0, 1.0) < _FLAT_SHARE
    if oscillating:
        family, law, speed = _SPLINE, _COSINE, uniform(rng, *_FAST)
    elif hard:
        speed = uniform(rng, *_FLAT_SPEED) if flat else uniform(rng, *_STEEP_SPEED)
    kind = _KINDS[family]
    if kind == FIGURE8 and low < high:
        speed = min(speed, max(low, _FIGURE8_SPEED))
    if kind == STATIC:
        speed, law = 0.0, 0
    aux[:] = 0.0
    _draw_path(aux[motion_row.PATH : motion_row.PATH + path_row.DIM], kind, speed, rng)
    _draw_speed(_SPEED_KINDS[law], aux[motion_row.SPEED : motion_row.SPEED + speed_row.DIM], speed, low, high, rng)
    if oscillating:
        aux[motion_row.SPEED + speed_row.V], aux[motion_row.SPEED + speed_row.PERIOD] = (
            uniform(rng, *_SLOW),
            uniform(rng, *_PERIOD),
        )
    aux[motion_row.PATH_KIND], aux[motion_row.SPEED_KIND] = kind, _SPEED_KINDS[law]
    aux[motion_row.CHANGE_TIME], aux[motion_row.CHANGE_LENGTH] = math.inf, math.inf
    aux[motion_row.ACCEL_LIMIT], aux[motion_row.DAMPING] = math.inf, 1.0
    if kind == SPLINE and law == 3:
        aux[motion_row.CHANGE_TIME] = aux[motion_row.SPEED + speed_row.SWITCH]
        aux[motion_row.ARC_RADIUS] = uniform(rng, max(2.0, speed / 1.2), 6.0)
        if uniform(rng, 0.0, 1.0) < 0.5:
            aux[motion_row.ARC_RADIUS] = -aux[motion_row.ARC_RADIUS]
    if config[config_row.CAR_LAG] > 0.0 and uniform(rng, 0.0, 1.0) < 0.7:
        aux[motion_row.RESPONSE] = 1.0 / uniform(rng, 0.3 * config[config_row.CAR_LAG], config[config_row.CAR_LAG])
        aux[motion_row.DAMPING], aux[motion_row.ACCEL_LIMIT] = uniform(rng, 0.5, 1.2), uniform(rng, 2.0, 5.0)
    u = uniform(rng, 0.0, 1.0) * path_lap(kind, aux[motion_row.PATH : motion_row.PATH + path_row.DIM])
    switch = aux[motion_row.SPEED + speed_row.SWITCH]
    inclination = uniform(rng, config[config_row.INCLINATION_LOW], config[config_row.INCLINATION_HIGH])
    if oscillating:
        inclination = uniform(rng, *_STEEP)
    elif hard:
        inclination = uniform(rng, *_FLAT_INCLINATION) if flat else uniform(rng, *_STEEP_INCLINATION)
    motion_reset(board, aux, u, BOARD_HEIGHT, inclination, True)
    if math.isinf(aux[motion_row.CHANGE_TIME]):  # else the change of path decides when the speed changes
        aux[motion_row.SPEED + speed_row.SWITCH] = switch
    return speed, family, law


@njit
def extend_track(motion, track, known, wanted, rng):
    """Step the motion on until `track` ((T, 8)) is known up to row `wanted`; row `known` is the last one known now.

    Returns the number of the last known row.
    """
    aux, board = motion[: motion_row.DIM], motion[motion_row.DIM :]
    for k in range(known + 1, min(wanted, track.shape[0] - 1) + 1):
        motion_step(board, aux, TICK, rng)
        track[k] = board
    return max(known, min(wanted, track.shape[0] - 1))
