"""What the motion predictor learns from: boards as they are really driven, seen through camera, delays and belief."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundcar.motion import board_motion as mo
from groundcar.motion import paths as tr
from groundcar.motion import speed_laws as sl
from groundcar.motion.splines import random_spline
from groundcar.scout.params import load_scout
from kernel.jit import njit
from kernel.random import stream, uniform
from kernel.rotations import from_euler
from policies.estimation import board_ekf as bf
from policies.estimation.ctrv import BeliefParams, N
from policies.prediction import learned as pd
from policies.prediction.future import HORIZON, STEP
from vehicle.camera.noise import BIAS_DIM, OBS_DIM, draw_bias, measured_noise, observe_board, paper_noise
from vehicle.camera.pinhole import Camera

DT = 0.01
SNAPSHOTS = 16  # examples of one drive
SEEN = 620  # ticks a drive is watched
TICKS = SEEN + round((HORIZON - 1) * STEP / DT) + 1
EVERY = 3  # rows of the future between two targets
TARGETS = (HORIZON - 1) // EVERY + 1  # each: x, y, heading, speed, in the believed frame
# An example's context: speed, turn rate, acceleration, sigma, speed sigma, age, streak, seconds of history.
CONTEXT = 8


@njit
def draw_motion(row, aux, response, damping, top, rng):
    """Draw a board's motion into `row` (8,), `aux` (A,): path, speed law, and how the car answers.

    `response` rad/s, `damping`: the real car's, about which six in ten are drawn; `top` m/s.
    """
    aux[:] = 0.0
    path, law = aux[mo.PATH_ROW : mo.PATH_ROW + tr.P], aux[mo.SPEED_ROW : mo.SPEED_ROW + sl.S]
    angle = uniform(rng, -math.pi, math.pi)
    path[tr.HEADING], path[tr.COS], path[tr.SIN] = angle, math.cos(angle), math.sin(angle)
    # Drawn evenly to beyond `top`, as else the fastest would be expected to slow down.
    speed, family = min(uniform(rng, 0.0, 1.15 * top), uniform(rng, 0.0, 1.6 * top)), uniform(rng, 0.0, 1.0)
    aux[mo.CHANGE_TIME], aux[mo.CHANGE_LENGTH] = math.inf, math.inf
    kind = tr.SPLINE
    if family < 0.55:
        random_spline(rng, path, speed)
    elif family < 0.70:
        kind, path[tr.SIZE] = tr.LINE, uniform(rng, 8.0, 14.0)
    elif family < 0.78:
        kind, path[tr.SIZE], path[tr.LENGTH] = tr.RACETRACK, uniform(rng, 3.0, 5.0), uniform(rng, 2.0, 6.0)
    elif family < 0.88:
        kind, path[tr.SIZE], speed = tr.FIGURE8, uniform(rng, 3.5, 5.0), min(speed, 2.5)
    elif family < 0.97:
        kind, path[tr.SIZE] = tr.ARC, uniform(rng, max(1.5, speed / 1.2), 10.0)
        path[tr.TURN] = 1.0 if uniform(rng, 0.0, 1.0) < 0.5 else -1.0
    else:
        kind = tr.STATIC
    way = uniform(rng, 0.0, 1.0)
    law[sl.TAU], law[sl.PERIOD], law[sl.SWITCH], law[sl.V] = uniform(rng, 0.6, 1.5), 1.0, math.inf, speed
    speed_kind = sl.CONSTANT
    if way < 0.35:
        speed_kind = sl.COSINE
        law[sl.V], law[sl.V2] = speed * uniform(rng, 0.2, 0.9), speed
        law[sl.PERIOD], law[sl.PHASE] = uniform(rng, 1.5, 6.0), uniform(rng, -math.pi, math.pi)
    elif way < 0.5:
        speed_kind = sl.SCHEDULED
        law[sl.V2] = min(1.15 * top, speed * uniform(rng, 0.3, 1.4))
        law[sl.RAMP], law[sl.SWITCH] = uniform(rng, 0.2, 1.5), uniform(rng, 1.0, 8.0)
    if way > 0.7 or uniform(rng, 0.0, 1.0) < 0.2:
        law[sl.SIGMA] = uniform(rng, 0.05, 0.13)
    aux[mo.PATH_KIND], aux[mo.SPEED_KIND] = kind, speed_kind
    switch = law[sl.SWITCH]
    if kind == tr.SPLINE and uniform(rng, 0.0, 1.0) < (0.5 if speed_kind == sl.SCHEDULED else 0.15):
        aux[mo.CHANGE_TIME] = uniform(rng, 1.0, 8.0)
        aux[mo.ARC_RADIUS] = uniform(rng, max(2.0, speed / 1.2), 7.0)
        if uniform(rng, 0.0, 1.0) < 0.5:
            aux[mo.ARC_RADIUS] = -aux[mo.ARC_RADIUS]
    aux[mo.DAMPING], aux[mo.ACCEL_LIMIT] = 1.0, math.inf
    car = uniform(rng, 0.0, 1.0)
    if car < 0.6:
        aux[mo.RESPONSE] = response * uniform(rng, 0.78, 1.33)
        aux[mo.DAMPING], aux[mo.ACCEL_LIMIT] = damping * uniform(rng, 0.67, 2.0), uniform(rng, 2.0, 5.0)
    elif car < 0.9:
        aux[mo.RESPONSE] = uniform(rng, 6.0, 16.0)
        aux[mo.DAMPING], aux[mo.ACCEL_LIMIT] = uniform(rng, 0.6, 1.2), uniform(rng, 2.0, 5.0)
    u = uniform(rng, 0.0, 1.0) * tr.path_lap(kind, path)
    moving = uniform(rng, 0.0, 1.0) < 0.85
    inclination = math.radians(uniform(rng, 0.0, 80.0))
    mo.motion_reset(row, aux, u, 1.5, inclination, moving)
    if math.isinf(aux[mo.CHANGE_TIME]):
        law[sl.SWITCH] = switch
    if not moving:
        aux[mo.ACCEL_LIMIT] = min(aux[mo.ACCEL_LIMIT], 2.0)


@njit
def roll(row, aux, lead, rng, out):
    """Drive `lead` ticks unseen, then write every tick's board row to `out` ((T, 8))."""
    for _ in range(lead):
        mo.motion_step(row, aux, DT, rng)
    for k in range(out.shape[0]):
        out[k] = row
        mo.motion_step(row, aux, DT, rng)


@njit
def _target(truth, tick, x, out):
    """The next TARGETS rows of `truth`, in the frame of the believed board `x`."""
    c, s = math.cos(x[3]), math.sin(x[3])
    stride = round(EVERY * STEP / DT)
    for j in range(TARGETS):
        row = truth[tick + j * stride]
        dx, dy = row[0] - x[0], row[1] - x[1]
        out[4 * j], out[4 * j + 1] = c * dx + s * dy, c * dy - s * dx
        out[4 * j + 2], out[4 * j + 3] = bf.wrap(row[3] - x[3]), row[4]


@njit
def watch(truth, noise, scale, losses, bparams, cam, rng, inputs, contexts, targets, states, histories):
    """Watch one drive (`truth` (T, 8), every DT) as a follower's camera would; returns the number of examples.

    Fills `inputs` (SNAPSHOTS, INPUTS) float32, `contexts` (SNAPSHOTS, CONTEXT), `targets` (SNAPSHOTS, 4 TARGETS),
    `states` (SNAPSHOTS, 10: the believed row, then time and tick) and, if it has rows, `histories`. `losses`: chance of
    losing sight in a second.
    """
    belief, history = np.zeros(bf.BELIEF_DIM), np.zeros(pd.HISTORY_DIM)
    x, cov = np.zeros(8), np.zeros(N * N)
    seen, bias, z, r, sigma = np.zeros(OBS_DIM), np.zeros(BIAS_DIM), np.zeros(5), np.zeros(5), np.zeros(3)
    queue = np.zeros((8, 1 + OBS_DIM))
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
        t, board_row = k * DT, truth[k]
        if t > blind_until and uniform(rng, 0.0, 1.0) < losses * DT:
            blind_until = t + uniform(rng, 0.05, 1.0)
        if t >= next_frame:
            next_frame += period
            if t > blind_until and tail - head < 8:
                away = near + (far - near) * math.exp(-t / closing)
                angle = board_row[3] + math.pi + side
                p[0], p[1] = board_row[0] + away * math.cos(angle), board_row[1] + away * math.sin(angle)
                p[2] = board_row[2] + up * away
                board_v[0], board_v[1] = board_row[4] * math.cos(board_row[3]), board_row[4] * math.sin(board_row[3])
                v[:] = board_v
                v[2] = -0.3
                pose = from_euler(0.0, math.atan(up) - 0.26, angle + math.pi)
                board = from_euler(0.0, -board_row[6], board_row[3])
                observe_board(p, pose, v, board_row, board, board_v, cam, noise, scale, bias, rng, seen)
                queue[tail % 8, 0] = t
                queue[tail % 8, 1:] = seen
                tail += 1
        while head < tail and queue[head % 8, 0] + delay <= t:
            entry = queue[head % 8]
            head += 1
            sigma[:] = max(0.002, 0.5 * (entry[8] + entry[9]))
            if bf.measurement_from_pose(entry[1:4], entry[4:8], sigma, max(0.005, 0.577 * entry[10]), z, r):
                bf.belief_update(belief, entry[0], z, r, bparams)
        newest = history[pd.H_TIME]
        if not (k >= due or history[pd.H_COUNT] == 0.0 or t - newest >= pd.SAMPLE - 1e-6):
            continue
        if not bf.belief_valid(belief, t, bparams):
            continue
        bf.belief_covariance(belief, t, bparams, x, cov)
        age, streak = t - belief[bf.B_T], belief[bf.B_STREAK]
        pd.predictor_push(history, t, x, age)
        if k < due or made >= SNAPSHOTS:
            continue
        due = k + round(uniform(rng, 0.7 * gap, 1.3 * gap))
        known = math.sqrt(max(0.0, 0.5 * (cov[0] + cov[N + 1])))
        speed_known = math.sqrt(max(0.0, cov[4 * (N + 1)]))
        pd.predictor_inputs(history, t, x, known, speed_known, age, streak, inputs[made])
        context = contexts[made]
        context[0], context[1], context[2] = x[4], x[5], x[7]
        context[3], context[4], context[5] = known, speed_known, age
        context[6], context[7] = streak, history[pd.H_COUNT] * pd.SAMPLE
        _target(truth, k, x, targets[made])
        states[made, :8], states[made, 8], states[made, 9] = x, t, k
        if histories.shape[0] > made:
            histories[made] = history
        made += 1
    return made


@njit
def _drives(rngs, noises, response, damping, top, bparams, cam, inputs, contexts, targets, states, counts):
    for i in range(rngs.shape[0]):
        rng = rngs[i]
        row, aux, truth, none = np.zeros(8), np.zeros(mo.A), np.zeros((TICKS, 8)), np.zeros((0, 1))
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
    """`inputs` (N, INPUTS), `contexts` (N, CONTEXT), `targets` (N, TARGETS, 4), all float32."""

    inputs: np.ndarray
    contexts: np.ndarray
    targets: np.ndarray


def make_examples(drives: int, seed: int, top_speed: float = 3.2) -> Examples:
    """Examples of `drives` drawn motions (about 15 each). Equal seeds give equal examples."""
    if drives < 1 or top_speed <= 0.0:
        raise ValueError(f"need at least one drive and a positive speed, not {drives}, {top_speed}")
    car = load_scout().imitation
    rngs = np.stack([stream(seed, 0xB0A, i) for i in range(drives)])
    inputs = np.zeros((drives, SNAPSHOTS, pd.INPUTS), dtype=np.float32)
    contexts = np.zeros((drives, SNAPSHOTS, CONTEXT), dtype=np.float32)
    targets = np.zeros((drives, SNAPSHOTS, 4 * TARGETS), dtype=np.float32)
    states, counts = np.zeros((drives, SNAPSHOTS, 10)), np.zeros(drives, dtype=np.int64)
    noises = np.stack([measured_noise(), paper_noise()])
    _drives(
        rngs, noises, car.response, car.damping, top_speed, BeliefParams().row(), Camera().row(), inputs, contexts,
        targets, states, counts,
    )  # fmt: skip
    kept = np.arange(SNAPSHOTS)[None, :] < counts[:, None]
    return Examples(inputs[kept], contexts[kept], targets[kept].reshape(-1, TARGETS, 4))
