"""The environment's memory: one row per episode in each array, and what the columns of its own rows mean."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kernel.random import stream
from policies.environment.config import TICK, EnvConfig
from policies.environment.motion import MOTION_DIM
from policies.estimation import belief_row, thrust_row
from policies.task import entry_row, result_row, terms_row
from policies.task.observation import OBS_DIM, history_dim
from vehicle.camera import camera_row
from vehicle.quadrotor import airframe_row, order_row, state_row

FUTURE = 15  # N of the paper: future board states for the critic
FUTURE_DIM = FUTURE * entry_row.DIM

# Columns of a state row. Times are seconds since the reset; a step is 10 ms.
S_STEP, S_BEGIN, S_FILLED = 0, 1, 2  # present step; step at which the policy took over; last step of the track known
S_ACTION = 3  # 4, previous action in [-1, 1]
S_COMMAND, S_BEFORE = 7, 11  # 4 each, CTBR asked one and two steps ago
S_DELAY = 15  # substeps of physics between asking and the rate loop
S_EXPOSURE, S_PERIOD, S_LATENCY = 16, 17, 18  # next exposure, detector period, exposure to update, s
S_NOISE, S_ODOMETRY = 19, 20  # scale of visual noise and of odometry noise
S_BIAS = 21  # 7, bias row of the visual noise
S_SEEN, S_RHO, S_RETURN = 28, 29, 30  # sums over the episode: steps with the board in view, rho, reward
S_SPEED, S_FAMILY, S_LAW = 31, 32, 33  # what was drawn
S_RAW = 34  # 12: newest measurement (5) and its time, the one before (for the ablation without input augmentation)
S_VISIBLE = 46  # 1 if the board is in view now
S_ERROR = 47  # m, of the believed position now
S_PENDING = 48  # detections under way
S_QUEUE = 49  # QUEUE slots of [arrival, exposure, z (5), r (5)]
QUEUE, SLOT = 8, 12
S_DIM = S_QUEUE + QUEUE * SLOT

# Columns of an ended row: the contact result of the episode that ended, then these.
E_STEPS, E_SEEN, E_RHO, E_RETURN, E_SPEED, E_INCLINATION, E_FAMILY, E_LAW, E_ERROR = range(
    result_row.DIM, result_row.DIM + 9
)
ENDED_DIM = result_row.DIM + 9

# Slices of a scratch row.
X_OBSERVED, X_Z, X_R, X_COMMAND, X_BOARD, X_Q, X_P, X_V, X_SIGMA = 0, 10, 15, 20, 24, 32, 36, 39, 42
SCRATCH_DIM = 48


class Rows(NamedTuple):
    """Row i of every array is episode i. A snapshot of all of them is a snapshot of the environment."""

    vehicle: np.ndarray  # (N, ND)
    params: np.ndarray  # (N, NP)
    order: np.ndarray  # (N, ORDER_DIM) what the vehicle is asked in this step
    motion: np.ndarray  # (N, MOTION_DIM) where the board's motion stands, at the end of the track
    track: np.ndarray  # (N, T, 8) true board rows, step by step since the reset, known to S_FILLED
    belief: np.ndarray  # (N, BELIEF_DIM)
    history: np.ndarray  # (N, history_dim)
    camera: np.ndarray  # (N, CAM_DIM)
    gain: np.ndarray  # (N, GAIN_DIM)
    state: np.ndarray  # (N, S_DIM)
    rng: np.ndarray  # (N, 1) uint64
    believed: np.ndarray  # (N, 8) board row that the policy is shown
    scratch: np.ndarray  # (N, SCRATCH_DIM)
    result: np.ndarray  # (N, RESULT_DIM)
    ended: np.ndarray  # (N, ENDED_DIM) of the last episode that ended in this row
    terms: np.ndarray  # (N, TERMS_DIM)
    observation: np.ndarray  # (N, OBS_DIM) float32
    future: np.ndarray  # (N, FUTURE_DIM) float32
    reward: np.ndarray  # (N,)
    done: np.ndarray  # (N,) uint8


class Shared(NamedTuple):
    """Rows that all episodes share."""

    config: np.ndarray
    rules: np.ndarray
    weights: np.ndarray
    belief: np.ndarray
    noise: np.ndarray
    nominal: np.ndarray  # params row of the airframe
    camera: np.ndarray


def track_length(config: EnvConfig) -> int:
    """Steps of track an episode can need: hovering start, the episode, and the future beyond its end."""
    hover = math.ceil(config.warm_time[1] / TICK) if config.warm > 0.0 else 0
    return hover + config.limit + max(config.horizon, FUTURE * config.future_stride) + 2


def allocate(config: EnvConfig) -> Rows:
    """All arrays for `config.count` episodes, with a random stream a row keyed by (seed, row)."""
    n = config.count
    rng = np.stack([stream(config.seed, i) for i in range(n)])

    def zeros(*shape: int, dtype: type = np.float64) -> np.ndarray:
        return np.zeros((n, *shape), dtype=dtype)

    return Rows(
        vehicle=zeros(state_row.DIM),
        params=zeros(airframe_row.DIM),
        order=zeros(order_row.DIM),
        motion=zeros(MOTION_DIM),
        track=zeros(track_length(config), 8),
        belief=zeros(belief_row.DIM),
        history=zeros(history_dim(config.stride)),
        camera=zeros(camera_row.DIM),
        gain=zeros(thrust_row.DIM),
        state=zeros(S_DIM),
        rng=rng,
        believed=zeros(8),
        scratch=zeros(SCRATCH_DIM),
        result=zeros(result_row.DIM),
        ended=zeros(ENDED_DIM),
        terms=zeros(terms_row.DIM),
        observation=zeros(OBS_DIM, dtype=np.float32),
        future=zeros(FUTURE_DIM, dtype=np.float32),
        reward=zeros(),
        done=zeros(dtype=np.uint8),
    )
