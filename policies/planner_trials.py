"""Closed-loop trials of the planner: vehicle, camera model, delays, belief, planner and contact in one kernel per row.

What the planner is tuned and judged in, and what the benchmark and the tests run. The board's motion comes in as data.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kernel import njit, prange
from kernel.random import normal, stream, uniform
from policies import belief as bf
from policies import contact as ct
from policies import planner as pl
from policies.prediction import HORIZON, STEP
from vehicle.airframe import FOOTPRINT_RADIUS, MAGNET_Z, load_airframe, randomise_row
from vehicle.camera import Camera, platform_visibility
from vehicle.dynamics import ND, P, Q, V, W, vehicle_row
from vehicle.observation_noise import BIAS_DIM, OBS_DIM, draw_bias, observe_board, paper_noise
from vehicle.rate_control import fly, settle_filters
from vehicle.rotations import from_euler

DT = 0.01  # s, control period
BELIEF, STATE, FORESIGHT = 0, 1, 2  # what the planner gets: camera and filter; true state, predicted; the true future

# Indices of a setting row, one a trial.
C_PERIOD, C_DELAY, C_NOISE, C_COMMAND_DELAY, C_MODE, C_STEPS = range(6)
SETTING_DIM = 6
# Indices of a log row, one a trial; the first RESULT_DIM are the contact's.
L_TIME, L_PHASE, L_SEEN, L_BLIND, L_ERROR, L_SPEED_ERROR, L_HEADING_ERROR, L_GAIN, L_MISSES, L_PLANS, L_COMMITTED = (
    range(ct.RESULT_DIM, ct.RESULT_DIM + 11)
)
LOG_DIM = ct.RESULT_DIM + 11
TRACE_DIM = 3 + 3 + 4 + 4 + 8 + 8 + 8  # p v q command platform believed [t phase left cost sigma speed sigma age seen]

_QUEUE = 8


@njit
def _quaternion(platform):
    return from_euler(0.0, -platform[6], platform[3])


@njit
def _trial(row, truth, setting, airframe, cam, noise, bias, rng, bparams, pparams, rules, log, trace):
    """Fly one trial to contact, violation or time-out; fills `log`, and `trace` ((steps, TRACE_DIM)) if it has rows."""
    state, belief = np.zeros(pl.PLANNER_DIM), np.zeros(bf.BELIEF_DIM)
    x, cov, estimate, future = np.zeros(8), np.zeros(64), np.zeros(pl.ESTIMATE_DIM), np.zeros((HORIZON, 8))
    queue, seen = np.zeros((_QUEUE, 11)), np.zeros(OBS_DIM)
    z, r, sigma = np.zeros(5), np.zeros(5), np.zeros(3)
    out, sent, board_v = np.zeros(4), np.zeros(4), np.zeros(3)
    sent[3] = out[3] = 9.81
    head, tail, detections, frames, last_seen, committed = 0, 0, 0, 0, 0.0, -1.0
    next_frame = uniform(rng, 0.0, setting[C_PERIOD])
    mode, stride = int(setting[C_MODE]), round(STEP / DT)
    t, phase, platform = 0.0, pl.HOLD, truth[0]
    pl.planner_reset(state, 0.0, pparams)
    result = log[: ct.RESULT_DIM]
    for k in range(int(setting[C_STEPS])):
        t, platform = k * DT, truth[k]
        p, v, q = row[P : P + 3], row[V : V + 3], row[Q : Q + 4]
        if mode == BELIEF and t >= next_frame:
            next_frame += setting[C_PERIOD]
            frames += 1
            if platform_visibility(p, q, platform, cam) == 1 and tail - head < _QUEUE:
                detections += 1
                last_seen = t
                board_v[0] = platform[4] * np.cos(platform[3])
                board_v[1] = platform[4] * np.sin(platform[3])
                bq = _quaternion(platform)
                observe_board(p, q, v, platform, bq, board_v, cam, noise, setting[C_NOISE], bias, rng, seen)
                entry = queue[tail % _QUEUE]
                entry[0], entry[1:] = t, seen
                tail += 1
        while head < tail and queue[head % _QUEUE, 0] + setting[C_DELAY] <= t:
            entry = queue[head % _QUEUE]
            head += 1
            sigma[0] = sigma[1] = sigma[2] = max(0.002, 0.5 * (entry[8] + entry[9]))
            angle = max(0.005, 0.577 * entry[10])
            if bf.measurement_from_pose(entry[1:4], entry[4:8], sigma, angle, bparams, z, r):
                bf.belief_update(belief, entry[0], z, r, bparams)
        if mode == BELIEF:
            phase = pl.planner_on_belief(
                state, t, p, v, q, belief, bparams, x, cov, estimate, future, STEP, pparams, out
            )
        else:
            pl.certain(estimate)
            x[:] = platform
            x[7] = (platform[4] - truth[max(k - 5, 0)][4]) / (DT * max(1, min(5, k)))
            if mode == FORESIGHT:
                if pl.planner_due(state, t):
                    for j in range(HORIZON):
                        future[j] = truth[min(k + j * stride, truth.shape[0] - 1)]
                phase = pl.planner_step(state, t, p, v, q, x, estimate, future, STEP, pparams, out)
            else:
                phase = pl.planner_on_estimate(state, t, p, v, q, x, estimate, future, STEP, pparams, out)
        if phase == pl.COMMIT and committed < 0.0:
            committed = t
        if trace.shape[0] > k:
            w = trace[k]
            w[0:3], w[3:6], w[6:10], w[10:14], w[14:22], w[22:30] = p, v, q, out, platform, x
            w[30], w[31], w[32], w[33] = t, phase, state[pl.S_CONTACT] - t, state[pl.S_COST]
            w[34], w[35], w[36] = estimate[pl.E_SIGMA], estimate[pl.E_SPEED_SIGMA], estimate[pl.E_AGE]
            w[37] = platform_visibility(p, q, platform, cam)
        if setting[C_COMMAND_DELAY] > 0.0:
            fly(row, sent, airframe, DT, 5)
            sent[:] = out
        else:
            fly(row, out, airframe, DT, 5)
        now = truth[k + 1]
        if ct.evaluate(row[P : P + 3], row[V : V + 3], row[Q : Q + 4], row[W : W + 3], now, t + DT, rules, result) != 0:
            break
    log[L_TIME], log[L_PHASE], log[L_SEEN] = t + DT, phase, detections / max(1, frames)
    log[L_BLIND] = t - last_seen
    log[L_ERROR] = np.sqrt((x[0] - platform[0]) ** 2 + (x[1] - platform[1]) ** 2 + (x[2] - platform[2]) ** 2)
    log[L_SPEED_ERROR], log[L_HEADING_ERROR] = x[4] - platform[4], bf.wrap(x[3] - platform[3])
    log[L_GAIN], log[L_MISSES], log[L_PLANS] = state[pl.S_GAIN], state[pl.S_MISSES], state[pl.S_PLANS]
    log[L_COMMITTED] = committed


@njit(parallel=True)
def _trials(rows, truths, settings, airframes, cams, noise, biases, rngs, bparams, pparams, rules, logs, traces):
    for i in prange(rows.shape[0]):
        _trial(
            rows[i], truths[i], settings[i], airframes[i], cams[i], noise, biases[i], rngs[i], bparams, pparams, rules,
            logs[i], traces[i],
        )  # fmt: skip


@dataclass(frozen=True)
class TrialSetup:
    """How trials are drawn. Start: sector behind and above the board (paper Tab. "Initialization parameters")."""

    mode: int = BELIEF
    noise_scale: float = 1.0  # of the paper's noise, biases included
    rate: tuple[float, float] = (30.0, 60.0)  # Hz
    delay: float = 0.035  # s, exposure to update
    command_delay: bool = True  # one control period
    thrust: float = 0.15  # half-width of the thrust-to-weight
    distance: tuple[float, float] = (1.2, 3.5)
    altitude: tuple[float, float] = (1.2, 2.0)
    azimuth: float = np.pi / 3
    time_limit: float = 15.0


def run_trials(
    truths: np.ndarray,
    setup: TrialSetup,
    bparams: np.ndarray,
    pparams: np.ndarray,
    seed: int = 0,
    airframe: str = "paper_quad",
    traced: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Fly one trial for each board motion. Returns logs (E, LOG_DIM) and traces (E, steps or 0, TRACE_DIM).

    `truths` (E, S, 8): platform rows every 10 ms, at least as long as the time limit (and 3.2 s more for foresight).
    The drone starts level, at rest, facing the board within the camera's view.
    """
    count, steps = len(truths), round(setup.time_limit / DT)
    if truths.shape[1] < steps + 1:
        raise ValueError(f"board motions are {truths.shape[1]} steps long; a time limit of {steps} needs {steps + 1}")
    frame = load_airframe(airframe)
    nominal, noise = frame.params_row(), paper_noise()
    rules = ct.ContactRules(
        robot_l=float(nominal[MAGNET_Z]),
        robot_r=float(nominal[FOOTPRINT_RADIUS]),
        time_limit=setup.time_limit,
        ground_z=0.3,
    ).row()
    rows, airframes = np.zeros((count, ND)), np.zeros((count, nominal.size))
    settings, rngs = np.zeros((count, SETTING_DIM)), np.zeros((count, 1), dtype=np.uint64)
    cam = Camera(offset=frame.camera.offset, tilt=np.radians(frame.camera.tilt_deg)).row()
    cams, biases = np.tile(cam, (count, 1)), np.zeros((count, BIAS_DIM))
    for i in range(count):
        rngs[i] = rng = stream(seed, i)
        airframes[i] = randomise_row(nominal, rng, 0.3, 0.1, setup.thrust)
        draw_bias(noise, setup.noise_scale, rng, biases[i])
        board = truths[i, 0]
        for _ in range(200):
            away, up = uniform(rng, *setup.distance), uniform(rng, *setup.altitude)
            angle = board[3] + np.pi + uniform(rng, -setup.azimuth, setup.azimuth)
            start = board[:3] + np.array([away * np.cos(angle), away * np.sin(angle), up])
            rows[i] = vehicle_row(start, from_euler(0.0, 0.0, angle + np.pi), frame.hover_thrust)
            if platform_visibility(rows[i, P : P + 3], rows[i, Q : Q + 4], board, cams[i]):
                break
        rows[i, V : V + 2] = 0.03 * normal(rng), 0.03 * normal(rng)
        settle_filters(rows[i], airframes[i], DT / 5)
        settings[i] = (
            1.0 / uniform(rng, *setup.rate),
            setup.delay,
            setup.noise_scale,
            setup.command_delay,
            setup.mode,
            steps,
        )
    logs = np.zeros((count, LOG_DIM))
    traces = np.zeros((count, steps if traced else 0, TRACE_DIM))
    _trials(rows, truths, settings, airframes, cams, noise, biases, rngs, bparams, pparams, rules, logs, traces)
    return logs, traces
