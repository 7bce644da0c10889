"""What the camera makes of the truth in training: exposure, visibility gate, noise, latency, filter."""

from __future__ import annotations

import math

from groundcar.motion import board_row
from groundcar.motion.pose import board_quaternion, board_velocity
from kernel.jit import njit
from kernel.random import uniform
from policies.environment import config_row, episode_row, scratch_row
from policies.environment.config import TICK
from policies.estimation.board_ekf import belief_predict, belief_update, measurement_from_pose
from policies.estimation.ctrv import wrap
from vehicle.camera.noise import ODOMETRY_SIGMA, POINTING_SIGMA, observe_board
from vehicle.camera.pinhole import board_row_visibility, optical_axis
from vehicle.quadrotor import state_row

_JITTER = 0.003  # s, half-width of the detector's latency within an episode


@njit
def look(rows, i, shared, board):
    """Note whether the board is in view now."""
    vehicle = rows.vehicle[i]
    seen = board_row_visibility(
        vehicle[state_row.P : state_row.P + 3], vehicle[state_row.Q : state_row.Q + 4], board, rows.camera[i]
    )
    rows.state[i, episode_row.VISIBLE] = seen
    return seen


@njit
def expose(rows, i, shared, board, now, latency):
    """Take a picture if one is due; a board in view joins the queue of detections, to arrive after `latency`."""
    state, vehicle, x = rows.state[i], rows.vehicle[i], rows.scratch[i]
    if now < state[episode_row.EXPOSURE] - 1e-9:
        return
    state[episode_row.EXPOSURE] = max(state[episode_row.EXPOSURE] + state[episode_row.PERIOD], now + 0.5 * TICK)
    if state[episode_row.VISIBLE] == 0.0 or state[episode_row.PENDING] >= episode_row.QUEUE_LENGTH:
        return
    observed, q, v = (
        x[scratch_row.OBSERVED : scratch_row.OBSERVED + 10],
        x[scratch_row.Q : scratch_row.Q + 4],
        x[scratch_row.V : scratch_row.V + 3],
    )
    q[0], q[1], q[2], q[3] = board_quaternion(board)
    v[0], v[1], v[2] = board_velocity(board)
    observe_board(
        vehicle[state_row.P : state_row.P + 3],
        vehicle[state_row.Q : state_row.Q + 4],
        vehicle[state_row.V : state_row.V + 3],
        board[0:3],
        q,
        v,
        rows.camera[i],
        shared.noise,
        state[episode_row.NOISE],
        state[episode_row.BIAS : episode_row.BIAS + 7],
        rows.rng[i],
        observed,
    )
    sigma = x[scratch_row.SIGMA : scratch_row.SIGMA + 3]
    axis = optical_axis(vehicle[state_row.Q : state_row.Q + 4], rows.camera[i])
    lateral, depth = observed[7] * observed[7], observed[8] * observed[8]
    dx, dy, dz = (
        board[board_row.X] - vehicle[state_row.P],
        board[board_row.Y] - vehicle[state_row.P + 1],
        board[board_row.Z] - vehicle[state_row.P + 2],
    )
    floor = ODOMETRY_SIGMA**2 + POINTING_SIGMA**2 * (dx * dx + dy * dy + dz * dz)
    for k in range(3):
        sigma[k] = math.sqrt(lateral + (depth - lateral) * axis[k] * axis[k] + floor)
    turned = math.hypot(observed[9], POINTING_SIGMA)
    z, r = x[scratch_row.Z : scratch_row.Z + 5], x[scratch_row.R : scratch_row.R + 5]
    if not measurement_from_pose(observed[0:3], observed[3:7], sigma, turned, z, r):
        return
    slot = episode_row.QUEUE + int(state[episode_row.PENDING]) * episode_row.SLOT
    state[slot], state[slot + 1] = now + latency, now
    state[slot + 2 : slot + 7] = z
    state[slot + 7 : slot + 12] = r
    state[episode_row.PENDING] += 1.0


@njit
def deliver(rows, i, shared, now):
    """Feed the filter every detection that has arrived by `now`."""
    state = rows.state[i]
    while state[episode_row.PENDING] > 0.0 and state[episode_row.QUEUE] <= now + 1e-9:
        z, r = (
            state[episode_row.QUEUE + 2 : episode_row.QUEUE + 7],
            state[episode_row.QUEUE + 7 : episode_row.QUEUE + 12],
        )
        belief_update(rows.belief[i], state[episode_row.QUEUE + 1], z, r, shared.belief)
        state[episode_row.RAW + 6 : episode_row.RAW + 12] = state[episode_row.RAW : episode_row.RAW + 6]
        state[episode_row.RAW : episode_row.RAW + 5] = z
        state[episode_row.RAW + 5] = state[episode_row.QUEUE + 1]
        count = int(state[episode_row.PENDING])
        for k in range(episode_row.QUEUE, episode_row.QUEUE + (count - 1) * episode_row.SLOT):
            state[k] = state[k + episode_row.SLOT]
        state[episode_row.PENDING] -= 1.0


@njit
def raw_estimate(state, out):
    """The paper's ablation without input augmentation: last pose as it is, velocity from the last two poses."""
    new, old = episode_row.RAW, episode_row.RAW + 6
    dt = state[new + 5] - state[old + 5]
    out[0], out[1], out[2], out[3], out[6] = state[new], state[new + 1], state[new + 2], state[new + 3], state[new + 4]
    out[4] = out[5] = out[7] = 0.0
    if dt > 0.0 and state[old + 2] != 0.0:
        dx, dy = state[new] - state[old], state[new + 1] - state[old + 1]
        out[4] = (dx * math.cos(out[3]) + dy * math.sin(out[3])) / dt
        out[5] = wrap(state[new + 3] - state[old + 3]) / dt


@njit
def see(rows, i, shared, board, latency):
    """One step of perception: look, expose, deliver, predict. Writes the believed row and returns the policy's rho."""
    state = rows.state[i]
    now = state[episode_row.STEP] * TICK
    look(rows, i, shared, board)
    expose(rows, i, shared, board, now, latency)
    deliver(rows, i, shared, now)
    believed = rows.believed[i]
    rho = belief_predict(rows.belief[i], now, shared.belief, believed)
    dx, dy, dz = believed[0] - board[board_row.X], believed[1] - board[board_row.Y], believed[2] - board[board_row.Z]
    state[episode_row.ERROR] = math.sqrt(dx * dx + dy * dy + dz * dz)
    if shared.config[config_row.AUGMENTATION] == 0.0:
        raw_estimate(state, believed)
    return rho if shared.config[config_row.RHO] > 0.0 and shared.config[config_row.AUGMENTATION] > 0.0 else 1.0


@njit
def latency_now(rows, i):
    """The detector's latency for this exposure, s."""
    return rows.state[i, episode_row.LATENCY] + uniform(rows.rng[i], -_JITTER, _JITTER)
