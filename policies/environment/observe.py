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
from policies.task.observation import (
    build_observation,
    entry_place,
    push_history,
    relative_entries,
    write_entry,
    yaw_axes,
)
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
def odometry(vehicle, scale, rng, x):
    """The vehicle's own estimate, into the scratch row `x`: position, velocity, orientation with odometry noise.

    `vehicle`: its state row; `scale` of the noise.
    """
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
def own_gain(gain, config, nominal):
    """(achieved over asked thrust, drag 1/s) as the thrust row `gain` has estimated them."""
    if config[config_row.GAIN_SLOT] > 0.0:
        return gain[thrust_row.GAIN], gain[thrust_row.DRAG]
    return 1.0, nominal[airframe_row.DRAG] / nominal[airframe_row.MASS]


@njit
def own_sigma(belief, config):
    """One-sigma of the board's surface in a belief row, m along its normal; 0 if the policy receives truth or raw
    poses."""
    seeing = config[config_row.VISION] > 0.0 and config[config_row.AUGMENTATION] > 0.0
    return surface_sigma(belief) if seeing else 0.0


@njit
def shown_odometry(scratch):
    """Views of position, velocity (3,) and orientation (4,) that a row's policy received, in its scratch row."""
    p, v, q = scratch_row.P, scratch_row.V, scratch_row.Q
    return scratch[p : p + 3], scratch[v : v + 3], scratch[q : q + 4]


@njit
def shown_rho(config, rho):
    """The rho that a policy receives: 1 in the ablations without it, and on raw poses."""
    return rho if config[config_row.RHO] > 0.0 and config[config_row.AUGMENTATION] > 0.0 else 1.0


@njit
def _foresee(state, motion, track, rng, ahead, vehicle, q, stride, out):
    """Write the critic's future to `out`: true boards, `stride` control steps apart, relative to the vehicle's row.

    `q` (4,): its estimated orientation, in whose yaw frame they are; `ahead`: ring of the `track`'s next steps.
    """
    begin = int(state[episode_row.STEP])
    last = begin + FUTURE * stride
    state[episode_row.FILLED] = extend_track(motion, track, int(state[episode_row.FILLED]), last, rng)
    for step in range(max(begin, int(state[episode_row.FORESEEN])) + 1, last + 1):
        at = entry_place(step, stride, FUTURE)
        write_entry(track[step], step * TICK, ahead[at : at + entry_row.DIM])
    state[episode_row.FORESEEN] = last
    cos, sin = yaw_axes(q)
    p = vehicle[state_row.P : state_row.P + 3]
    relative_entries(ahead, stride, FUTURE, last, FUTURE, p, cos, sin, begin * TICK, out)


@njit
def observe(rows, i, shared, rho):
    """Write the observation and the critic's future of row i; updates the thrust-gain estimate.

    `rho`: the belief's. An ablation whose policy does not receive it is still evaluated by it.
    """
    c, state, x = shared.config, rows.state[i], rows.scratch[i]
    odometry(rows.vehicle[i], state[episode_row.ODOMETRY], rows.rng[i], x)
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
    gain, drag = own_gain(rows.gain[i], c, shared.nominal)
    sigma, stride = own_sigma(rows.belief[i], c), int(c[config_row.STRIDE])
    now = state[episode_row.STEP] * TICK
    action = state[episode_row.ACTION : episode_row.ACTION + 4]
    shown = shown_rho(c, rho)
    build_observation(rows.history[i], p, v, q, shown, action, gain, drag, sigma, stride, now, rows.observation[i])
    _foresee(
        state, rows.motion[i], rows.track[i], rows.rng[i], rows.ahead[i], rows.vehicle[i], q,
        int(c[config_row.FUTURE_STRIDE]), rows.future[i],
    )  # fmt: skip
