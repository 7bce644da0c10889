"""The vectorised perching environment: thousands of episodes, each one row of arrays, stepped by one compiled call.

env = Env(EnvConfig(stage="state", count=1024, seed=1))
env.reset()
env.step(actions)          # (N, 4) in [-1, 1]; then read env.rows.observation, .reward, .done, .future
env.tally                  # how episodes ended since the last reset or clear
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kernel.jit import njit
from policies.environment import ended_row, episode_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.motion import extend_track
from policies.environment.reset import reset_rows
from policies.environment.rows import Rows, Shared, allocate
from policies.environment.step import step_rows
from policies.estimation.ctrv import BeliefParams
from policies.guidance.params import GuidanceParams
from policies.task import result_row
from policies.task.contact import REASONS, SUCCESS
from vehicle.camera.noise import paper_noise
from vehicle.camera.pinhole import Camera
from vehicle.quadrotor.airframe import load_airframe


@njit
def fill_future(rows, i, first, step_ticks, out):
    """True board rows of episode i, `step_ticks` control steps apart, into `out` ((K, 8)); row 0 in `first` steps."""
    begin, last = int(rows.state[i, episode_row.STEP]) + first, rows.track.shape[1] - 1
    wanted = min(begin + (out.shape[0] - 1) * step_ticks, last)
    rows.state[i, episode_row.FILLED] = extend_track(
        rows.motion[i], rows.track[i], int(rows.state[i, episode_row.FILLED]), wanted, rows.rng[i]
    )
    for k in range(out.shape[0]):
        out[k] = rows.track[i, min(begin + k * step_ticks, last)]


def advance(rows: Rows, shared: Shared, actions: np.ndarray) -> None:
    """One control step of every row under `actions` ((N, 4), clipped to [-1, 1]).

    Raises ValueError if an action is not finite: a network that has diverged must stop here.
    """
    if not np.isfinite(actions).all():
        raise ValueError("an action is not finite; the policy has diverged")
    step_rows(rows, shared, np.ascontiguousarray(actions, dtype=np.float64))


class Env:
    """N episodes side by side. `rows` is public: kernels may read truth, belief and future from it."""

    def __init__(self, config: EnvConfig, belief: BeliefParams | None = None) -> None:
        airframe = load_airframe(config.airframe)
        rules = replace(config.rules, time_limit=(config.limit - 0.5) * TICK)
        mount = Camera(offset=airframe.camera.offset, tilt=math.radians(airframe.camera.tilt_deg))
        self.config, self.airframe, self.camera = config, airframe, mount
        self.rows: Rows = allocate(config)
        self.shared = Shared(
            config=config.row(),
            rules=rules.row(airframe.contact),
            weights=config.weights.row(),
            belief=(belief or BeliefParams()).row(),
            noise=paper_noise(),
            nominal=airframe.params_row(),
            camera=mount.row(),
            guidance=GuidanceParams.of(airframe, config.stage == "state", **config.guidance_changes).row(),
            limits=airframe.limits_row(),
        )
        self.tally = Tally()
        self.steps = 0

    def reset(self) -> np.ndarray:
        """Begin a new episode in every row and empty the tally; returns the observations ((N, OBS_DIM) float32)."""
        self.restart(np.ones(self.config.count, dtype=np.bool_))
        self.tally = Tally()
        return self.rows.observation

    def restart(self, chosen: np.ndarray) -> None:
        """Begin a new episode in the rows that `chosen` ((N,) bool) holds; the tally does not get what they leave."""
        reset_rows(self.rows, self.shared, chosen)

    def step(self, actions: np.ndarray) -> np.ndarray:
        """Advance every row under `actions` ((N, 4), clipped to [-1, 1]); returns the observations.

        Raises ValueError if an action is not finite.
        """
        advance(self.rows, self.shared, actions)
        self.steps += len(actions)
        if self.rows.done.any():
            self.tally.add(self.rows.ended[self.rows.done.astype(bool)])
        return self.rows.observation


class Tally:
    """Episodes that ended, as rows ((K, ended_row.DIM), see `ended_row`)."""

    def __init__(self) -> None:
        self._parts: list[np.ndarray] = []

    def add(self, ended: np.ndarray) -> None:
        """Add ended episodes, (K, ended_row.DIM); they are copied."""
        self._parts.append(ended.copy())

    @property
    def rows(self) -> np.ndarray:
        """All rows added so far, (K, ended_row.DIM)."""
        return np.concatenate(self._parts) if self._parts else np.zeros((0, ended_row.DIM))

    def causes(self) -> dict[str, int]:
        """Episodes by cause: 'success' or the reason of the failure."""
        counts: dict[str, int] = {}
        for outcome, reason in self.rows[:, [result_row.OUTCOME, result_row.REASON]].astype(int):
            name = "success" if outcome == SUCCESS else REASONS[reason]
            counts[name] = counts.get(name, 0) + 1
        return counts

    def success(self) -> float:
        """Share of successes, NaN if nothing has ended."""
        rows = self.rows
        return float((rows[:, result_row.OUTCOME] == SUCCESS).mean()) if len(rows) else math.nan
