"""The environment's memory: one row per episode in each array, named arrays for Numba."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kernel.random import stream
from policies.environment import ended_row, episode_row, scratch_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.motion import MOTION_DIM
from policies.estimation import belief_row, thrust_row
from policies.task import entry_row, result_row, terms_row
from policies.task.observation import OBS_DIM, history_dim
from vehicle.camera import camera_row
from vehicle.quadrotor import airframe_row, order_row, state_row

FUTURE = 15  # N of the paper: future board states for the critic
FUTURE_DIM = FUTURE * entry_row.DIM


class Rows(NamedTuple):
    """Row i of every array is episode i. A snapshot of all of them is a snapshot of the environment."""

    vehicle: np.ndarray  # (N, state_row.DIM)
    params: np.ndarray  # (N, airframe_row.DIM)
    order: np.ndarray  # (N, order_row.DIM) commands of this step
    motion: np.ndarray  # (N, MOTION_DIM) state of the board's motion at the end of the track
    track: np.ndarray  # (N, T, 8) true board rows, step by step since the reset, known to episode_row.FILLED
    belief: np.ndarray  # (N, belief_row.DIM)
    ahead: np.ndarray  # (N, FUTURE * future_stride * entry_row.DIM) the true board's next steps (entry_place)
    history: np.ndarray  # (N, history_dim)
    camera: np.ndarray  # (N, camera_row.DIM)
    gain: np.ndarray  # (N, thrust_row.DIM)
    state: np.ndarray  # (N, episode_row.DIM)
    rng: np.ndarray  # (N, 1) uint64
    believed: np.ndarray  # (N, 8) board row that the policy receives
    scratch: np.ndarray  # (N, scratch_row.DIM)
    result: np.ndarray  # (N, result_row.DIM)
    ended: np.ndarray  # (N, ended_row.DIM) of the last episode that ended in this row
    terms: np.ndarray  # (N, terms_row.DIM)
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
    guidance: np.ndarray  # row of GuidanceParams
    limits: np.ndarray  # limits row of the airframe: what actions are scaled by


def track_length(config: EnvConfig) -> int:
    """Largest number of track steps of an episode: hovering start, the episode, and the future beyond its end."""
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
        ahead=zeros(FUTURE * config.future_stride * entry_row.DIM),
        history=zeros(history_dim(config.stride)),
        camera=zeros(camera_row.DIM),
        gain=zeros(thrust_row.DIM),
        state=zeros(episode_row.DIM),
        rng=rng,
        believed=zeros(8),
        scratch=zeros(scratch_row.DIM),
        result=zeros(result_row.DIM),
        ended=zeros(ended_row.DIM),
        terms=zeros(terms_row.DIM),
        observation=zeros(OBS_DIM, dtype=np.float32),
        future=zeros(FUTURE_DIM, dtype=np.float32),
        reward=zeros(),
        done=zeros(dtype=np.uint8),
    )
