"""One episode at a time as a Gymnasium environment."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np

from policies.environment import episode_row
from policies.gym import episodes
from policies.gym.picture import CameraView
from policies.gym.settings import environment
from policies.gym.spaces import action_space, observation_space


class PerchEnv(gymnasium.Env[np.ndarray, np.ndarray]):
    """Perch on a moving, inclined board: the training environment with one episode.

    An episode ends by contact, by a failure or by its time limit, all of them `terminated`: the time limit is a failure
    of the task (paper Algorithm 1). `truncated` is always False. `info` is empty until the end, then it is what
    `episodes.ended` says. The last observation of an episode is the one before its last action, because the compiled
    environment observes nothing at a contact; the value after a terminated episode is 0 and needs no observation.
    """

    metadata: dict[str, Any] = {"render_modes": ["rgb_array"], "render_fps": 100}  # noqa: RUF012  Gymnasium's own field

    def __init__(
        self, render_mode: str | None = None, stage: str = "state", airframe: str = "paper_quad", **settings: Any
    ) -> None:
        """`stage`: "state" (truth) or "vision" (belief from a camera); `settings`: fields of EnvConfig.

        Raises ValueError for a setting that is unknown or out of range.
        """
        self._env = environment(1, stage, airframe, settings)
        self.render_mode = render_mode
        self.observation_space, self.action_space = observation_space(), action_space()
        self._seeded, self._view = False, None
        self._pose = self._moment()

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[np.ndarray, dict]:
        """Begin an episode. `seed`: the one that EnvConfig(seed=...) has; without it the stream goes on."""
        super().reset(seed=seed)
        if seed is None and not self._seeded:
            seed = int(self.np_random.integers(2**32))
        self._seeded = True
        observation = episodes.begin(self._env, seed)[0]
        self._pose = self._moment()
        return observation, {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """One control step of 10 ms under `action` ((4,), clipped to [-1, 1]).

        Raises ValueError if it is not finite.
        """
        before = self._env.rows.observation[0]
        after = episodes.step(self._env, np.asarray(action)[None])[0]
        rows = self._env.rows
        if not rows.done[0]:
            self._pose = self._moment()
            return after, float(rows.reward[0]), False, False, {}
        info = {name: values[0] for name, values in episodes.ended(self._env, np.array([0])).items()}
        return before.copy(), float(rows.reward[0]), True, False, info

    def render(self) -> np.ndarray | None:
        """RGB picture of the vehicle's camera, (720, 1280, 3) uint8; after the end: the last one before it."""
        if self.render_mode is None:
            return None
        self._view = self._view or CameraView(self._env.camera)
        return self._view.picture(*self._pose)

    def _moment(self) -> tuple[np.ndarray, np.ndarray, int]:
        """State row of the vehicle, board row and control step now: what a picture is made of."""
        rows = self._env.rows
        step = int(rows.state[0, episode_row.STEP])
        return rows.vehicle[0].copy(), rows.track[0, step].copy(), step
