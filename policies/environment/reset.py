"""How an episode begins: the draw of vehicle, detector, motion and start, and hovering until the board is known."""

from __future__ import annotations

import math

from kernel.jit import njit, prange
from kernel.random import uniform
from kernel.rotations import from_euler
from policies.environment.config import (
    C_AZIMUTH,
    C_CAMERA_TILT,
    C_COMMAND_HIGH,
    C_COMMAND_LOW,
    C_DET_HIGH,
    C_DET_LOW,
    C_DISTANCE_HIGH,
    C_DISTANCE_LOW,
    C_DRAG_HIGH,
    C_DRAG_LOW,
    C_HEIGHT_HIGH,
    C_HEIGHT_LOW,
    C_INERTIA,
    C_LATENCY_HIGH,
    C_LATENCY_LOW,
    C_MASS,
    C_MOTOR_LAG_HIGH,
    C_MOTOR_LAG_LOW,
    C_NOISE_HIGH,
    C_NOISE_LOW,
    C_NOISE_POWER,
    C_ODOMETRY,
    C_RATE0_XY,
    C_RATE0_Z,
    C_RATE_GAIN_HIGH,
    C_RATE_GAIN_LOW,
    C_SUBSTEPS,
    C_TILT0,
    C_TWR,
    C_V0_XY,
    C_V0_Z,
    C_VISION,
    C_WARM,
    C_WARM_HIGH,
    C_WARM_LOW,
    C_WIND,
    C_YAW0,
    TICK,
)
from policies.environment.motion import extend_track, motion_draw
from policies.environment.observe import observe, perceive, true_gain
from policies.environment.rows import (
    S_ACTION,
    S_BEFORE,
    S_BEGIN,
    S_BIAS,
    S_COMMAND,
    S_DELAY,
    S_DIM,
    S_EXPOSURE,
    S_FAMILY,
    S_FILLED,
    S_LATENCY,
    S_LAW,
    S_NOISE,
    S_ODOMETRY,
    S_PERIOD,
    S_RAW,
    S_SPEED,
    S_STEP,
    X_COMMAND,
)
from policies.environment.vision import latency_now, look, see
from policies.estimation.board_ekf import belief_reset, belief_valid
from policies.estimation.thrust_drag import gain_reset, gain_update
from policies.task.observation import action_from_command, clear_history
from vehicle.camera import camera_row
from vehicle.camera.noise import draw_bias
from vehicle.quadrotor import airframe_row, state_row
from vehicle.quadrotor.airframe import GRAVITY
from vehicle.quadrotor.rate_control import settle_filters

_TRIES = 40  # redraws of the start until the board is in view (paper App. "Initial Conditions")


@njit
def _draw_vehicle(rows, i, shared):
    """Randomise dynamics, camera, detector and delays of row i (paper App. "Domain Randomization", and delays)."""
    c, rng, state, params = shared.config, rows.rng[i], rows.state[i], rows.params[i]
    params[:] = shared.nominal
    mass = uniform(rng, 1.0 - c[C_MASS], 1.0 + c[C_MASS])
    inertia = uniform(rng, 1.0 - c[C_INERTIA], 1.0 + c[C_INERTIA])
    params[airframe_row.MASS] *= mass
    params[airframe_row.MOTOR_THRUST] *= mass * uniform(rng, 1.0 - c[C_TWR], 1.0 + c[C_TWR])
    drag = max(0.0, uniform(rng, c[C_DRAG_LOW], c[C_DRAG_HIGH]))
    gain = uniform(rng, c[C_RATE_GAIN_LOW], c[C_RATE_GAIN_HIGH])
    for k in range(3):
        params[airframe_row.INERTIA + k] *= inertia
        params[airframe_row.DRAG + k] *= drag
        params[airframe_row.RATE_K + k] *= gain
    params[airframe_row.MOTOR_LAG] *= uniform(rng, c[C_MOTOR_LAG_LOW], c[C_MOTOR_LAG_HIGH])
    rows.camera[i] = shared.camera
    rows.camera[i, camera_row.TILT] += uniform(rng, -c[C_CAMERA_TILT], c[C_CAMERA_TILT])
    state[S_PERIOD] = 1.0 / uniform(rng, c[C_DET_LOW], c[C_DET_HIGH])
    state[S_LATENCY] = uniform(rng, c[C_LATENCY_LOW], c[C_LATENCY_HIGH])
    share = uniform(rng, 0.0, 1.0) ** c[C_NOISE_POWER]
    state[S_NOISE] = c[C_NOISE_LOW] + (c[C_NOISE_HIGH] - c[C_NOISE_LOW]) * share
    state[S_ODOMETRY] = c[C_ODOMETRY] * uniform(rng, 0.0, 1.0)
    draw_bias(shared.noise, state[S_NOISE], rng, state[S_BIAS : S_BIAS + 7])
    state[S_DELAY] = round(uniform(rng, c[C_COMMAND_LOW], c[C_COMMAND_HIGH]) / TICK * c[C_SUBSTEPS])


@njit
def _place(rows, i, shared, board, calm):
    """Put the drone behind and above `board` (paper's table "Initialization parameters"); `calm`: hovering level."""
    c, rng, vehicle = shared.config, rows.rng[i], rows.vehicle[i]
    for k in range(state_row.DIM):
        vehicle[k] = 0.0
    distance = uniform(rng, c[C_DISTANCE_LOW], c[C_DISTANCE_HIGH])
    bearing = board[3] + math.pi + uniform(rng, -c[C_AZIMUTH], c[C_AZIMUTH])
    vehicle[state_row.P] = board[0] + distance * math.cos(bearing)
    vehicle[state_row.P + 1] = board[1] + distance * math.sin(bearing)
    vehicle[state_row.P + 2] = board[2] + uniform(rng, c[C_HEIGHT_LOW], c[C_HEIGHT_HIGH])
    scale = 0.0 if calm else 1.0
    yaw = bearing + math.pi + uniform(rng, -c[C_YAW0], c[C_YAW0])
    roll, pitch = scale * uniform(rng, -c[C_TILT0], c[C_TILT0]), scale * uniform(rng, -c[C_TILT0], c[C_TILT0])
    q = from_euler(roll, pitch, yaw)
    for k in range(4):
        vehicle[state_row.Q + k] = q[k]
    for k in range(3):
        rate = c[C_RATE0_Z] if k == 2 else c[C_RATE0_XY]
        vehicle[state_row.W + k] = scale * uniform(rng, -rate, rate)
        speed = c[C_V0_Z] if k == 2 else c[C_V0_XY]
        vehicle[state_row.V + k] = scale * uniform(rng, -speed, speed)
        vehicle[state_row.HEADROOM_UP + k] = vehicle[state_row.HEADROOM_UP + 3 + k] = 1.0
    angle, wind = uniform(rng, -math.pi, math.pi), c[C_WIND] * uniform(rng, 0.0, 1.0)
    vehicle[state_row.WIND], vehicle[state_row.WIND + 1] = wind * math.cos(angle), wind * math.sin(angle)
    hover = rows.params[i, airframe_row.MASS] * GRAVITY / (4.0 * rows.params[i, airframe_row.MOTOR_THRUST])
    for k in range(4):
        vehicle[state_row.MOTOR + k] = vehicle[state_row.COMMAND + k] = min(1.0, hover)
    vehicle[state_row.F + 2] = GRAVITY
    settle_filters(vehicle, rows.params[i], TICK / shared.config[C_SUBSTEPS])


@njit
def _watch(rows, i, shared, steps):
    """Hover for `steps` control steps and look, from step 0. True if the filter then knows the board."""
    state = rows.state[i]
    hover, drag = (
        GRAVITY / true_gain(rows, i, shared),
        shared.nominal[airframe_row.DRAG] / shared.nominal[airframe_row.MASS],
    )
    for k in range(steps + 1):
        state[S_STEP] = k
        perceive(rows, i, shared, rows.track[i, k], latency_now(rows, i) if k > 0 or steps > 0 else 0.0)
        if k < steps:
            gain_update(rows.gain[i], 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, hover, TICK, 0.045, drag, GRAVITY)
    now = state[S_STEP] * TICK
    return steps == 0 or shared.config[C_VISION] == 0.0 or belief_valid(rows.belief[i], now, shared.belief)


@njit
def reset_row(rows, i, shared):
    """Begin a new episode in row i and write its first observation."""
    c, rng, state = shared.config, rows.rng[i], rows.state[i]
    for k in range(S_DIM):
        state[k] = 0.0
    _draw_vehicle(rows, i, shared)
    state[S_SPEED], state[S_FAMILY], state[S_LAW] = motion_draw(rows.motion[i], c, rng)
    rows.track[i, 0] = rows.motion[i, rows.motion.shape[1] - 8 :]
    state[S_FILLED] = extend_track(rows.motion[i], rows.track[i], 0, 1, rng)
    vision = c[C_VISION] > 0.0
    for attempt in range(_TRIES):
        warm = uniform(rng, 0.0, 1.0) < c[C_WARM]
        steps = int(uniform(rng, c[C_WARM_LOW], c[C_WARM_HIGH]) / TICK) if warm else 0
        state[S_FILLED] = extend_track(rows.motion[i], rows.track[i], int(state[S_FILLED]), steps, rng)
        anchor = steps if uniform(rng, 0.0, 1.0) < 0.5 else 0
        _place(rows, i, shared, rows.track[i, anchor], warm)
        if vision and look(rows, i, shared, rows.track[i, anchor]) == 0 and attempt < _TRIES - 1:
            continue
        state[S_EXPOSURE], state[S_BEGIN] = 0.0, steps
        state[S_RAW:S_DIM] = 0.0  # what a failed try left under way
        belief_reset(rows.belief[i])
        clear_history(rows.history[i])
        gain_reset(rows.gain[i], GRAVITY)
        if _watch(rows, i, shared, steps):
            break
    x = rows.scratch[i]
    command = x[X_COMMAND : X_COMMAND + 4]
    command[0] = command[1] = command[2] = 0.0
    command[3] = GRAVITY / true_gain(rows, i, shared) if state[S_BEGIN] > 0.0 else GRAVITY
    state[S_COMMAND : S_COMMAND + 4] = command
    state[S_BEFORE : S_BEFORE + 4] = command
    action_from_command(command, state[S_ACTION : S_ACTION + 4])
    rho = 1.0
    if vision:
        rho = see(rows, i, shared, rows.track[i, int(state[S_STEP])], 0.0)
    observe(rows, i, shared, rho)


@njit(parallel=True)
def reset_rows(rows, shared):
    """Begin a new episode in every row."""
    for i in prange(rows.done.shape[0]):
        reset_row(rows, i, shared)
