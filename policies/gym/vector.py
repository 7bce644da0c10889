"""Thousands of episodes side by side as a Gymnasium vector environment, at the speed of the compiled one."""

from __future__ import annotations

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from policies.environment import episode_row
from policies.gym import episodes
from policies.gym.picture import CameraView
from policies.gym.settings import environment
from policies.gym.spaces import action_space, observation_space


class PerchVectorEnv(VectorEnv[np.ndarray, np.ndarray, np.ndarray]):
    """`num_envs` episodes; row i with seed s is episode i of EnvConfig(seed=s).

    A row whose episode ends begins the next one in the same step (AutoresetMode.SAME_STEP); how it ended is in
    `infos["final_info"]`. See `PerchEnv` for the ends of an episode, and for what `final_obs` is.
    """

    metadata: dict[str, Any] = {  # noqa: RUF012  Gymnasium's own field
        "render_modes": ["rgb_array"],
        "render_fps": 100,
        "autoreset_mode": AutoresetMode.SAME_STEP,
    }

    def __init__(
        self,
        num_envs: int = 1,
        render_mode: str | None = None,
        stage: str = "state",
        airframe: str = "paper_quad",
        **settings: Any,
    ) -> None:
        """`settings`: fields of EnvConfig. Raises ValueError for a setting that is unknown or out of range."""
        self._env = environment(num_envs, stage, airframe, settings)
        self.num_envs, self.render_mode = num_envs, render_mode
        self.single_observation_space, self.single_action_space = observation_space(), action_space()
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self._seeded, self._view = False, None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin an episode in every row; returns observations, (N, OBS_DIM) float32, and an empty table."""
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**32))
        self._seeded = True
        return episodes.begin(self._env, seed), {}

    def step(self, actions: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step of 10 ms under `actions` ((N, 4), clipped to [-1, 1]).

        Returns observations (N, OBS_DIM) float32, rewards (N,), terminations and truncations (N,) bool, infos. Raises
        ValueError if an action is not finite.
        """
        before = self._env.rows.observation
        after = episodes.step(self._env, actions)
        rows = self._env.rows
        done = rows.done.astype(bool)
        infos = self._final(before, done) if done.any() else {}
        return after, rows.reward.copy(), done, np.zeros(self.num_envs, bool), infos

    def render(self) -> tuple[np.ndarray, ...] | None:
        """RGB pictures of the vehicles' cameras, each (720, 1280, 3) uint8, of the episodes that are under way."""
        if self.render_mode is None:
            return None
        self._view = self._view or CameraView(self._env.camera)
        rows, steps = self._env.rows, self._env.rows.state[:, episode_row.STEP].astype(int)
        return tuple(self._view.picture(rows.vehicle[i], rows.track[i, k], int(k)) for i, k in enumerate(steps))

    def _final(self, before: np.ndarray, done: np.ndarray) -> dict[str, Any]:
        """What Gymnasium keeps of ended episodes: each name with an array for all rows, and a mask `_name`."""
        ends = np.flatnonzero(done)
        observations = np.full(self.num_envs, None, object)
        for i in ends:
            observations[i] = before[i].copy()
        final: dict[str, Any] = {}
        for name, values in episodes.ended(self._env, ends).items():
            final[name] = np.full(self.num_envs, None, object) if values.dtype == object else np.zeros(
                self.num_envs, values.dtype
            )  # fmt: skip
            final[name][ends] = values
            final[f"_{name}"] = done.copy()
        return {"final_obs": observations, "_final_obs": done.copy(), "final_info": final, "_final_info": done.copy()}
