"""What a row's policy receives: the perceived board, odometry and the observation; and the critic's future."""

from __future__ import annotations

from kernel.jit import njit
from kernel.random import normal
from kernel.rotations import body_z, from_rotation_vector, multiply
from policies.environment import config_row, episode_row, scratch_row
from policies.environment.config import TICK
from policies.environment.motion import extend_track
from policies.environment.rows import FUTURE
from policies.environment.vision import see
from policies.estimation import thrust_row
from policies.estimation.board_ekf import surface_sigma
from policies.estimation.own_state import WAIT
from policies.estimation.thrust_drag import gain_update
from policies.task import entry_row
from policies.task.observation import build_observation, push_history, relative_entry, write_entry, yaw_axes
from vehicle.quadrotor import airframe_row, command_row, state_row
from vehicle.quadrotor.airframe import GRAVITY

_V_NOISE, _ATTITUDE_NOISE = 0.02, 0.003  # m/s, rad: one-sigma of odometry at scale 1


@njit
def true_gain(rows, i, shared):
    """Achieved over asked thrust of row i."""
    nominal = shared.nominal[airframe_row.MOTOR_THRUST] / shared.nominal[airframe_row.MASS]
    return rows.params[i, airframe_row.MOTOR_THRUST] / rows.params[i, airframe_row.MASS] / nominal


@njit
def perceive(rows, i, shared, board, latency):
    """The board as the policy perceives it, into the row's `believed` board row and its history. Returns rho (0..1).

    `board` (8,): the true board row now; `latency` s from an exposure to its detection.
    """
    state = rows.state[i]
    rho = 1.0
    if shared.config[config_row.VISION] > 0.0:
        rho = see(rows, i, shared, board, latency)
    else:
        rows.believed[i] = board
        state[episode_row.VISIBLE] = 1.0
    push_history(rows.believed[i], state[episode_row.STEP] * TICK, rows.history[i])
    return rho


@njit
def odometry(rows, i):
    """The vehicle's own estimate, into the scratch row: position, velocity, orientation with odometry noise."""
    vehicle, rng, x = rows.vehicle[i], rows.rng[i], rows.scratch[i]
    scale = rows.state[i, episode_row.ODOMETRY]
    x[scratch_row.P : scratch_row.P + 3] = vehicle[state_row.P : state_row.P + 3]
    x[scratch_row.V : scratch_row.V + 3] = vehicle[state_row.V : state_row.V + 3]
    x[scratch_row.Q : scratch_row.Q + 4] = vehicle[state_row.Q : state_row.Q + 4]
    if scale > 0.0:
        for k in range(3):
            x[scratch_row.V + k] += scale * _V_NOISE * normal(rng)
        s = scale * _ATTITUDE_NOISE
        dq = from_rotation_vector(s * normal(rng), s * normal(rng), s * normal(rng))
        q = multiply((x[scratch_row.Q], x[scratch_row.Q + 1], x[scratch_row.Q + 2], x[scratch_row.Q + 3]), dq)
        x[scratch_row.Q], x[scratch_row.Q + 1], x[scratch_row.Q + 2], x[scratch_row.Q + 3] = q[0], q[1], q[2], q[3]


@njit
def own_gain(rows, i, shared):
    """(achieved over asked thrust, drag 1/s) as row i has estimated them."""
    if shared.config[config_row.GAIN_SLOT] > 0.0:
        return rows.gain[i, thrust_row.GAIN], rows.gain[i, thrust_row.DRAG]
    return 1.0, shared.nominal[airframe_row.DRAG] / shared.nominal[airframe_row.MASS]


@njit
def own_sigma(rows, i, shared):
    """One-sigma of the board's surface for row i, m along its normal; 0 if the policy receives truth or raw poses."""
    seeing = shared.config[config_row.VISION] > 0.0 and shared.config[config_row.AUGMENTATION] > 0.0
    return surface_sigma(rows.belief[i]) if seeing else 0.0


@njit
def shown_odometry(scratch):
    """Views of position, velocity (3,) and orientation (4,) that a row's policy received, in its scratch row."""
    p, v, q = scratch_row.P, scratch_row.V, scratch_row.Q
    return scratch[p : p + 3], scratch[v : v + 3], scratch[q : q + 4]


@njit
def shown_rho(shared, rho):
    """The rho that a policy receives: 1 in the ablations without it, and on raw poses."""
    c = shared.config
    return rho if c[config_row.RHO] > 0.0 and c[config_row.AUGMENTATION] > 0.0 else 1.0


@njit
def observe(rows, i, shared, rho):
    """Write the observation and the critic's future of row i; updates the thrust-gain estimate.

    `rho`: the belief's. An ablation whose policy does not receive it is still evaluated by it.
    """
    c, state, x = shared.config, rows.state[i], rows.scratch[i]
    odometry(rows, i)
    p, v, q = shown_odometry(x)
    if c[config_row.GAIN_SLOT] > 0.0:
        zx, zy, zz = body_z(q)
        lag, asked, expected = (
            shared.nominal[airframe_row.MOTOR_LAG] + WAIT,
            state[episode_row.COMMAND + command_row.THRUST],
            shared.nominal[airframe_row.DRAG],
        )
        expected /= shared.nominal[airframe_row.MASS]
        gain_update(rows.gain[i], v[0], v[1], v[2], zx, zy, zz, asked, TICK, lag, expected, GRAVITY)
    gain, drag = own_gain(rows, i, shared)
    sigma, stride = own_sigma(rows, i, shared), int(c[config_row.STRIDE])
    now = state[episode_row.STEP] * TICK
    action = state[episode_row.ACTION : episode_row.ACTION + 4]
    shown = shown_rho(shared, rho)
    build_observation(rows.history[i], p, v, q, shown, action, gain, drag, sigma, stride, now, rows.observation[i])
    cos, sin = yaw_axes(q)
    ahead, begin = int(c[config_row.FUTURE_STRIDE]), int(state[episode_row.STEP])
    wanted = min(begin + FUTURE * ahead, rows.track.shape[1] - 1)
    state[episode_row.FILLED] = extend_track(
        rows.motion[i], rows.track[i], int(state[episode_row.FILLED]), wanted, rows.rng[i]
    )
    for k in range(FUTURE):
        step = min(begin + (k + 1) * ahead, rows.track.shape[1] - 1)
        write_entry(rows.track[i, step], step * TICK, x, 0)
        relative_entry(x, 0, rows.vehicle[i], cos, sin, now, rows.future[i], k * entry_row.DIM)
