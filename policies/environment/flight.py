"""One episode of the training environment as a flight meets it: odometry and detections in, commands out.

What flies (policies/flying/onnx_policy.py) can so be run on a training episode: to show that flight
computes what training computed, to time a whole tick, to look for the difference when the two disagree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kernel.rotations import from_euler
from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.environment.rows import S_EXPOSURE, S_PENDING, S_QUEUE, S_STEP, SLOT, X_P, X_Q, X_V
from policies.estimation import belief_row, belief_state
from policies.task.interface import Command, Vec3
from policies.task.observation import action_from_command
from vehicle.quadrotor import state_row

_MEASURED = [0, 1, 2, 3, 6]  # of the filter's state: position, heading, inclination


class Detection(NamedTuple):
    """A board pose in the world as the simulated detector gives it; sigmas m (world axes) and rad."""

    arrival: float  # s, when the filter gets it
    exposure_ns: int
    position: Vec3
    orientation: tuple[float, float, float, float]
    position_sigma: Vec3
    orientation_sigma: float


@dataclass(frozen=True)
class Odometry:
    """The vehicle's own estimate now (policies.estimation.odometry.VehicleView)."""

    stamp_ns: int
    position: Vec3
    velocity: Vec3
    orientation: tuple[float, float, float, float]
    body_rate: Vec3


class EnvFlight:
    """Episodes of one row of a vision environment, flown tick by tick. `env` is open for comparison."""

    def __init__(self, config: EnvConfig) -> None:
        """Starts watching are not supported: their first detections happen within the reset."""
        if config.stage != "vision" or config.warm > 0.0:
            raise ValueError("a flight in the training environment needs the vision stage, and warm = 0")
        self.env = Env(replace(config, count=1))
        self.env.reset()
        self._waiting = [self._first()]
        self.done = False

    @property
    def now_ns(self) -> int:
        """Time since the episode began."""
        return round(self.env.rows.state[0, S_STEP] * TICK * 1e9)

    def odometry(self) -> Odometry:
        """What the vehicle knows of itself now, odometry noise included."""
        own, w = self.env.rows.scratch[0].tolist(), self.env.rows.vehicle[0, state_row.W : state_row.W + 3].tolist()
        p, v, q = own[X_P : X_P + 3], own[X_V : X_V + 3], own[X_Q : X_Q + 4]
        return Odometry(
            self.now_ns, (p[0], p[1], p[2]), (v[0], v[1], v[2]), (q[0], q[1], q[2], q[3]), (w[0], w[1], w[2])
        )

    def detections(self) -> list[Detection]:
        """What has arrived since the last call."""
        now = self.env.rows.state[0, S_STEP] * TICK + 1e-9
        arrived = [seen for seen in self._waiting if seen.arrival <= now]
        self._waiting = [seen for seen in self._waiting if seen.arrival > now]
        return arrived

    def act(self, command: Command) -> None:
        """One control step under `command`; `done` says whether it ended the episode and began another."""
        action = np.zeros(4)
        action_from_command(np.array([*command.body_rate, command.thrust]), action)
        state = self.env.rows.state[0]
        due = state[S_EXPOSURE]
        self.env.step(action[None])
        self.done = bool(self.env.rows.done[0])
        if self.done:
            self._waiting = [self._first()]
            return
        slot = S_QUEUE + (int(state[S_PENDING]) - 1) * SLOT
        if state[S_EXPOSURE] != due and state[S_PENDING] > 0.0 and state[slot + 1] == state[S_STEP] * TICK:
            self._waiting.append(self._detection(state[slot], state[slot + 2 : slot + 7], state[slot + 7 : slot + 12]))

    def _first(self) -> Detection:
        """The detection that an episode begins with: the filter's start."""
        row = self.env.rows.belief[0]
        if row[belief_row.ACCEPTED] != 1.0:
            raise ValueError(
                f"the episode began with {row[belief_row.ACCEPTED]:.0f} detections, not with one: another seed"
            )
        return self._detection(
            0.0,
            row[_MEASURED],
            row[belief_row.COVARIANCE : belief_row.COVARIANCE + belief_state.DIM * belief_state.DIM].reshape(
                belief_state.DIM, belief_state.DIM
            )[_MEASURED, _MEASURED],
        )

    def _detection(self, arrival: float, z: np.ndarray, r: np.ndarray) -> Detection:
        """A pose that the filter takes for the measurement `z`, variances `r`, exposed now."""
        sigmas = np.sqrt(r[:3])
        q = from_euler(0.0, -z[4], z[3])
        return Detection(
            float(arrival), self.now_ns, (z[0], z[1], z[2]), q, (sigmas[0], sigmas[1], sigmas[2]), math.sqrt(r[4])
        )
