"""Imitation of a teacher with perfect foresight on the states the student itself visits (Ross, Gordon, Bagnell 2011).

The teacher knows the board's future and the thrust gain; the student sees a history. What the student cannot know it
averages, so labels must depend on the present state alone: nothing is learnt in the last moment before the teacher's
contact and after it, when its commands end with a plan that the student does not see.

An iteration: `horizon` steps in all rows, a share of them flown by the teacher, then `batches` of Adam from the replay.
Random numbers, rows, optimiser and replay are all in the checkpoint, so that a resumed run continues the same curve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
import torch
from torch import Tensor

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.network.actor_critic import FORESEEN, Actor, NetworkConfig
from policies.task import result_row
from policies.task.contact import SUCCESS
from policies.task.observation import NEWEST, OBS_DIM
from policies.teachers.params import ExpertParams
from policies.teachers.planner import BELIEF, PlannerTeacher
from policies.teachers.teacher import Teacher
from policies.training.learners import parallel
from policies.training.learners.storage import TrainingError, env_state, load_env

_AUX = np.array([k * 10 + axis for k in FORESEEN for axis in (0, 1)])  # columns of the future that are foretold


@dataclass(frozen=True)
class DaggerConfig:
    """`samples` environment steps in all; `replay` of them kept. The share of rows flown by the teacher falls from 1 to
    `teacher_floor` over `teacher_fade` samples. `noise`: one-sigma added to the student's actions while collecting.
    `near`: extra weight of a sample close to the board. `ignore`: s before the teacher's contact without labels.
    `foresee`: weight of the auxiliary loss that makes the trunk foretell where the board will be. `average`: decay of
    the averaged weights, which are what flies. `teacher`: how the expert plans. `planner`: BELIEF if the planner
    teaches in its place (see `PlannerTeacher`); empty: the expert teaches. Over boards
    steeper than `keep` deg nobody teaches: the student goes on doing what it did when the run began."""

    samples: int = 8_000_000
    horizon: int = 32
    replay: int = 600_000
    batch: int = 4096
    batches: int = 12
    rate: float = 1e-3
    rate_end: float = 2e-5
    teacher_fade: int = 1_000_000
    teacher_floor: float = 0.1
    noise: float = 0.05
    near: float = 3.0
    ignore: float = 0.045
    foresee: float = 0.1
    huber: float = 0.1
    average: float = 0.995
    planner: str = ""
    keep: float = 90.0
    teacher: ExpertParams = field(default_factory=ExpertParams)

    def __post_init__(self) -> None:
        if self.planner not in ("", BELIEF):
            raise ValueError(f"planner is '{self.planner}'; it is '{BELIEF}' or empty")
        if not 0.0 <= self.keep <= 90.0:
            raise ValueError(f"keep is {self.keep}; give an inclination from 0 to 90 deg")


class Replay:
    """The newest samples in half precision: observation, label, weight, what the trunk is to foretell."""

    def __init__(self, size: int) -> None:
        self.observation = np.zeros((size, OBS_DIM), dtype=np.float16)
        self.label = np.zeros((size, 4), dtype=np.float32)
        self.weight = np.zeros(size, dtype=np.float32)
        self.aux = np.zeros((size, len(_AUX)), dtype=np.float32)
        self.size, self.filled, self.head = size, 0, 0

    def add(self, observation: np.ndarray, label: np.ndarray, weight: np.ndarray, aux: np.ndarray) -> None:
        at = (self.head + np.arange(len(label))) % self.size
        self.observation[at], self.label[at], self.weight[at], self.aux[at] = observation, label, weight, aux
        self.head = (self.head + len(label)) % self.size
        self.filled = min(self.size, self.filled + len(label))

    def draw(self, count: int, rng: np.random.Generator, device: torch.device) -> tuple[Tensor, ...]:
        at = rng.integers(0, self.filled, count)
        parts = (self.observation[at].astype(np.float32), self.label[at], self.weight[at], self.aux[at])
        return tuple(torch.from_numpy(part).to(device) for part in parts)

    def state(self) -> dict:
        part = slice(0, self.filled)
        arrays = {k: getattr(self, k)[part] for k in ("observation", "label", "weight", "aux")}
        return {**arrays, "head": self.head, "filled": self.filled}

    def load(self, state: dict) -> None:
        self.head, self.filled = state["head"], state["filled"]
        for k in ("observation", "label", "weight", "aux"):
            getattr(self, k)[: self.filled] = state[k]


class Dagger:
    """One run. `step()` is one iteration and returns its numbers; `state()`/`load()` make it resumable."""

    def __init__(
        self,
        env: EnvConfig,
        network: NetworkConfig,
        config: DaggerConfig,
        device: str = "cpu",
        actor: Actor | None = None,
    ) -> None:
        self.config, self.device = config, torch.device(device)
        torch.manual_seed(env.seed)
        self.actor = (actor or Actor(network)).to(self.device)
        parallel.share_weights(self.actor)
        self.average, self.before = (Actor(self.actor.config).to(self.device) for _ in range(2))
        for copy in (self.average, self.before):
            copy.load_state_dict(self.actor.state_dict())
        self.optimiser = torch.optim.Adam(self.actor.parameters(), lr=config.rate)
        self.rng = np.random.default_rng([env.seed, 1])
        self.env = Env(env)
        self.env.reset()
        self.teacher = PlannerTeacher(self.env) if config.planner else Teacher(self.env, config.teacher)
        self.replay = Replay(min(config.replay, config.samples))
        self.samples = 0

    @property
    def finished(self) -> bool:
        return self.samples >= self.config.samples

    def step(self) -> dict[str, float]:
        """Collect and learn once."""
        c = self.config
        share = max(c.teacher_floor, 1.0 - self.samples / max(1, c.teacher_fade))
        self._collect(share)
        progress = min(1.0, self.samples / c.samples)
        rate = c.rate_end + 0.5 * (c.rate - c.rate_end) * (1.0 + math.cos(math.pi * progress))
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        loss = float(np.mean([self._learn() for _ in range(c.batches)]))
        rows = self.env.tally.rows
        self.env.tally.__init__()
        success = float((rows[:, result_row.OUTCOME] == SUCCESS).mean()) if len(rows) else math.nan
        return {"samples": self.samples, "loss": loss, "teacher": share, "success": success, "rate": rate}

    def _collect(self, share: float) -> None:
        env, c = self.env, self.config
        n = env.config.count
        by_teacher = self.rng.random(n) < share
        for _ in range(c.horizon):
            observation = env.rows.observation.copy()
            label = self.teacher.act()
            kept = env.rows.track[:, 0, 6] > math.radians(c.keep)  # the true inclination: a belief of it passes 90 deg
            with torch.no_grad():
                seen = torch.from_numpy(observation).to(self.device)
                mean = self.actor(seen).cpu().numpy()
                if kept.any():
                    label = np.where(kept[:, None], self.before(seen).cpu().numpy(), label)
            usable = kept | (self.teacher.remaining > c.ignore)
            near = np.linalg.norm(observation[:, NEWEST : NEWEST + 3], axis=1)
            weight = usable * (1.0 + c.near * np.exp(-near / 0.5))
            self.replay.add(observation, label, weight, env.rows.future[:, _AUX])
            own = mean + c.noise * self.rng.standard_normal((n, 4))
            env.step(np.where(by_teacher[:, None], label, own))
            self.samples += n

    def _learn(self) -> float:
        c = self.config
        observation, label, weight, aux = self.replay.draw(c.batch, self.rng, self.device)
        if self.actor.config.mirrored:
            flipped = torch.from_numpy(self.rng.random(c.batch) < 0.5).to(self.device)[:, None]
            observation = torch.where(flipped, observation * self.actor.observation_signs, observation)
            label = torch.where(flipped, label * self.actor.action_signs, label)
            aux = torch.where(flipped, aux * self.actor.future_signs, aux)
        mean, foretold = self.actor.with_foresight(observation)
        error = torch.nn.functional.smooth_l1_loss(mean, label, beta=c.huber, reduction="none").sum(1)
        loss = (error * weight).mean()
        if c.foresee > 0.0:
            loss = loss + c.foresee * torch.nn.functional.smooth_l1_loss(foretold, aux, beta=0.1)
        if not torch.isfinite(loss):
            raise TrainingError("the imitation loss is not finite; the last good checkpoint is kept")
        self.optimiser.zero_grad()
        loss.backward()
        parallel.average_gradients(self.actor.parameters())
        torch.nn.utils.clip_grad_norm_(self.actor.parameters(), 1.0)
        self.optimiser.step()
        with torch.no_grad():
            for mine, theirs in zip(self.average.parameters(), self.actor.parameters(), strict=True):
                mine.lerp_(theirs, 1.0 - c.average)
        return float(loss.detach())

    def state(self) -> dict:
        """All that a resumed run needs."""
        return {
            "actor": self.actor.state_dict(),
            "average": self.average.state_dict(),
            "before": self.before.state_dict(),
            "optimiser": self.optimiser.state_dict(),
            "rng": self.rng.bit_generator.state,
            "env": env_state(self.env),
            "teacher": self.teacher.state(),
            "replay": self.replay.state(),
            "samples": self.samples,
        }

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        self.actor.load_state_dict(state["actor"])
        self.average.load_state_dict(state["average"])
        self.before.load_state_dict(state["before"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.rng.bit_generator.state = state["rng"]
        load_env(self.env, state["env"])
        self.teacher.load(state["teacher"])
        self.replay.load(state["replay"])
        self.samples = state["samples"]
