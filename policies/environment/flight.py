"""A training episode with the interfaces of a flight: it gives odometry and detections and takes commands.

A flying policy (policies/flying/onnx_policy.py) can be run on it to show that flight computes what training computed,
to time a whole tick, and to find the difference when the two disagree.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from kernel.rotations import from_euler
from policies.environment import episode_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.environment.observe import shown_odometry
from policies.estimation import belief_row, belief_state, measured_row
from policies.task.interface import Command, Vec3
from policies.task.observation import action_from_command
from vehicle.quadrotor import state_row

# Entries of the filter's state that a detection measures, in the order of measured_row.
_MEASURED = [belief_state.X, belief_state.Y, belief_state.Z, belief_state.HEADING, belief_state.INCLINATION]


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
    """Episodes of one row of a vision environment, flown tick by tick. `env` is public for comparison."""

    def __init__(self, config: EnvConfig) -> None:
        """Raises ValueError unless `config` has the vision stage and `warm` 0.

        In a warm start the first detections arrive during the reset, before this class can report them.
        """
        if config.stage != "vision" or config.warm > 0.0:
            raise ValueError("a flight in the training environment needs the vision stage, and warm = 0")
        self.env = Env(replace(config, count=1))
        self.env.reset()
        self._waiting = [self._first()]
        self.done = False

    @property
    def now_ns(self) -> int:
        """Time since the episode began, ns."""
        return round(self.env.rows.state[0, episode_row.STEP] * TICK * 1e9)

    def odometry(self) -> Odometry:
        """The vehicle's own estimate now, with odometry noise."""
        p, v, q = (view.tolist() for view in shown_odometry(self.env.rows.scratch[0]))
        w = self.env.rows.vehicle[0, state_row.W : state_row.W + 3].tolist()
        return Odometry(
            self.now_ns, (p[0], p[1], p[2]), (v[0], v[1], v[2]), (q[0], q[1], q[2], q[3]), (w[0], w[1], w[2])
        )

    def detections(self) -> list[Detection]:
        """Detections that have arrived since the last call."""
        now = self.env.rows.state[0, episode_row.STEP] * TICK + 1e-9
        arrived = [seen for seen in self._waiting if seen.arrival <= now]
        self._waiting = [seen for seen in self._waiting if seen.arrival > now]
        return arrived

    def act(self, command: Command) -> None:
        """One control step under `command`; `done` says whether it ended the episode and began another."""
        action = np.zeros(4)
        asked = np.array([*command.body_rate, command.thrust])
        action_from_command(asked, self.env.shared.limits, action)
        state = self.env.rows.state[0]
        due = state[episode_row.EXPOSURE]
        self.env.step(action[None])
        self.done = bool(self.env.rows.done[0])
        if self.done:
            self._waiting = [self._first()]
            return
        slot = episode_row.QUEUE + (int(state[episode_row.PENDING]) - 1) * episode_row.SLOT
        if (
            state[episode_row.EXPOSURE] != due
            and state[episode_row.PENDING] > 0.0
            and state[slot + 1] == state[episode_row.STEP] * TICK
        ):
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
        q = from_euler(0.0, -z[measured_row.INCLINATION], z[measured_row.HEADING])
        position = (z[measured_row.X], z[measured_row.Y], z[measured_row.Z])
        orientation_sigma = math.sqrt(r[measured_row.INCLINATION])
        return Detection(float(arrival), self.now_ns, position, q, (sigmas[0], sigmas[1], sigmas[2]), orientation_sigma)
