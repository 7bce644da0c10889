"""Training data of the motion predictor: drawn board motions, observed through camera model, delays and belief."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundcar.motion import board_motion as mo
from groundcar.motion import board_row, motion_row, path_row, speed_row
from groundcar.motion import paths as tr
from groundcar.motion import speed_laws as sl
from groundcar.motion.splines import random_spline
from groundcar.scout.params import load_scout
from kernel.jit import njit
from kernel.random import stream, uniform
from kernel.rotations import from_euler
from policies.estimation import belief_row, belief_state, measured_row
from policies.estimation import board_ekf as bf
from policies.estimation.ctrv import BeliefParams
from policies.prediction import context_row, net_row, past_row, target_row
from policies.prediction import learned as pd
from policies.prediction.future import HORIZON, STEP
from vehicle.camera import bias_row, detection_row
from vehicle.camera.noise import draw_bias, measured_noise, observe_board, paper_noise
from vehicle.camera.pinhole import Camera

DT = 0.01
SNAPSHOTS = 16  # examples of one drive
SEEN = 620  # ticks a drive is observed
TICKS = SEEN + round((HORIZON - 1) * STEP / DT) + 1
EVERY = 3  # rows of the future between two targets
TARGETS = (HORIZON - 1) // EVERY + 1  # each: x, y, heading, speed, in the believed frame


@njit
def draw_motion(row, aux, response, damping, top, rng):
    """Draw a board's motion into `row` (board row) and `aux` (motion row): path, speed law, and the car's response.

    `response` rad/s, `damping`: the real car's, about which six in ten are drawn; `top` m/s.
    """
    aux[:] = 0.0
    path, law = (
        aux[motion_row.PATH : motion_row.PATH + path_row.DIM],
        aux[motion_row.SPEED : motion_row.SPEED + speed_row.DIM],
    )
    angle = uniform(rng, -math.pi, math.pi)
    path[path_row.HEADING], path[path_row.COS], path[path_row.SIN] = angle, math.cos(angle), math.sin(angle)
    # Drawn to beyond `top`, or else the predictor would learn that the fastest boards slow down.
    speed, family = min(uniform(rng, 0.0, 1.15 * top), uniform(rng, 0.0, 1.6 * top)), uniform(rng, 0.0, 1.0)
    aux[motion_row.CHANGE_TIME], aux[motion_row.CHANGE_LENGTH] = math.inf, math.inf
    kind = tr.SPLINE
    if family < 0.55:
        random_spline(rng, path, speed)
    elif family < 0.70:
        kind, path[path_row.SIZE] = tr.LINE, uniform(rng, 8.0, 14.0)
    elif family < 0.78:
        kind, path[path_row.SIZE], path[path_row.LENGTH] = tr.RACETRACK, uniform(rng, 3.0, 5.0), uniform(rng, 2.0, 6.0)
    elif family < 0.88:
        kind, path[path_row.SIZE], speed = tr.FIGURE8, uniform(rng, 3.5, 5.0), min(speed, 2.5)
    elif family < 0.97:
        kind, path[path_row.SIZE] = tr.ARC, uniform(rng, max(1.5, speed / 1.2), 10.0)
        path[path_row.TURN] = 1.0 if uniform(rng, 0.0, 1.0) < 0.5 else -1.0
    else:
        kind = tr.STATIC
    way = uniform(rng, 0.0, 1.0)
    law[speed_row.TAU], law[speed_row.PERIOD], law[speed_row.SWITCH], law[speed_row.V] = (
        uniform(rng, 0.6, 1.5),
        1.0,
        math.inf,
        speed,
    )
    speed_kind = sl.CONSTANT
    if way < 0.35:
        speed_kind = sl.COSINE
        law[speed_row.V], law[speed_row.V2] = speed * uniform(rng, 0.2, 0.9), speed
        law[speed_row.PERIOD], law[speed_row.PHASE] = uniform(rng, 1.5, 6.0), uniform(rng, -math.pi, math.pi)
    elif way < 0.5:
        speed_kind = sl.SCHEDULED
        law[speed_row.V2] = min(1.15 * top, speed * uniform(rng, 0.3, 1.4))
        law[speed_row.RAMP], law[speed_row.SWITCH] = uniform(rng, 0.2, 1.5), uniform(rng, 1.0, 8.0)
    if way > 0.7 or uniform(rng, 0.0, 1.0) < 0.2:
        law[speed_row.SIGMA] = uniform(rng, 0.05, 0.13)
    aux[motion_row.PATH_KIND], aux[motion_row.SPEED_KIND] = kind, speed_kind
    switch = law[speed_row.SWITCH]
    if kind == tr.SPLINE and uniform(rng, 0.0, 1.0) < (0.5 if speed_kind == sl.SCHEDULED else 0.15):
        aux[motion_row.CHANGE_TIME] = uniform(rng, 1.0, 8.0)
        aux[motion_row.ARC_RADIUS] = uniform(rng, max(2.0, speed / 1.2), 7.0)
        if uniform(rng, 0.0, 1.0) < 0.5:
            aux[motion_row.ARC_RADIUS] = -aux[motion_row.ARC_RADIUS]
    aux[motion_row.DAMPING], aux[motion_row.ACCEL_LIMIT] = 1.0, math.inf
    car = uniform(rng, 0.0, 1.0)
    if car < 0.6:
        aux[motion_row.RESPONSE] = response * uniform(rng, 0.78, 1.33)
        aux[motion_row.DAMPING], aux[motion_row.ACCEL_LIMIT] = damping * uniform(rng, 0.67, 2.0), uniform(rng, 2.0, 5.0)
    elif car < 0.9:
        aux[motion_row.RESPONSE] = uniform(rng, 6.0, 16.0)
        aux[motion_row.DAMPING], aux[motion_row.ACCEL_LIMIT] = uniform(rng, 0.6, 1.2), uniform(rng, 2.0, 5.0)
    u = uniform(rng, 0.0, 1.0) * tr.path_lap(kind, path)
    moving = uniform(rng, 0.0, 1.0) < 0.85
    inclination = math.radians(uniform(rng, 0.0, 80.0))
    mo.motion_reset(row, aux, u, 1.5, inclination, moving)
    if math.isinf(aux[motion_row.CHANGE_TIME]):
        law[speed_row.SWITCH] = switch
    if not moving:
        aux[motion_row.ACCEL_LIMIT] = min(aux[motion_row.ACCEL_LIMIT], 2.0)


@njit
def roll(row, aux, lead, rng, out):
    """Drive `lead` ticks without output, then write every tick's board row to `out` ((T, 8))."""
    for _ in range(lead):
        mo.motion_step(row, aux, DT, rng)
    for k in range(out.shape[0]):
        out[k] = row
        mo.motion_step(row, aux, DT, rng)


@njit
def _target(truth, tick, x, out):
    """The next TARGETS rows of `truth`, in the frame of the believed board `x`."""
    c, s = math.cos(x[belief_state.HEADING]), math.sin(x[belief_state.HEADING])
    stride = round(EVERY * STEP / DT)
    for j in range(TARGETS):
        row, to = truth[tick + j * stride], target_row.DIM * j
        dx, dy = row[board_row.X] - x[belief_state.X], row[board_row.Y] - x[belief_state.Y]
        out[to + target_row.X], out[to + target_row.Y] = c * dx + s * dy, c * dy - s * dx
        out[to + target_row.HEADING] = bf.wrap(row[board_row.HEADING] - x[belief_state.HEADING])
        out[to + target_row.SPEED] = row[board_row.SPEED]


@njit
def watch(truth, noise, scale, losses, bparams, cam, rng, inputs, contexts, targets, states, histories):
    """Observe one drive (`truth` (T, 8), every DT) with a following camera; returns the number of examples.

    Fills `inputs` (SNAPSHOTS, input_row.DIM) float32, `contexts` (SNAPSHOTS, context_row.DIM), `targets` (SNAPSHOTS,
    target_row.DIM * TARGETS), `states` (SNAPSHOTS, 10: belief state, time and tick) and, if it has rows, `histories`.
    `losses`: probability of losing the board in one second.
    """
    belief, history = np.zeros(belief_row.DIM), np.zeros(pd.HISTORY_DIM)
    x, cov = np.zeros(belief_state.PREDICTED_DIM), np.zeros(belief_state.DIM * belief_state.DIM)
    seen, bias, z, r, sigma = (
        np.zeros(detection_row.DIM),
        np.zeros(bias_row.DIM),
        np.zeros(measured_row.DIM),
        np.zeros(measured_row.DIM),
        np.zeros(3),
    )
    diagonal = belief_state.DIM + 1  # step along the covariance's diagonal
    queue = np.zeros((8, 1 + detection_row.DIM))
    p, v, board_v = np.zeros(3), np.zeros(3), np.zeros(3)
    draw_bias(noise, scale, rng, bias)
    period, delay = 1.0 / uniform(rng, 20.0, 60.0), uniform(rng, 0.02, 0.045)
    far, near = uniform(rng, 1.5, 4.0), uniform(rng, 0.6, 2.0)
    side, up, closing = uniform(rng, -0.7, 0.7), uniform(rng, 0.4, 0.9), uniform(rng, 1.0, 4.0)
    next_frame, blind_until, head, tail, made = uniform(rng, 0.0, period), -1.0, 0, 0, 0
    watched = truth.shape[0] - round((HORIZON - 1) * STEP / DT) - 1
    gap = max(1, watched // SNAPSHOTS)
    due = round(uniform(rng, 8.0, 8.0 + gap))
    for k in range(watched):
        t, board = k * DT, truth[k]
        if t > blind_until and uniform(rng, 0.0, 1.0) < losses * DT:
            blind_until = t + uniform(rng, 0.05, 1.0)
        if t >= next_frame:
            next_frame += period
            if t > blind_until and tail - head < 8:
                away = near + (far - near) * math.exp(-t / closing)
                angle = board[board_row.HEADING] + math.pi + side
                p[0], p[1] = (
                    board[board_row.X] + away * math.cos(angle),
                    board[board_row.Y] + away * math.sin(angle),
                )
                p[2] = board[board_row.Z] + up * away
                board_v[0], board_v[1] = (
                    board[board_row.SPEED] * math.cos(board[board_row.HEADING]),
                    board[board_row.SPEED] * math.sin(board[board_row.HEADING]),
                )
                v[:] = board_v
                v[2] = -0.3
                pose = from_euler(0.0, math.atan(up) - 0.26, angle + math.pi)
                board_q = from_euler(0.0, -board[board_row.INCLINATION], board[board_row.HEADING])
                observe_board(p, pose, v, board, board_q, board_v, cam, noise, scale, bias, rng, seen)
                queue[tail % 8, 0] = t
                queue[tail % 8, 1:] = seen
                tail += 1
        while head < tail and queue[head % 8, 0] + delay <= t:
            entry = queue[head % 8]
            head += 1
            seen[:] = entry[1:]
            sigma[:] = max(0.002, 0.5 * (seen[detection_row.SIGMA_LATERAL] + seen[detection_row.SIGMA_DEPTH]))
            rotation = max(0.005, 0.577 * seen[detection_row.SIGMA_ROTATION])
            position, orientation = (
                seen[detection_row.P : detection_row.Q],
                seen[detection_row.Q : detection_row.SIGMA_LATERAL],
            )
            if bf.measurement_from_pose(position, orientation, sigma, rotation, z, r):
                bf.belief_update(belief, entry[0], z, r, bparams)
        newest = history[past_row.TIME]
        if not (k >= due or history[past_row.COUNT] == 0.0 or t - newest >= pd.SAMPLE - 1e-6):
            continue
        if not bf.belief_valid(belief, t, bparams):
            continue
        bf.belief_covariance(belief, t, bparams, x, cov)
        age, streak = t - belief[belief_row.TIME], belief[belief_row.STREAK]
        pd.predictor_push(history, t, x, age)
        if k < due or made >= SNAPSHOTS:
            continue
        due = k + round(uniform(rng, 0.7 * gap, 1.3 * gap))
        known = math.sqrt(max(0.0, 0.5 * (cov[belief_state.X * diagonal] + cov[belief_state.Y * diagonal])))
        speed_known = math.sqrt(max(0.0, cov[belief_state.SPEED * diagonal]))
        pd.predictor_inputs(history, t, x, known, speed_known, age, streak, inputs[made])
        context = contexts[made]
        context[context_row.SPEED] = x[belief_state.SPEED]
        context[context_row.TURN_RATE] = x[belief_state.TURN_RATE]
        context[context_row.ACCELERATION] = x[belief_state.ACCELERATION]
        context[context_row.SIGMA], context[context_row.SPEED_SIGMA], context[context_row.AGE] = known, speed_known, age
        context[context_row.STREAK], context[context_row.HISTORY] = (
            streak,
            history[past_row.COUNT] * pd.SAMPLE,
        )
        _target(truth, k, x, targets[made])
        states[made, : belief_state.PREDICTED_DIM] = x
        states[made, belief_state.PREDICTED_DIM], states[made, belief_state.PREDICTED_DIM + 1] = t, k
        if histories.shape[0] > made:
            histories[made] = history
        made += 1
    return made


@njit
def _drives(rngs, noises, response, damping, top, bparams, cam, inputs, contexts, targets, states, counts):
    for i in range(rngs.shape[0]):
        rng = rngs[i]
        row, aux, truth, none = (
            np.zeros(board_row.DIM),
            np.zeros(motion_row.DIM),
            np.zeros((TICKS, board_row.DIM)),
            np.zeros((0, 1)),
        )
        draw_motion(row, aux, response, damping, top, rng)
        roll(row, aux, round(uniform(rng, 0.0, 300.0)), rng, truth)
        losses = 0.0 if uniform(rng, 0.0, 1.0) < 0.5 else uniform(rng, 0.1, 0.8)
        if uniform(rng, 0.0, 1.0) < 0.4:
            noise, scale = noises[0], uniform(rng, 1.0, 4.0)
        else:
            noise, scale = noises[1], math.exp(uniform(rng, math.log(0.05), 0.0))
        counts[i] = watch(
            truth, noise, scale, losses, bparams, cam, rng, inputs[i], contexts[i], targets[i], states[i], none
        )


@dataclass(frozen=True)
class Examples:
    """`inputs` (N, input_row.DIM), `contexts` (N, context_row.DIM), `targets` (N, TARGETS, target_row.DIM), float32."""

    inputs: np.ndarray
    contexts: np.ndarray
    targets: np.ndarray


def make_examples(drives: int, seed: int, top_speed: float = 3.2) -> Examples:
    """Examples of `drives` drawn motions (about 15 each). Equal seeds give equal examples."""
    if drives < 1 or top_speed <= 0.0:
        raise ValueError(f"need at least one drive and a positive speed, not {drives}, {top_speed}")
    car = load_scout().imitation
    rngs = np.stack([stream(seed, 0xB0A, i) for i in range(drives)])
    inputs = np.zeros((drives, SNAPSHOTS, net_row.INPUTS), dtype=np.float32)
    contexts = np.zeros((drives, SNAPSHOTS, context_row.DIM), dtype=np.float32)
    targets = np.zeros((drives, SNAPSHOTS, target_row.DIM * TARGETS), dtype=np.float32)
    states, counts = np.zeros((drives, SNAPSHOTS, belief_state.PREDICTED_DIM + 2)), np.zeros(drives, dtype=np.int64)
    noises = np.stack([measured_noise(), paper_noise()])
    _drives(
        rngs, noises, car.response, car.damping, top_speed, BeliefParams().row(), Camera().row(), inputs, contexts,
        targets, states, counts,
    )  # fmt: skip
    kept = np.arange(SNAPSHOTS)[None, :] < counts[:, None]
    return Examples(inputs[kept], contexts[kept], targets[kept].reshape(-1, TARGETS, target_row.DIM))
