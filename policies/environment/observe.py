"""What a row's policy is told: the board as perceived, odometry, the observation; and the critic's future."""

from __future__ import annotations

from kernel.jit import njit
from kernel.random import normal
from kernel.rotations import body_z, from_rotation_vector, multiply
from policies.environment.config import C_AUGMENTATION, C_FUTURE_STRIDE, C_GAIN, C_STRIDE, C_VISION, TICK
from policies.environment.motion import extend_track
from policies.environment.rows import (
    FUTURE,
    S_ACTION,
    S_COMMAND,
    S_FILLED,
    S_ODOMETRY,
    S_STEP,
    S_VISIBLE,
    X_P,
    X_Q,
    X_V,
)
from policies.environment.vision import see
from policies.estimation import thrust_row
from policies.estimation.board_ekf import surface_sigma
from policies.estimation.thrust_drag import gain_update
from policies.task import entry_row
from policies.task.observation import build_observation, push_history, relative_entry, write_entry, yaw_axes
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor.airframe import GRAVITY

_V_NOISE, _ATTITUDE_NOISE = 0.02, 0.003  # m/s, rad: one-sigma of odometry at scale 1


@njit
def true_gain(rows, i, shared):
    """Achieved over asked thrust of row i."""
    nominal = shared.nominal[airframe_row.MOTOR_THRUST] / shared.nominal[airframe_row.MASS]
    return rows.params[i, airframe_row.MOTOR_THRUST] / rows.params[i, airframe_row.MASS] / nominal


@njit
def perceive(rows, i, shared, board, latency):
    """The board as the policy is told of it, into `believed` and the history. Returns rho."""
    state = rows.state[i]
    rho = 1.0
    if shared.config[C_VISION] > 0.0:
        rho = see(rows, i, shared, board, latency)
    else:
        rows.believed[i] = board
        state[S_VISIBLE] = 1.0
    push_history(rows.believed[i], state[S_STEP] * TICK, rows.history[i])
    return rho


@njit
def odometry(rows, i):
    """What the drone knows of itself, into the scratch row: position, velocity, orientation with odometry noise."""
    vehicle, rng, x = rows.vehicle[i], rows.rng[i], rows.scratch[i]
    scale = rows.state[i, S_ODOMETRY]
    x[X_P : X_P + 3] = vehicle[state_row.P : state_row.P + 3]
    x[X_V : X_V + 3] = vehicle[state_row.V : state_row.V + 3]
    x[X_Q : X_Q + 4] = vehicle[state_row.Q : state_row.Q + 4]
    if scale > 0.0:
        for k in range(3):
            x[X_V + k] += scale * _V_NOISE * normal(rng)
        s = scale * _ATTITUDE_NOISE
        dq = from_rotation_vector(s * normal(rng), s * normal(rng), s * normal(rng))
        q = multiply((x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3]), dq)
        x[X_Q], x[X_Q + 1], x[X_Q + 2], x[X_Q + 3] = q[0], q[1], q[2], q[3]


@njit
def observe(rows, i, shared, rho):
    """Write the observation and the critic's future of row i; updates the thrust-gain estimate."""
    c, state, x = shared.config, rows.state[i], rows.scratch[i]
    odometry(rows, i)
    p, v, q = x[X_P : X_P + 3], x[X_V : X_V + 3], x[X_Q : X_Q + 4]
    gain, drag = 1.0, shared.nominal[airframe_row.DRAG] / shared.nominal[airframe_row.MASS]
    if c[C_GAIN] > 0.0:
        zx, zy, zz = body_z(q)
        lag, asked = shared.nominal[airframe_row.MOTOR_LAG] + 0.01, state[S_COMMAND + 3]
        gain = gain_update(rows.gain[i], v[0], v[1], v[2], zx, zy, zz, asked, TICK, lag, drag, GRAVITY)
        drag = rows.gain[i, thrust_row.DRAG]
    seeing = c[C_VISION] > 0.0 and c[C_AUGMENTATION] > 0.0
    sigma, stride = surface_sigma(rows.belief[i]) if seeing else 0.0, int(c[C_STRIDE])
    now = state[S_STEP] * TICK
    action = state[S_ACTION : S_ACTION + 4]
    build_observation(rows.history[i], p, v, q, rho, action, gain, drag, sigma, stride, now, rows.observation[i])
    cos, sin = yaw_axes(q)
    ahead, begin = int(c[C_FUTURE_STRIDE]), int(state[S_STEP])
    wanted = min(begin + FUTURE * ahead, rows.track.shape[1] - 1)
    state[S_FILLED] = extend_track(rows.motion[i], rows.track[i], int(state[S_FILLED]), wanted, rows.rng[i])
    for k in range(FUTURE):
        step = min(begin + (k + 1) * ahead, rows.track.shape[1] - 1)
        write_entry(rows.track[i, step], step * TICK, x, 0)
        relative_entry(x, 0, rows.vehicle[i], cos, sin, now, rows.future[i], k * entry_row.DIM)
