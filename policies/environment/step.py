"""One control step of one episode, mapped over all rows.

Order within a step: the action reaches the rate loop after its transport delay, 10 ms of physics, contact and the
paper's Algorithm 1, perception, reward, observation. Nothing here knows of any other row, so rows run in parallel and
give the same numbers whatever the number of threads.
"""

from __future__ import annotations

import math

from kernel.jit import njit, prange
from policies.environment.config import C_SUBSTEPS, C_VISION, TICK
from policies.environment.motion import extend_track
from policies.environment.observe import observe, perceive
from policies.environment.reset import reset_row
from policies.environment.rows import (
    E_ERROR,
    E_FAMILY,
    E_INCLINATION,
    E_LAW,
    E_RETURN,
    E_RHO,
    E_SEEN,
    E_SPEED,
    E_STEPS,
    S_ACTION,
    S_BEFORE,
    S_BEGIN,
    S_COMMAND,
    S_DELAY,
    S_ERROR,
    S_FAMILY,
    S_FILLED,
    S_LAW,
    S_RETURN,
    S_RHO,
    S_SEEN,
    S_SPEED,
    S_STEP,
    S_VISIBLE,
    X_BOARD,
    X_COMMAND,
)
from policies.environment.vision import latency_now
from policies.estimation import belief_row
from policies.task import result_row
from policies.task.contact import ONGOING, evaluate
from policies.task.observation import command_from_action
from policies.task.reward import active_perception, shaping, terminal, total
from vehicle.camera.pinhole import camera_position, optical_axis
from vehicle.quadrotor import order_row, state_row
from vehicle.quadrotor.batch import LANES, fly_block


@njit
def _order(rows, i, shared, action):
    """What the vehicle of row i is asked in this step: the commands asked before act until the new one arrives."""
    state, command, order = rows.state[i], rows.scratch[i, X_COMMAND : X_COMMAND + 4], rows.order[i]
    command_from_action(action, command)
    substeps = int(shared.config[C_SUBSTEPS])
    whole = int(state[S_DELAY]) // substeps
    order[order_row.SINCE] = int(state[S_DELAY]) % substeps
    order[order_row.NEWER : order_row.NEWER + 4] = command if whole == 0 else state[S_COMMAND : S_COMMAND + 4]
    order[order_row.OLDER : order_row.OLDER + 4] = (
        state[S_COMMAND : S_COMMAND + 4] if whole == 0 else state[S_BEFORE : S_BEFORE + 4]
    )
    state[S_BEFORE : S_BEFORE + 4] = state[S_COMMAND : S_COMMAND + 4]
    state[S_COMMAND : S_COMMAND + 4] = command


@njit
def _active(rows, i, shared, board, now):
    """Active-perception terms of row i (paper Sec. "Active Perception Rewards")."""
    vehicle, state = rows.vehicle[i], rows.state[i]
    q = vehicle[state_row.Q : state_row.Q + 4]
    cx, cy, cz = camera_position(vehicle[state_row.P : state_row.P + 3], q, rows.camera[i])
    ax, ay, az = optical_axis(q, rows.camera[i])
    dx, dy, dz = board[0] - cx, board[1] - cy, board[2] - cz
    cosine = (dx * ax + dy * ay + dz * az) / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)

    active_perception(state[S_ERROR], cosine, now - rows.belief[i, belief_row.TIME], shared.weights, rows.terms[i])


@njit
def _follow(rows, i, shared, action):
    """All of a control step that comes after the physics; a row that ends begins anew."""
    c, state, vehicle, x = shared.config, rows.state[i], rows.vehicle[i], rows.scratch[i]
    state[S_STEP] += 1.0
    step = int(state[S_STEP])
    state[S_FILLED] = extend_track(rows.motion[i], rows.track[i], int(state[S_FILLED]), step, rows.rng[i])
    board = x[X_BOARD : X_BOARD + 8]
    board[:] = rows.track[i, step]
    elapsed = (state[S_STEP] - state[S_BEGIN]) * TICK
    p, v, q, w = (
        vehicle[state_row.P : state_row.P + 3],
        vehicle[state_row.V : state_row.V + 3],
        vehicle[state_row.Q : state_row.Q + 4],
        vehicle[state_row.W : state_row.W + 3],
    )
    outcome = evaluate(p, v, q, w, board, elapsed, shared.rules, rows.result[i])
    rho = perceive(rows, i, shared, board, latency_now(rows, i))
    terms, weights = rows.terms[i], shared.weights
    clipped = x[0:4]
    for k in range(4):
        clipped[k] = min(1.0, max(-1.0, action[k]))
    shaping(p, v, q, w, board, clipped, state[S_ACTION : S_ACTION + 4], weights, terms)
    if c[C_VISION] > 0.0:
        _active(rows, i, shared, board, state[S_STEP] * TICK)
    terminal(rows.result[i], shared.rules, weights, terms)
    reward = total(terms)
    rows.reward[i] = reward
    state[S_ACTION : S_ACTION + 4] = clipped
    state[S_RETURN] += reward
    state[S_SEEN] += state[S_VISIBLE]
    state[S_RHO] += rho
    if outcome == ONGOING:
        rows.done[i] = 0
        observe(rows, i, shared, rho)
        return
    rows.done[i] = 1
    _close(rows, i, board)
    reset_row(rows, i, shared)


@njit
def _close(rows, i, board):
    """Keep what is to be known of the episode that ends."""
    state, ended = rows.state[i], rows.ended[i]
    steps = state[S_STEP] - state[S_BEGIN]
    ended[: result_row.DIM] = rows.result[i]
    ended[E_STEPS], ended[E_SEEN], ended[E_RHO] = steps, state[S_SEEN] / steps, state[S_RHO] / steps
    ended[E_RETURN], ended[E_SPEED], ended[E_INCLINATION] = state[S_RETURN], state[S_SPEED], board[6]
    ended[E_FAMILY], ended[E_LAW], ended[E_ERROR] = state[S_FAMILY], state[S_LAW], state[S_ERROR]


@njit(parallel=True)
def step_rows(rows, shared, actions):
    """Advance every row by one control step under `actions` ((N, 4)), clipped to [-1, 1]."""
    count, substeps = rows.done.shape[0], int(shared.config[C_SUBSTEPS])
    for block in prange((count + LANES - 1) // LANES):
        first = block * LANES
        last = min(first + LANES, count)
        for i in range(first, last):
            _order(rows, i, shared, actions[i])
        fly_block(rows.vehicle, rows.order, rows.params, first, TICK / substeps, substeps)
        for i in range(first, last):
            _follow(rows, i, shared, actions[i])
