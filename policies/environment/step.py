"""One control step of one episode, mapped over all rows.

Order within a step: guidance, if it is switched on, corrects the action; what is then flown reaches the rate loop after
its transport delay; 10 ms of physics, contact and the paper's Algorithm 1, perception, reward, observation. Reward and
observation receive the action that was flown. A row depends on no other row, so rows run in parallel, and the numbers
do not depend on the number of threads.
"""

from __future__ import annotations

import math

from groundcar.motion import board_row
from kernel.jit import njit, prange
from policies.environment import config_row, ended_row, episode_row, scratch_row
from policies.environment.config import TICK
from policies.environment.motion import extend_track
from policies.environment.observe import observe, own_gain, own_sigma, perceive, shown_odometry
from policies.environment.reset import reset_row
from policies.environment.vision import latency_now
from policies.estimation import belief_row
from policies.guidance.guide import NOT_FINITE, guide
from policies.task import result_row
from policies.task.contact import ONGOING, evaluate
from policies.task.observation import action_from_command, command_from_action
from policies.task.reward import active_perception, shaping, terminal, total
from vehicle.camera.pinhole import camera_position, optical_axis
from vehicle.quadrotor import order_row, state_row
from vehicle.quadrotor.batch import LANES, fly_block


@njit
def _guide(rows, i, shared, command):
    """Guidance on `command` (4,), from what the policy of row i received. True if a law changed it."""
    p, v, q = shown_odometry(rows.scratch[i])
    gain, drag = own_gain(rows, i, shared)
    sigma, previous = own_sigma(rows, i, shared), rows.state[i, episode_row.COMMAND : episode_row.COMMAND + 4]
    laws = guide(command, p, v, q, rows.believed[i], sigma, previous, gain, drag, shared.guidance)
    return laws not in (0, NOT_FINITE)


@njit
def _order(rows, i, shared, action):
    """Fill the order row of row i for this step: the commands before act until the new one arrives."""
    state, command, order = rows.state[i], rows.scratch[i, scratch_row.COMMAND : scratch_row.COMMAND + 4], rows.order[i]
    flown = rows.scratch[i, scratch_row.FLOWN : scratch_row.FLOWN + 4]
    for k in range(4):
        flown[k] = min(1.0, max(-1.0, action[k]))
    command_from_action(flown, shared.limits, command)
    if shared.config[config_row.GUIDANCE] > 0.0 and _guide(rows, i, shared, command):
        action_from_command(command, shared.limits, flown)
    substeps = int(shared.config[config_row.SUBSTEPS])
    whole = int(state[episode_row.DELAY]) // substeps
    order[order_row.SINCE] = int(state[episode_row.DELAY]) % substeps
    order[order_row.NEWER : order_row.NEWER + 4] = (
        command if whole == 0 else state[episode_row.COMMAND : episode_row.COMMAND + 4]
    )
    order[order_row.OLDER : order_row.OLDER + 4] = (
        state[episode_row.COMMAND : episode_row.COMMAND + 4]
        if whole == 0
        else state[episode_row.BEFORE : episode_row.BEFORE + 4]
    )
    state[episode_row.BEFORE : episode_row.BEFORE + 4] = state[episode_row.COMMAND : episode_row.COMMAND + 4]
    state[episode_row.COMMAND : episode_row.COMMAND + 4] = command


@njit
def _active(rows, i, shared, board, now):
    """Active-perception terms of row i (paper Sec. "Active Perception Rewards")."""
    vehicle, state = rows.vehicle[i], rows.state[i]
    q = vehicle[state_row.Q : state_row.Q + 4]
    cx, cy, cz = camera_position(vehicle[state_row.P : state_row.P + 3], q, rows.camera[i])
    ax, ay, az = optical_axis(q, rows.camera[i])
    dx, dy, dz = board[board_row.X] - cx, board[board_row.Y] - cy, board[board_row.Z] - cz
    cosine = (dx * ax + dy * ay + dz * az) / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)

    active_perception(
        state[episode_row.ERROR], cosine, now - rows.belief[i, belief_row.TIME], shared.weights, rows.terms[i]
    )


@njit
def _follow(rows, i, shared):
    """All of a control step that comes after the physics; a row that ends begins anew."""
    c, state, vehicle, x = shared.config, rows.state[i], rows.vehicle[i], rows.scratch[i]
    state[episode_row.STEP] += 1.0
    step = int(state[episode_row.STEP])
    state[episode_row.FILLED] = extend_track(
        rows.motion[i], rows.track[i], int(state[episode_row.FILLED]), step, rows.rng[i]
    )
    board = x[scratch_row.BOARD : scratch_row.BOARD + board_row.DIM]
    board[:] = rows.track[i, step]
    elapsed = (state[episode_row.STEP] - state[episode_row.BEGIN]) * TICK
    p, v, q, w = (
        vehicle[state_row.P : state_row.P + 3],
        vehicle[state_row.V : state_row.V + 3],
        vehicle[state_row.Q : state_row.Q + 4],
        vehicle[state_row.W : state_row.W + 3],
    )
    outcome = evaluate(p, v, q, w, board, elapsed, shared.rules, rows.result[i])
    rho = perceive(rows, i, shared, board, latency_now(rows, i))
    terms, weights = rows.terms[i], shared.weights
    flown = x[scratch_row.FLOWN : scratch_row.FLOWN + 4]
    shaping(p, v, q, w, board, flown, state[episode_row.ACTION : episode_row.ACTION + 4], weights, terms)
    if c[config_row.VISION] > 0.0:
        _active(rows, i, shared, board, state[episode_row.STEP] * TICK)
    terminal(rows.result[i], shared.rules, weights, terms)
    reward = total(terms)
    rows.reward[i] = reward
    state[episode_row.ACTION : episode_row.ACTION + 4] = flown
    state[episode_row.RETURN] += reward
    state[episode_row.SEEN] += state[episode_row.VISIBLE]
    state[episode_row.RHO] += rho
    if outcome == ONGOING:
        rows.done[i] = 0
        observe(rows, i, shared, rho)
        return
    rows.done[i] = 1
    _close(rows, i, board)
    reset_row(rows, i, shared)


@njit
def _close(rows, i, board):
    """Store the results of the episode that ends in the row's `ended`."""
    state, ended = rows.state[i], rows.ended[i]
    steps = state[episode_row.STEP] - state[episode_row.BEGIN]
    ended[: result_row.DIM] = rows.result[i]
    ended[ended_row.STEPS], ended[ended_row.SEEN], ended[ended_row.RHO] = (
        steps,
        state[episode_row.SEEN] / steps,
        state[episode_row.RHO] / steps,
    )
    ended[ended_row.RETURN], ended[ended_row.SPEED], ended[ended_row.INCLINATION] = (
        state[episode_row.RETURN],
        state[episode_row.SPEED],
        board[board_row.INCLINATION],
    )
    ended[ended_row.FAMILY], ended[ended_row.LAW], ended[ended_row.ERROR] = (
        state[episode_row.FAMILY],
        state[episode_row.LAW],
        state[episode_row.ERROR],
    )


@njit(parallel=True)
def step_rows(rows, shared, actions):
    """Advance every row by one control step under `actions` ((N, 4)), clipped to [-1, 1]."""
    count, substeps = rows.done.shape[0], int(shared.config[config_row.SUBSTEPS])
    for block in prange((count + LANES - 1) // LANES):
        first = block * LANES
        last = min(first + LANES, count)
        for i in range(first, last):
            _order(rows, i, shared, actions[i])
        fly_block(rows.vehicle, rows.order, rows.params, first, TICK / substeps, substeps)
        for i in range(first, last):
            _follow(rows, i, shared)
