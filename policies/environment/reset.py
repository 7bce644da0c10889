"""The start of an episode: draw of vehicle, detector, motion and start, then hovering until the board is known."""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row
from kernel.jit import njit, prange
from kernel.random import uniform
from kernel.rotations import from_euler
from policies.environment import config_row, episode_row, scratch_row
from policies.environment.config import TICK
from policies.environment.motion import extend_track, motion_draw
from policies.environment.observe import observe, perceive, true_gain
from policies.environment.vision import latency_now, look, see
from policies.estimation.board_ekf import belief_reset, belief_valid
from policies.estimation.thrust_drag import gain_reset, gain_update
from policies.task.observation import action_from_command, clear_history
from vehicle.camera import bias_row, camera_row
from vehicle.camera.noise import draw_bias
from vehicle.quadrotor import airframe_row, command_row, state_row
from vehicle.quadrotor.airframe import GRAVITY
from vehicle.quadrotor.rate_control import settle_filters

_TRIES = 40  # redraws of the start until the board is in view (paper App. "Initial Conditions")


@njit
def _draw_vehicle(rows, i, shared):
    """Randomise dynamics, camera, detector and delays of row i (paper App. "Domain Randomization", and delays)."""
    c, rng, state, params = shared.config, rows.rng[i], rows.state[i], rows.params[i]
    params[:] = shared.nominal
    mass = uniform(rng, 1.0 - c[config_row.MASS], 1.0 + c[config_row.MASS])
    inertia = uniform(rng, 1.0 - c[config_row.INERTIA], 1.0 + c[config_row.INERTIA])
    params[airframe_row.MASS] *= mass
    params[airframe_row.MOTOR_THRUST] *= mass * uniform(
        rng, 1.0 - c[config_row.THRUST_TO_WEIGHT], 1.0 + c[config_row.THRUST_TO_WEIGHT]
    )
    drag = max(0.0, uniform(rng, c[config_row.DRAG_LOW], c[config_row.DRAG_HIGH]))
    gain = uniform(rng, c[config_row.RATE_GAIN_LOW], c[config_row.RATE_GAIN_HIGH])
    for k in range(3):
        params[airframe_row.INERTIA + k] *= inertia
        params[airframe_row.DRAG + k] *= drag
        params[airframe_row.RATE_K + k] *= gain
    params[airframe_row.MOTOR_LAG] *= uniform(rng, c[config_row.MOTOR_LAG_LOW], c[config_row.MOTOR_LAG_HIGH])
    rows.camera[i] = shared.camera
    rows.camera[i, camera_row.TILT] += uniform(rng, -c[config_row.CAMERA_TILT], c[config_row.CAMERA_TILT])
    state[episode_row.PERIOD] = 1.0 / uniform(rng, c[config_row.DETECTOR_LOW], c[config_row.DETECTOR_HIGH])
    state[episode_row.LATENCY] = uniform(rng, c[config_row.LATENCY_LOW], c[config_row.LATENCY_HIGH])
    share = uniform(rng, 0.0, 1.0) ** c[config_row.NOISE_POWER]
    state[episode_row.NOISE] = c[config_row.NOISE_LOW] + (c[config_row.NOISE_HIGH] - c[config_row.NOISE_LOW]) * share
    state[episode_row.ODOMETRY] = c[config_row.ODOMETRY] * uniform(rng, 0.0, 1.0)
    draw_bias(shared.noise, state[episode_row.NOISE], rng, state[episode_row.BIAS : episode_row.BIAS + bias_row.DIM])
    state[episode_row.DELAY] = round(
        uniform(rng, c[config_row.COMMAND_DELAY_LOW], c[config_row.COMMAND_DELAY_HIGH]) / TICK * c[config_row.SUBSTEPS]
    )


@njit
def _place(rows, i, shared, board, calm):
    """Put the vehicle behind and above `board` (paper's table "Initialization parameters"); `calm`: hovering level."""
    c, rng, vehicle = shared.config, rows.rng[i], rows.vehicle[i]
    for k in range(state_row.DIM):
        vehicle[k] = 0.0
    distance = uniform(rng, c[config_row.DISTANCE_LOW], c[config_row.DISTANCE_HIGH])
    bearing = board[board_row.HEADING] + math.pi + uniform(rng, -c[config_row.AZIMUTH], c[config_row.AZIMUTH])
    vehicle[state_row.P] = board[board_row.X] + distance * math.cos(bearing)
    vehicle[state_row.P + 1] = board[board_row.Y] + distance * math.sin(bearing)
    vehicle[state_row.P + 2] = board[board_row.Z] + uniform(rng, c[config_row.HEIGHT_LOW], c[config_row.HEIGHT_HIGH])
    scale = 0.0 if calm else 1.0
    yaw = bearing + math.pi + uniform(rng, -c[config_row.YAW], c[config_row.YAW])
    roll, pitch = (
        scale * uniform(rng, -c[config_row.TILT], c[config_row.TILT]),
        scale * uniform(rng, -c[config_row.TILT], c[config_row.TILT]),
    )
    q = from_euler(roll, pitch, yaw)
    for k in range(4):
        vehicle[state_row.Q + k] = q[k]
    for k in range(3):
        rate = c[config_row.RATE_Z] if k == 2 else c[config_row.RATE_XY]
        vehicle[state_row.W + k] = scale * uniform(rng, -rate, rate)
        speed = c[config_row.VELOCITY_Z] if k == 2 else c[config_row.VELOCITY_XY]
        vehicle[state_row.V + k] = scale * uniform(rng, -speed, speed)
        vehicle[state_row.HEADROOM_UP + k] = vehicle[state_row.HEADROOM_UP + 3 + k] = 1.0
    angle, wind = uniform(rng, -math.pi, math.pi), c[config_row.WIND] * uniform(rng, 0.0, 1.0)
    vehicle[state_row.WIND], vehicle[state_row.WIND + 1] = wind * math.cos(angle), wind * math.sin(angle)
    hover = rows.params[i, airframe_row.MASS] * GRAVITY / (4.0 * rows.params[i, airframe_row.MOTOR_THRUST])
    for k in range(4):
        vehicle[state_row.MOTOR + k] = vehicle[state_row.COMMAND + k] = min(1.0, hover)
    vehicle[state_row.F + 2] = GRAVITY
    settle_filters(vehicle, rows.params[i], TICK / shared.config[config_row.SUBSTEPS])


@njit
def _watch(rows, i, shared, steps):
    """Hover and perceive for `steps` control steps, from step 0. True if the belief is then valid."""
    state = rows.state[i]
    hover, drag = (
        GRAVITY / true_gain(rows, i, shared),
        shared.nominal[airframe_row.DRAG] / shared.nominal[airframe_row.MASS],
    )
    for k in range(steps + 1):
        state[episode_row.STEP] = k
        perceive(rows, i, shared, rows.track[i, k], latency_now(state, rows.rng[i]) if k > 0 or steps > 0 else 0.0)
        if k < steps:
            gain_update(rows.gain[i], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, hover, TICK, 0.045, drag, GRAVITY)
    now = state[episode_row.STEP] * TICK
    return steps == 0 or shared.config[config_row.VISION] == 0.0 or belief_valid(rows.belief[i], now, shared.belief)


@njit
def reset_row(rows, i, shared):
    """Begin a new episode in row i of `rows` (Rows) and write its first observation. `shared` (Shared)."""
    c, rng, state = shared.config, rows.rng[i], rows.state[i]
    for k in range(episode_row.DIM):
        state[k] = 0.0
    _draw_vehicle(rows, i, shared)
    state[episode_row.SPEED], state[episode_row.FAMILY], state[episode_row.LAW] = motion_draw(rows.motion[i], c, rng)
    rows.track[i, 0] = rows.motion[i, rows.motion.shape[1] - board_row.DIM :]
    state[episode_row.FILLED] = extend_track(rows.motion[i], rows.track[i], 0, 1, rng)
    vision = c[config_row.VISION] > 0.0
    for attempt in range(_TRIES):
        warm = uniform(rng, 0.0, 1.0) < c[config_row.WARM]
        steps = int(uniform(rng, c[config_row.WARM_TIME_LOW], c[config_row.WARM_TIME_HIGH]) / TICK) if warm else 0
        state[episode_row.FILLED] = extend_track(
            rows.motion[i], rows.track[i], int(state[episode_row.FILLED]), steps, rng
        )
        anchor = steps if uniform(rng, 0.0, 1.0) < 0.5 else 0
        _place(rows, i, shared, rows.track[i, anchor], warm)
        if vision and look(rows.vehicle[i], rows.track[i, anchor], rows.camera[i], state) == 0 and attempt < _TRIES - 1:
            continue
        state[episode_row.EXPOSURE], state[episode_row.BEGIN] = 0.0, steps
        state[episode_row.RAW : episode_row.DIM] = 0.0  # left over from a failed try
        belief_reset(rows.belief[i])
        clear_history(rows.history[i])
        gain_reset(rows.gain[i], GRAVITY)
        if _watch(rows, i, shared, steps):
            break
    x = rows.scratch[i]
    command = x[scratch_row.COMMAND : scratch_row.COMMAND + 4]
    command[0] = command[1] = command[2] = 0.0
    command[command_row.THRUST] = GRAVITY / true_gain(rows, i, shared) if state[episode_row.BEGIN] > 0.0 else GRAVITY
    state[episode_row.COMMAND : episode_row.COMMAND + 4] = command
    state[episode_row.BEFORE : episode_row.BEFORE + 4] = command
    action_from_command(command, shared.limits, state[episode_row.ACTION : episode_row.ACTION + 4])
    rho = 1.0
    if vision:
        rho = see(rows, i, shared, rows.track[i, int(state[episode_row.STEP])], 0.0)
    observe(rows, i, shared, rho)


@njit(parallel=True)
def reset_rows(rows, shared, chosen):
    """Begin a new episode in every row i for which `chosen[i]`."""
    for i in prange(rows.done.shape[0]):
        if chosen[i]:
            reset_row(rows, np.int64(i), shared)  # an index of prange is unsigned: all below would be compiled twice
