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
def _ask(action, limits, x):
    """The action as it is flown, clipped to [-1, 1], and its command, into the scratch row `x`."""
    for k in range(4):
        x[scratch_row.FLOWN + k] = min(1.0, max(-1.0, action[k]))
    flown = x[scratch_row.FLOWN : scratch_row.FLOWN + 4]
    command_from_action(flown, limits, x[scratch_row.COMMAND : scratch_row.COMMAND + 4])


@njit
def _guide(rows, i, shared):
    """Guidance on the command in row i's scratch row, from what its policy received."""
    x = rows.scratch[i]
    p, v, q = shown_odometry(x)
    gain, drag = own_gain(rows.gain[i], shared.config, shared.nominal)
    sigma = own_sigma(rows.belief[i], shared.config)
    command = x[scratch_row.COMMAND : scratch_row.COMMAND + 4]
    previous = rows.state[i, episode_row.COMMAND : episode_row.COMMAND + 4]
    if guide(command, p, v, q, rows.believed[i], sigma, previous, gain, drag, shared.guidance) not in (0, NOT_FINITE):
        action_from_command(command, shared.limits, x[scratch_row.FLOWN : scratch_row.FLOWN + 4])


@njit
def _order(state, command, substeps, order):
    """Fill the order row of this step: the commands before act until `command` (4,) arrives."""
    whole = int(state[episode_row.DELAY]) // substeps
    order[order_row.SINCE] = int(state[episode_row.DELAY]) % substeps
    for k in range(4):
        last, before = state[episode_row.COMMAND + k], state[episode_row.BEFORE + k]
        order[order_row.NEWER + k] = command[k] if whole == 0 else last
        order[order_row.OLDER + k] = last if whole == 0 else before
        state[episode_row.BEFORE + k], state[episode_row.COMMAND + k] = last, command[k]


@njit
def _active(vehicle, board, camera, error, unseen, weights, terms):
    """Active-perception terms (paper Sec. "Active Perception Rewards").

    `error` m of the believed position; `unseen` s since the newest accepted detection.
    """
    q = vehicle[state_row.Q : state_row.Q + 4]
    cx, cy, cz = camera_position(vehicle[state_row.P : state_row.P + 3], q, camera)
    ax, ay, az = optical_axis(q, camera)
    dx, dy, dz = board[board_row.X] - cx, board[board_row.Y] - cy, board[board_row.Z] - cz
    cosine = (dx * ax + dy * ay + dz * az) / max(math.sqrt(dx * dx + dy * dy + dz * dz), 1e-6)
    active_perception(error, cosine, unseen, weights, terms)


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
    rho = perceive(rows, i, shared, board, latency_now(state, rows.rng[i]))
    terms, weights = rows.terms[i], shared.weights
    flown = x[scratch_row.FLOWN : scratch_row.FLOWN + 4]
    shaping(p, v, q, w, board, flown, state[episode_row.ACTION : episode_row.ACTION + 4], weights, terms)
    if c[config_row.VISION] > 0.0:
        unseen = state[episode_row.STEP] * TICK - rows.belief[i, belief_row.TIME]
        _active(vehicle, board, rows.camera[i], state[episode_row.ERROR], unseen, weights, terms)
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
            x = rows.scratch[i]
            _ask(actions[i], shared.limits, x)
            if shared.config[config_row.GUIDANCE] > 0.0:
                _guide(rows, i, shared)
            _order(rows.state[i], x[scratch_row.COMMAND : scratch_row.COMMAND + 4], substeps, rows.order[i])
        fly_block(rows.vehicle, rows.order, rows.params, first, TICK / substeps, substeps)
        for i in range(first, last):
            _follow(rows, i, shared)
