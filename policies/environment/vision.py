"""The model camera and the belief in training: exposure, visibility test, noise, latency, filter."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_quaternion, board_velocity
from kernel.jit import njit
from kernel.random import uniform
from policies.environment import config_row, episode_row, scratch_row
from policies.environment.config import TICK
from policies.estimation import measured_row
from policies.estimation.board_ekf import belief_predict, belief_update, measurement_from_pose
from policies.estimation.ctrv import wrap
from vehicle.camera import bias_row, detection_row
from vehicle.camera.noise import ODOMETRY_SIGMA, POINTING_SIGMA, observe_board
from vehicle.camera.pinhole import board_row_visibility, optical_axis
from vehicle.quadrotor import state_row

_JITTER = 0.003  # s, half-width of the detector's latency within an episode


@njit
def look(vehicle, board, camera, state):
    """Store in an episode's `state` and return whether the board is visible now (1 or 0).

    `board` (8,): the true board row; `vehicle`, `camera`: the episode's rows.
    """
    p, q = vehicle[state_row.P : state_row.P + 3], vehicle[state_row.Q : state_row.Q + 4]
    seen = board_row_visibility(p, q, board, camera)
    state[episode_row.VISIBLE] = seen
    return seen


@njit
def _due(state, now):
    """Whether an exposure is due at `now` (s) and will give a detection; sets the time of the next one."""
    if now < state[episode_row.EXPOSURE] - 1e-9:
        return False
    state[episode_row.EXPOSURE] = max(state[episode_row.EXPOSURE] + state[episode_row.PERIOD], now + 0.5 * TICK)
    return state[episode_row.VISIBLE] > 0.0 and state[episode_row.PENDING] < episode_row.QUEUE_LENGTH


@njit
def _expose(vehicle, board, camera, noise, state, rng, x, now, latency):
    """Expose a picture at `now` (s): its detection arrives `latency` s later.

    `board` (8,): the true board row; `x`: the scratch row; the others are the episode's rows.
    """
    observed, q, v = (
        x[scratch_row.OBSERVED : scratch_row.OBSERVED + detection_row.DIM],
        x[scratch_row.Q : scratch_row.Q + 4],
        x[scratch_row.V : scratch_row.V + 3],
    )
    q[0], q[1], q[2], q[3] = board_quaternion(board)
    v[0], v[1], v[2] = board_velocity(board)
    observe_board(
        vehicle[state_row.P : state_row.P + 3],
        vehicle[state_row.Q : state_row.Q + 4],
        vehicle[state_row.V : state_row.V + 3],
        board[board_row.X : board_row.Z + 1],
        q,
        v,
        camera,
        noise,
        state[episode_row.NOISE],
        state[episode_row.BIAS : episode_row.BIAS + bias_row.DIM],
        rng,
        observed,
    )
    sigma = x[scratch_row.SIGMA : scratch_row.SIGMA + 3]
    axis = optical_axis(vehicle[state_row.Q : state_row.Q + 4], camera)
    across, along = observed[detection_row.SIGMA_LATERAL], observed[detection_row.SIGMA_DEPTH]
    lateral, depth = across * across, along * along
    dx, dy, dz = (
        board[board_row.X] - vehicle[state_row.P],
        board[board_row.Y] - vehicle[state_row.P + 1],
        board[board_row.Z] - vehicle[state_row.P + 2],
    )
    floor = ODOMETRY_SIGMA**2 + POINTING_SIGMA**2 * (dx * dx + dy * dy + dz * dz)
    for k in range(3):
        sigma[k] = math.sqrt(lateral + (depth - lateral) * axis[k] * axis[k] + floor)
    turned = math.hypot(observed[detection_row.SIGMA_ROTATION], POINTING_SIGMA)
    z = x[scratch_row.Z : scratch_row.Z + measured_row.DIM]
    r = x[scratch_row.R : scratch_row.R + measured_row.DIM]
    position = observed[detection_row.P : detection_row.P + 3]
    orientation = observed[detection_row.Q : detection_row.Q + 4]
    if not measurement_from_pose(position, orientation, sigma, turned, z, r):
        return
    slot = episode_row.QUEUE + int(state[episode_row.PENDING]) * episode_row.SLOT
    state[slot], state[slot + 1] = now + latency, now
    state[slot + 2 : slot + 7] = z
    state[slot + 7 : slot + 12] = r
    state[episode_row.PENDING] += 1.0


@njit
def deliver(state, belief, params, now):
    """Update the filter, a `belief` row of parameters `params`, with every detection that has arrived by `now` (s)."""
    while state[episode_row.PENDING] > 0.0 and state[episode_row.QUEUE] <= now + 1e-9:
        z, r = (
            state[episode_row.QUEUE + 2 : episode_row.QUEUE + 7],
            state[episode_row.QUEUE + 7 : episode_row.QUEUE + 12],
        )
        belief_update(belief, state[episode_row.QUEUE + 1], z, r, params)
        state[episode_row.RAW + 6 : episode_row.RAW + 12] = state[episode_row.RAW : episode_row.RAW + 6]
        state[episode_row.RAW : episode_row.RAW + 5] = z
        state[episode_row.RAW + 5] = state[episode_row.QUEUE + 1]
        count = int(state[episode_row.PENDING])
        for k in range(episode_row.QUEUE, episode_row.QUEUE + (count - 1) * episode_row.SLOT):
            state[k] = state[k + episode_row.SLOT]
        state[episode_row.PENDING] -= 1.0


@njit
def raw_estimate(state, out):
    """The paper's ablation without input augmentation: the last pose as it is, velocity from the last two poses.

    `state` (episode_row.DIM,); `out` (8,): the board row that is filled.
    """
    new, old = episode_row.RAW, episode_row.RAW + measured_row.DIM + 1
    dt = state[new + measured_row.DIM] - state[old + measured_row.DIM]
    heading = state[new + measured_row.HEADING]
    out[board_row.X] = state[new + measured_row.X]
    out[board_row.Y] = state[new + measured_row.Y]
    out[board_row.Z] = state[new + measured_row.Z]
    out[board_row.HEADING] = heading
    out[board_row.INCLINATION] = state[new + measured_row.INCLINATION]
    out[board_row.SPEED] = out[board_row.TURN_RATE] = out[board_row.U] = 0.0
    if dt > 0.0 and state[old + measured_row.Z] != 0.0:
        dx = state[new + measured_row.X] - state[old + measured_row.X]
        dy = state[new + measured_row.Y] - state[old + measured_row.Y]
        out[board_row.SPEED] = (dx * math.cos(heading) + dy * math.sin(heading)) / dt
        out[board_row.TURN_RATE] = wrap(heading - state[old + measured_row.HEADING]) / dt


@njit
def see(rows, i, shared, board, latency):
    """One step of perception: look, expose, deliver, predict. Writes the believed row and returns the belief's rho."""
    state, vehicle, belief, believed = rows.state[i], rows.vehicle[i], rows.belief[i], rows.believed[i]
    now = state[episode_row.STEP] * TICK
    look(vehicle, board, rows.camera[i], state)
    if _due(state, now):
        _expose(vehicle, board, rows.camera[i], shared.noise, state, rows.rng[i], rows.scratch[i], now, latency)
    deliver(state, belief, shared.belief, now)
    rho = belief_predict(belief, now, shared.belief, believed)
    dx = believed[board_row.X] - board[board_row.X]
    dy = believed[board_row.Y] - board[board_row.Y]
    dz = believed[board_row.Z] - board[board_row.Z]
    state[episode_row.ERROR] = math.sqrt(dx * dx + dy * dy + dz * dz)
    if shared.config[config_row.AUGMENTATION] == 0.0:
        raw_estimate(state, believed)
    return rho


@njit
def latency_now(state, rng):
    """The detector's latency for this exposure, s."""
    return state[episode_row.LATENCY] + uniform(rng, -_JITTER, _JITTER)
