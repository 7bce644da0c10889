"""How the simulated Scout Mini moves: wheel speed loops, slip, skid steering and floor noise as one kernel.

The wheels' speed answers as a second-order system that overshoots, the turn as a lag; both are acceleration limited.
Feedback over CAN reports the wheels. The true motion differs from it by slip, a lower turn rate, a lateral drift and
floor noise.
"""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion.kinematics import accelerate, drive, wheel_speeds
from groundcar.scout import car_row, response_row
from groundcar.scout.params import ScoutParams
from kernel.jit import njit
from kernel.random import normal, uniform

STEP_NS = 2_000_000  # 500 Hz


def physics_row(params: ScoutParams, stream: np.ndarray) -> np.ndarray:
    """The response row ((response_row.DIM,)) of one car; `stream` draws its deviations from the nominal car."""
    r, s = params.response, params.spread

    def spread(half_width: float) -> float:
        return 1.0 + float(uniform(stream, -half_width, half_width))

    row = np.zeros(response_row.DIM)
    row[response_row.FREQUENCY] = r.speed_frequency * spread(s.speed_frequency)
    row[response_row.DAMPING] = r.speed_damping * spread(s.speed_damping)
    row[response_row.ACCELERATION], row[response_row.STOP_DECELERATION] = r.acceleration, r.stop_deceleration
    row[response_row.SPEED_GAIN] = spread(s.speed_gain)
    row[response_row.TURN_LAG], row[response_row.TURN_ACCELERATION] = (
        r.turn_lag * spread(s.turn_lag),
        r.turn_acceleration,
    )
    row[response_row.TURN_GAIN] = r.turn_gain * spread(s.turn_gain)
    row[response_row.VEER] = float(uniform(stream, -s.veer, s.veer))
    row[response_row.SPEED_SIGMA], row[response_row.SPEED_TIME] = r.speed_noise, r.speed_noise_time
    row[response_row.TURN_SIGMA], row[response_row.TURN_TIME] = r.turn_noise, r.turn_noise_time
    row[response_row.TRACK] = params.geometry.track
    return row


@njit
def _wander(value, sigma, time, dt, stream):
    """One step of an Ornstein-Uhlenbeck process of stationary spread `sigma` and correlation time `time`."""
    keep = math.exp(-dt / time)
    return keep * value + sigma * math.sqrt(1.0 - keep * keep) * normal(stream)


@njit
def physics_step(state, params, asked_speed, asked_turn, stopping, dt, stream):
    """Advance the car row `state` by `dt` s towards `asked_speed` (m/s) and `asked_turn` (rad/s).

    `stopping` brakes at the stop deceleration, whatever is asked.
    """
    if stopping:
        state[car_row.WHEEL_SPEED] = accelerate(
            state[car_row.WHEEL_SPEED], 0.0, params[response_row.STOP_DECELERATION], dt
        )
        state[car_row.WHEEL_TURN] = accelerate(
            state[car_row.WHEEL_TURN], 0.0, params[response_row.TURN_ACCELERATION], dt
        )
        state[car_row.WHEEL_ACCEL] = 0.0
    else:
        limit, wn = params[response_row.ACCELERATION], params[response_row.FREQUENCY]
        pull = (
            wn * wn * (asked_speed - state[car_row.WHEEL_SPEED])
            - 2.0 * params[response_row.DAMPING] * wn * state[car_row.WHEEL_ACCEL]
        )
        state[car_row.WHEEL_ACCEL] = max(-limit, min(limit, state[car_row.WHEEL_ACCEL] + pull * dt))
        state[car_row.WHEEL_SPEED] += state[car_row.WHEEL_ACCEL] * dt
        limit = params[response_row.TURN_ACCELERATION]
        state[car_row.WHEEL_TURN] += dt * max(
            -limit, min(limit, (asked_turn - state[car_row.WHEEL_TURN]) / params[response_row.TURN_LAG])
        )
    state[car_row.SPEED_NOISE] = _wander(
        state[car_row.SPEED_NOISE], params[response_row.SPEED_SIGMA], params[response_row.SPEED_TIME], dt, stream
    )
    state[car_row.TURN_NOISE] = _wander(
        state[car_row.TURN_NOISE], params[response_row.TURN_SIGMA], params[response_row.TURN_TIME], dt, stream
    )
    moving = min(
        1.0, (abs(state[car_row.WHEEL_SPEED]) + 0.2 * abs(state[car_row.WHEEL_TURN])) / 0.3
    )  # no floor noise at rest
    speed = params[response_row.SPEED_GAIN] * state[car_row.WHEEL_SPEED] + moving * state[car_row.SPEED_NOISE]
    turn = (
        params[response_row.TURN_GAIN] * state[car_row.WHEEL_TURN]
        + params[response_row.VEER] * speed
        + moving * state[car_row.TURN_NOISE]
    )
    state[car_row.X], state[car_row.Y], state[car_row.HEADING] = drive(
        state[car_row.X], state[car_row.Y], state[car_row.HEADING], speed, turn, dt
    )
    state[car_row.SPEED], state[car_row.TURN_RATE] = speed, turn
    left, right = wheel_speeds(state[car_row.WHEEL_SPEED], state[car_row.WHEEL_TURN], params[response_row.TRACK])
    state[car_row.LEFT] += left * dt
    state[car_row.RIGHT] += right * dt
