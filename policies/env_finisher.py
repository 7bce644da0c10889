"""A teacher whose last metres are flown by a network that sees the truth.

A planner's label is the beginning of a plan whose time of contact the student cannot see; a student that lags is put
off at every replan, averages the beginnings and hovers over the board. A network's label depends on the state alone.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Protocol

import numpy as np

from kernel import njit, prange
from policies.contract import ContractError, open_policy
from policies.env import Env
from policies.env_config import TICK
from policies.env_rows import S_STEP, X_P, X_Q
from policies.observation import (
    ENTRY_DIM,
    HISTORY,
    NEWEST,
    OBS_DIM,
    TAIL,
    TAIL_RHO,
    relative_entry,
    write_entry,
    yaw_axes,
)


class Labels(Protocol):
    """What DAgger asks of a teacher: actions for every row, and the seconds to its contact where it has one."""

    remaining: np.ndarray

    def act(self) -> np.ndarray: ...

    def state(self) -> dict: ...

    def load(self, state: dict) -> None: ...


@njit(parallel=True)
def true_observations(rows, stride, entries, out):
    """What each row's policy would see in the state stage, into `out` ((N, OBS_DIM) float32).

    The rows' own odometry, thrust gain and previous action, but the true board now and before, and rho 1. `entries`
    ((N, ENTRY_DIM)) is scratch. Call after a step or reset, as `rows.scratch` holds odometry only then.
    """
    for i in prange(rows.done.shape[0]):
        x, step = rows.scratch[i], int(rows.state[i, S_STEP])
        cos, sin = yaw_axes(x[X_Q : X_Q + 4])
        for k in range(HISTORY):
            then = max(0, step - (HISTORY - 1 - k) * stride)
            write_entry(rows.track[i, then], then * TICK, entries[i], 0)
            relative_entry(entries[i], 0, x[X_P : X_P + 3], cos, sin, step * TICK, out[i], k * ENTRY_DIM)
        out[i, TAIL:] = rows.observation[i, TAIL:]
        out[i, TAIL + TAIL_RHO] = 1.0


class Finisher:
    """Labels of `before`, but within `within` m of a board flatter than `flatter` rad those of the policy at `path`."""

    def __init__(self, env: Env, before: Labels, path: str | Path, within: float, flatter: float) -> None:
        """Raises ContractError if the file cannot be read or is not of the state stage."""
        self._session, contract = open_policy(path)
        if contract.stage != "state":
            raise ContractError(
                f"policy {path} is of the {contract.stage} stage; a finisher has to be of the state stage"
            )
        n = env.config.count
        self._env, self._before, self._within = env, before, within
        self._upright = math.cos(flatter)
        self._stride = contract.observation.stride
        self._observation = np.zeros((n, OBS_DIM), dtype=np.float32)
        self._entries = np.zeros((n, ENTRY_DIM))
        self._input = self._session.get_inputs()[0].name
        self.remaining = np.full(n, np.inf)

    def state(self) -> dict:
        """The first teacher's state, for a checkpoint; a network has none."""
        return self._before.state()

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        self._before.load(state)

    def act(self) -> np.ndarray:
        """The actions ((N, 4) in [-1, 1]); `remaining` is infinite where the network teaches."""
        actions = self._before.act().copy()
        true_observations(self._env.rows, self._stride, self._entries, self._observation)
        near = np.linalg.norm(self._observation[:, NEWEST : NEWEST + 3], axis=1) < self._within
        near &= self._observation[:, NEWEST + 5] > self._upright
        if near.any():
            actions[near] = self._session.run(None, {self._input: self._observation[near]})[0]
        self.remaining[:] = np.where(near, np.inf, self._before.remaining)
        return actions
