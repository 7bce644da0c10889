"""How the simulated Scout Mini moves: wheel speed loops, slip, skid steering and floor noise as one kernel.

The wheels' speed answers as a second-order system that overshoots, the turn as a lag; both are acceleration limited.
Feedback over CAN shows the wheels; the truth has their slip, turns less than they say, veers and trembles.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion.kinematics import accelerate, drive, wheel_speeds
from groundcar.scout.params import ScoutParams
from kernel.jit import njit
from kernel.random import normal, uniform

STEP_NS = 2_000_000  # 500 Hz

# state row
X, Y, HEADING = 0, 1, 2  # m, m, rad (not wrapped); truth
SPEED, TURN_RATE = 3, 4  # m/s, rad/s; truth
WHEEL_SPEED, WHEEL_ACCEL, WHEEL_TURN = 5, 6, 7  # m/s, m/s^2, rad/s; what the wheels say
SPEED_NOISE, TURN_NOISE = 8, 9
LEFT, RIGHT = 10, 11  # m rolled by the wheels of each side
NSTATE = 12

# params row
FREQUENCY, DAMPING, ACCELERATION, STOP_DECELERATION, SPEED_GAIN = 0, 1, 2, 3, 4
TURN_LAG, TURN_ACCELERATION, TURN_GAIN, VEER = 5, 6, 7, 8
SPEED_SIGMA, SPEED_TIME, TURN_SIGMA, TURN_TIME = 9, 10, 11, 12
TRACK = 13
NPARAMS = 14


def physics_row(params: ScoutParams, stream: np.ndarray) -> np.ndarray:
    """The params row (NPARAMS,) of one car, its deviations drawn from `stream`."""
    r, s = params.response, params.spread

    def spread(half_width: float) -> float:
        return 1.0 + float(uniform(stream, -half_width, half_width))

    row = np.zeros(NPARAMS)
    row[FREQUENCY] = r.speed_frequency * spread(s.speed_frequency)
    row[DAMPING] = r.speed_damping * spread(s.speed_damping)
    row[ACCELERATION], row[STOP_DECELERATION] = r.acceleration, r.stop_deceleration
    row[SPEED_GAIN] = spread(s.speed_gain)
    row[TURN_LAG], row[TURN_ACCELERATION] = r.turn_lag * spread(s.turn_lag), r.turn_acceleration
    row[TURN_GAIN] = r.turn_gain * spread(s.turn_gain)
    row[VEER] = float(uniform(stream, -s.veer, s.veer))
    row[SPEED_SIGMA], row[SPEED_TIME] = r.speed_noise, r.speed_noise_time
    row[TURN_SIGMA], row[TURN_TIME] = r.turn_noise, r.turn_noise_time
    row[TRACK] = params.geometry.track
    return row


@njit
def _wander(value, sigma, time, dt, stream):
    """One step of an Ornstein-Uhlenbeck process of stationary spread `sigma` and correlation time `time`."""
    keep = math.exp(-dt / time)
    return keep * value + sigma * math.sqrt(1.0 - keep * keep) * normal(stream)


@njit
def physics_step(state, params, asked_speed, asked_turn, stopping, dt, stream):
    """Advance the state row by `dt` s; `stopping` brakes hard, whatever is asked."""
    if stopping:
        state[WHEEL_SPEED] = accelerate(state[WHEEL_SPEED], 0.0, params[STOP_DECELERATION], dt)
        state[WHEEL_TURN] = accelerate(state[WHEEL_TURN], 0.0, params[TURN_ACCELERATION], dt)
        state[WHEEL_ACCEL] = 0.0
    else:
        limit, wn = params[ACCELERATION], params[FREQUENCY]
        pull = wn * wn * (asked_speed - state[WHEEL_SPEED]) - 2.0 * params[DAMPING] * wn * state[WHEEL_ACCEL]
        state[WHEEL_ACCEL] = max(-limit, min(limit, state[WHEEL_ACCEL] + pull * dt))
        state[WHEEL_SPEED] += state[WHEEL_ACCEL] * dt
        limit = params[TURN_ACCELERATION]
        state[WHEEL_TURN] += dt * max(-limit, min(limit, (asked_turn - state[WHEEL_TURN]) / params[TURN_LAG]))
    state[SPEED_NOISE] = _wander(state[SPEED_NOISE], params[SPEED_SIGMA], params[SPEED_TIME], dt, stream)
    state[TURN_NOISE] = _wander(state[TURN_NOISE], params[TURN_SIGMA], params[TURN_TIME], dt, stream)
    moving = min(1.0, (abs(state[WHEEL_SPEED]) + 0.2 * abs(state[WHEEL_TURN])) / 0.3)  # a parked car does not tremble
    speed = params[SPEED_GAIN] * state[WHEEL_SPEED] + moving * state[SPEED_NOISE]
    turn = params[TURN_GAIN] * state[WHEEL_TURN] + params[VEER] * speed + moving * state[TURN_NOISE]
    state[X], state[Y], state[HEADING] = drive(state[X], state[Y], state[HEADING], speed, turn, dt)
    state[SPEED], state[TURN_RATE] = speed, turn
    left, right = wheel_speeds(state[WHEEL_SPEED], state[WHEEL_TURN], params[TRACK])
    state[LEFT] += left * dt
    state[RIGHT] += right * dt
