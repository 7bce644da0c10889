"""What the learned predictor is judged by: how far it errs, and how often the planner perches on it.

The closed loop is that of planner_trials (vehicle, camera model, delays, belief, contact), cut down to the belief's
mode; with an empty network it flies the analytic prediction, so that both are judged by one kernel.
"""

from __future__ import annotations

import math

import numpy as np

from kernel import njit, prange
from kernel.random import normal, stream, uniform
from policies import belief as bf
from policies import contact as ct
from policies import planner as pl
from policies import planner_params as pp
from policies import predictor as pd
from policies.belief_motion import BeliefParams
from policies.planner_trials import TrialSetup
from policies.prediction import CTRV, CTRV_ACCELERATION, HORIZON, STEP, predict_future, predict_swing
from policies.predictor_data import CONTEXT, DT, SNAPSHOTS, TARGETS, watch
from policies.predictor_planner import MEMORY_DIM, learned_on_belief
from policies.speed_history import FIT_DIM, HISTORY_DIM, SAMPLE, fit_swing, history_push
from vehicle.airframe import FOOTPRINT_RADIUS, MAGNET_Z, load_airframe, randomise_row
from vehicle.camera import Camera, platform_visibility
from vehicle.dynamics import ND, P, Q, V, W, vehicle_row
from vehicle.observation_noise import BIAS_DIM, OBS_DIM, draw_bias, measured_noise, observe_board, paper_noise
from vehicle.rate_control import fly, settle_filters
from vehicle.rotations import from_euler

METHODS = ("ctrv", "ctrv+acceleration", "swing", "learned")
AHEAD = (0.5, 1.0, 1.5, 2.0)
NOISES = {"measured": measured_noise, "paper": paper_noise}

# Indices of a setting row.
_PERIOD, _DELAY, _SCALE, _COMMAND_DELAY, _STEPS = range(5)


@njit
def _trial(row, truth, setting, airframe, cam, noise, bias, rng, bparams, pparams, rules, net, result):
    state, memory, scratch = np.zeros(pl.PLANNER_DIM), np.zeros(MEMORY_DIM), np.zeros(pd.SCRATCH_DIM, np.float32)
    belief, x, cov, future = np.zeros(bf.BELIEF_DIM), np.zeros(8), np.zeros(64), np.zeros((HORIZON, 8))
    estimate, queue, seen = np.zeros(pl.ESTIMATE_DIM), np.zeros((8, 1 + OBS_DIM)), np.zeros(OBS_DIM)
    z, r, sigma = np.zeros(5), np.zeros(5), np.zeros(3)
    out, sent, board_v = np.zeros(4), np.zeros(4), np.zeros(3)
    sent[3] = out[3] = 9.81
    head, tail = 0, 0
    next_frame = uniform(rng, 0.0, setting[_PERIOD])
    pl.planner_reset(state, 0.0, pparams)
    for k in range(int(setting[_STEPS])):
        t, platform = k * DT, truth[k]
        p, v, q = row[P : P + 3], row[V : V + 3], row[Q : Q + 4]
        if t >= next_frame:
            next_frame += setting[_PERIOD]
            if platform_visibility(p, q, platform, cam) == 1 and tail - head < 8:
                board_v[0] = platform[4] * math.cos(platform[3])
                board_v[1] = platform[4] * math.sin(platform[3])
                board = from_euler(0.0, -platform[6], platform[3])
                observe_board(p, q, v, platform, board, board_v, cam, noise, setting[_SCALE], bias, rng, seen)
                queue[tail % 8, 0], queue[tail % 8, 1:] = t, seen
                tail += 1
        while head < tail and queue[head % 8, 0] + setting[_DELAY] <= t:
            entry = queue[head % 8]
            head += 1
            sigma[:] = max(0.002, 0.5 * (entry[8] + entry[9]))
            if bf.measurement_from_pose(entry[1:4], entry[4:8], sigma, max(0.005, 0.577 * entry[10]), bparams, z, r):
                bf.belief_update(belief, entry[0], z, r, bparams)
        learned_on_belief(
            state, memory, t, p, v, q, belief, bparams, x, cov, estimate, future, STEP, pparams, net, scratch, out
        )
        if setting[_COMMAND_DELAY] > 0.0:
            fly(row, sent, airframe, DT, 5)
            sent[:] = out
        else:
            fly(row, out, airframe, DT, 5)
        now = truth[k + 1]
        if ct.evaluate(row[P : P + 3], row[V : V + 3], row[Q : Q + 4], row[W : W + 3], now, t + DT, rules, result) != 0:
            break


@njit(parallel=True)
def _trials(rows, truths, settings, airframes, cam, noise, biases, rngs, bparams, pparams, rules, net, results):
    for i in prange(rows.shape[0]):
        _trial(
            rows[i], truths[i], settings[i], airframes[i], cam, noise, biases[i], rngs[i], bparams, pparams, rules, net,
            results[i],
        )  # fmt: skip


def fly_trials(
    truths: np.ndarray, setup: TrialSetup, pparams: np.ndarray, net: np.ndarray, noise: str = "paper", seed: int = 0
) -> np.ndarray:
    """One trial for each board motion (E, S, 8); returns contact results (E, RESULT_DIM).

    `net`: the predictor's row, or empty: the analytic prediction. Drawn like planner_trials.run_trials.
    """
    count, steps = len(truths), round(setup.time_limit / DT)
    if truths.shape[1] < steps + 1:
        raise ValueError(f"board motions are {truths.shape[1]} steps long; a time limit of {steps} needs {steps + 1}")
    frame = load_airframe("paper_quad")
    nominal, noise_row = frame.params_row(), NOISES[noise]()
    rules = ct.ContactRules(
        robot_l=float(nominal[MAGNET_Z]),
        robot_r=float(nominal[FOOTPRINT_RADIUS]),
        time_limit=setup.time_limit,
        ground_z=0.3,
    ).row()
    rows, airframes = np.zeros((count, ND)), np.zeros((count, nominal.size))
    settings, rngs, biases = np.zeros((count, 5)), np.zeros((count, 1), dtype=np.uint64), np.zeros((count, BIAS_DIM))
    cam = Camera(offset=frame.camera.offset, tilt=math.radians(frame.camera.tilt_deg)).row()
    for i in range(count):
        rngs[i] = rng = stream(seed, i)
        airframes[i] = randomise_row(nominal, rng, 0.3, 0.1, setup.thrust)
        draw_bias(noise_row, setup.noise_scale, rng, biases[i])
        board = truths[i, 0]
        for _ in range(200):
            away, up = uniform(rng, *setup.distance), uniform(rng, *setup.altitude)
            angle = board[3] + math.pi + uniform(rng, -setup.azimuth, setup.azimuth)
            start = board[:3] + np.array([away * math.cos(angle), away * math.sin(angle), up])
            rows[i] = vehicle_row(start, from_euler(0.0, 0.0, angle + math.pi), frame.hover_thrust)
            if platform_visibility(rows[i, P : P + 3], rows[i, Q : Q + 4], board, cam):
                break
        rows[i, V : V + 2] = 0.03 * normal(rng), 0.03 * normal(rng)
        settle_filters(rows[i], airframes[i], DT / 5)
        settings[i] = 1.0 / uniform(rng, *setup.rate), setup.delay, setup.noise_scale, setup.command_delay, steps
    results = np.zeros((count, ct.RESULT_DIM))
    bparams = BeliefParams().row()
    _trials(rows, truths, settings, airframes, cam, noise_row, biases, rngs, bparams, pparams, rules, net, results)
    return results


@njit
def _judge(truths, noise, scale, losses, rngs, bparams, cam, tau, net, errors, kept):
    inputs, contexts = np.zeros((SNAPSHOTS, pd.INPUTS), np.float32), np.zeros((SNAPSHOTS, CONTEXT), np.float32)
    targets, states = np.zeros((SNAPSHOTS, 4 * TARGETS), np.float32), np.zeros((SNAPSHOTS, 10))
    histories, scratch = np.zeros((SNAPSHOTS, pd.HISTORY_DIM)), np.zeros(pd.SCRATCH_DIM, np.float32)
    future, speeds, fit = np.zeros((HORIZON, 8)), np.zeros(HISTORY_DIM), np.zeros(FIT_DIM)
    for i in range(truths.shape[0]):
        made = watch(
            truths[i], noise, scale, losses, bparams, cam, rngs[i], inputs, contexts, targets, states, histories
        )
        for j in range(made):
            x, t, tick, history = states[j, :8], states[j, 8], int(states[j, 9]), histories[j]
            speeds[:] = 0.0
            count, head = int(history[pd.H_COUNT]), int(history[pd.H_HEAD])
            for lag in range(count - 1, -1, -1):  # the same speeds, as the planner remembers them
                at = pd.H_RING + ((head - lag) % pd.LENGTH) * 6
                if history[at + 5] < 0.25:
                    history_push(speeds, t - lag * SAMPLE, history[at + 2])
            for m in range(4):
                if m < 2:
                    predict_future(x, CTRV if m == 0 else CTRV_ACCELERATION, tau, STEP, future)
                else:
                    fit_swing(speeds, tau, fit)
                    predict_swing(x, fit, tau, STEP, future)
                    if m == 3:
                        c = contexts[j]
                        pd.predict_learned(history, t, x, c[3], c[4], c[5], c[6], STEP, net, scratch, 1.0, future)
                for n in range(4):
                    row, true = future[10 * (n + 1)], truths[i, tick + 50 * (n + 1)]
                    errors[i, j, m, n] = math.sqrt((row[0] - true[0]) ** 2 + (row[1] - true[1]) ** 2)
            kept[i, j] = True


def judge(
    truths: np.ndarray, net: np.ndarray, noise: str = "paper", scale: float = 0.1, losses: float = 0.0, seed: int = 0
) -> np.ndarray:
    """Position errors (N, len(METHODS), len(AHEAD)) in m on drives (E, S, 8) watched like training's, but long.

    The analytic methods use the planner's own `predict_tau`.
    """
    rngs = np.stack([stream(seed, 0x70D6E, i) for i in range(len(truths))])
    errors = np.zeros((len(truths), SNAPSHOTS, len(METHODS), len(AHEAD)))
    kept = np.zeros(errors.shape[:2], dtype=np.bool_)
    tau = float(pp.PlannerParams().row()[pp.PREDICT_TAU])
    _judge(truths, NOISES[noise](), scale, losses, rngs, BeliefParams().row(), Camera().row(), tau, net, errors, kept)
    return errors[kept]


def with_error_bars(successes: int, count: int) -> tuple[float, float, float]:
    """Success in %, and the Wilson 95 % interval."""
    share, z = successes / count, 1.96
    middle = (share + z * z / (2 * count)) / (1 + z * z / count)
    half = z / (1 + z * z / count) * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    return 100.0 * share, 100.0 * (middle - half), 100.0 * (middle + half)
