"""Proximal policy optimisation (Schulman et al. 2017) with the paper's asymmetric critic, to be read top to bottom.

An iteration: `horizon` steps in all rows with actions drawn from the policy; advantages by GAE; `epochs` passes over
the samples in minibatches with the clipped objective. What differs from the textbook, each switched off by its default:

- `clone`: a pull towards the actor that training began with, fading over `clone_fade` samples; a precise clone of a
  teacher is destroyed by the first noisy gradients otherwise.
- `reverse`: the reverse curriculum. The teacher with foresight flies every episode until `lead` seconds before its
  contact, then the policy takes over; whenever enough of its perches succeed, it takes over earlier.
- `std_floor`: the printed reward pays a policy for shrinking its noise until it explores nothing.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass, field

import numpy as np
import torch

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.environment.rows import FUTURE_DIM
from policies.network.actor_critic import Actor, Critic, NetworkConfig
from policies.task import result_row
from policies.task.contact import SUCCESS
from policies.task.observation import OBS_DIM
from policies.teachers.params import ExpertParams
from policies.teachers.teacher import Teacher
from policies.training.learners import parallel
from policies.training.learners.storage import TrainingError, env_state, load_env


@dataclass(frozen=True)
class PpoConfig:
    """`samples` environment steps in all. Rewards are multiplied by `reward_scale` before learning. SI units."""

    samples: int = 40_000_000
    horizon: int = 32
    epochs: int = 3
    minibatch: int = 8192
    rate: float = 3e-4
    rate_end: float = 3e-5
    critic_rate: float = 5e-4
    gamma: float = 0.97
    gae: float = 0.95
    clip: float = 0.2
    target_kl: float = 0.03
    entropy: float = 0.0
    std: float = 0.3
    std_floor: float = 0.1
    max_grad: float = 0.5
    reward_scale: float = 0.01
    critic_only: int = 0
    clone: float = 0.0
    clone_fade: int = 10_000_000
    reverse: bool = False
    lead: float = 0.1
    lead_grow: float = 1.15
    lead_success: float = 0.8
    teacher: ExpertParams = field(default_factory=ExpertParams)
    average: float = 0.98


class Rollout:
    """Samples of one iteration, (horizon, N, ...)."""

    def __init__(self, horizon: int, count: int) -> None:
        self.observation = np.zeros((horizon, count, OBS_DIM), dtype=np.float32)
        self.future = np.zeros((horizon, count, FUTURE_DIM), dtype=np.float32)
        self.action = np.zeros((horizon, count, 4), dtype=np.float32)
        self.log_prob, self.value, self.reward, self.done = np.zeros((4, horizon, count), dtype=np.float32)
        self.own = np.zeros((horizon, count), dtype=bool)  # False where the teacher flew

    def advantages(self, last_value: np.ndarray, gamma: float, gae: float) -> tuple[np.ndarray, np.ndarray]:
        """Generalised advantage estimates and returns, (horizon, N) each; an episode's end is a true end."""
        advantage = np.zeros_like(self.reward)
        ahead, next_value = np.zeros_like(last_value), last_value
        for t in reversed(range(len(self.reward))):
            alive = 1.0 - self.done[t]
            delta = self.reward[t] + gamma * next_value * alive - self.value[t]
            ahead = delta + gamma * gae * alive * ahead
            advantage[t], next_value = ahead, self.value[t]
        return advantage, advantage + self.value


class Ppo:
    """One run. `step()` is one iteration and returns its numbers; `state()`/`load()` make it resumable."""

    def __init__(
        self,
        env: EnvConfig,
        network: NetworkConfig,
        config: PpoConfig,
        device: str = "cpu",
        actor: Actor | None = None,
    ) -> None:
        self.config, self.device = config, torch.device(device)
        torch.manual_seed(env.seed)
        self.actor = (actor or Actor(network)).to(self.device)
        self.critic = Critic(self.actor.config).to(self.device)
        with torch.no_grad():
            self.actor.log_std.fill_(math.log(config.std))
        parallel.share_weights(self.actor)
        parallel.share_weights(self.critic)
        self.start, self.average = deepcopy(self.actor), deepcopy(self.actor)
        self.optimiser = torch.optim.Adam(
            [
                {"params": self.actor.parameters(), "lr": config.rate},
                {"params": self.critic.parameters(), "lr": config.critic_rate},
            ],
            eps=1e-5,
        )
        self.rng = np.random.default_rng([env.seed, 2])
        self.env = Env(env)
        self.env.reset()
        self.teacher = Teacher(self.env, config.teacher) if config.reverse else None
        self.own = np.full(env.count, not config.reverse)
        self.lead, self.recent = config.lead, 0.0
        self.rollout = Rollout(config.horizon, env.count)
        self.samples = 0

    @property
    def finished(self) -> bool:
        return self.samples >= self.config.samples

    def step(self) -> dict[str, float]:
        """Collect, learn, move the curriculum."""
        last_value = self._collect()
        progress = min(1.0, self.samples / self.config.samples)
        rate = self.config.rate + (self.config.rate_end - self.config.rate) * progress
        self.optimiser.param_groups[0]["lr"] = 0.0 if self.samples < self.config.critic_only else rate
        numbers = self._learn(last_value)
        rows = self.env.tally.rows
        self.env.tally.__init__()
        good = rows[:, result_row.OUTCOME] == SUCCESS
        success = parallel.mean(float(good.mean()) if len(rows) else math.nan)
        if len(rows):
            share = min(1.0, len(rows) / 1000.0)
            self.recent += share * (success - self.recent)
            if self.recent > self.config.lead_success:
                self.lead, self.recent = self.lead * self.config.lead_grow, 0.5 * self.recent
        return {
            "samples": self.samples,
            "success": success,
            "reward": parallel.mean(float(self.rollout.reward.mean()) / self.config.reward_scale),
            "normal_speed": float(-rows[good, result_row.NORMAL_SPEED].mean()) if good.any() else math.nan,
            "std": float(self.actor.log_std.exp().mean().detach()),
            "lead": self.lead,
            **numbers,
        }

    def _collect(self) -> np.ndarray:
        """Fill the rollout; returns the value of the states it ends in, (N,)."""
        env, r, c = self.env, self.rollout, self.config
        std = self.actor.log_std.exp().detach().cpu().numpy()
        for t in range(c.horizon):
            r.observation[t], r.future[t] = env.rows.observation, env.rows.future
            observation = torch.from_numpy(r.observation[t]).to(self.device)
            with torch.no_grad():
                mean = self.actor(observation)
                value = self.critic(observation, torch.from_numpy(r.future[t]).to(self.device))
                noise = self.rng.standard_normal((env.config.count, 4)).astype(np.float32)
                action = mean.cpu().numpy() + std * noise
                log_prob = self.actor.log_prob(mean, torch.from_numpy(action).to(self.device))
            r.action[t], r.value[t], r.log_prob[t] = action, value.cpu().numpy(), log_prob.cpu().numpy()
            flown = action
            if self.teacher is not None:
                taught = self.teacher.act()
                self.own |= self.teacher.remaining < self.lead
                flown = np.where(self.own[:, None], action, taught)
            r.own[t] = self.own
            env.step(flown)
            r.reward[t], r.done[t] = env.rows.reward * c.reward_scale, env.rows.done
            if self.teacher is not None:
                self.own &= env.rows.done == 0
            self.samples += env.config.count
        if not np.isfinite(r.reward).all():
            names = [k for k in env.rows._fields if not np.isfinite(getattr(env.rows, k)).all()]
            raise TrainingError(f"the reward is not finite (rows with bad numbers: {', '.join(names)})")
        with torch.no_grad():
            observation = torch.from_numpy(env.rows.observation).to(self.device)
            return self.critic(observation, torch.from_numpy(env.rows.future).to(self.device)).cpu().numpy()

    def _learn(self, last_value: np.ndarray) -> dict[str, float]:
        """Epochs of minibatches; stops an iteration early when the policy has moved by more than `target_kl`."""
        r, c = self.rollout, self.config
        advantage, returns = r.advantages(last_value, c.gamma, c.gae)
        own = r.own.ravel()
        if own.sum() < 2:  # every step was the teacher's: nothing of its own to learn from
            return {"kl": 0.0, "clipped": 0.0, "explained": math.nan}
        tensors = []
        for array in (r.observation, r.future, r.action, r.log_prob, r.value, advantage, returns):
            tensors.append(torch.from_numpy(array.reshape(len(own), -1)[own]).to(self.device))
        observation, future, action, log_prob, _, advantage_, returns_ = tensors
        log_prob, advantage_, returns_ = log_prob.squeeze(1), advantage_.squeeze(1), returns_.squeeze(1)
        advantage_ = (advantage_ - advantage_.mean()) / (advantage_.std(unbiased=False) + 1e-8)
        pull = c.clone * max(0.0, 1.0 - self.samples / max(1, c.clone_fade))
        kls, losses, clipped = [], [], []
        for _ in range(c.epochs):
            order = torch.from_numpy(self.rng.permutation(len(advantage_)))
            for part in order.split(c.minibatch):
                if len(part) < 2:
                    continue  # a remainder of one has no spread
                mean = self.actor(observation[part])
                ratio = (self.actor.log_prob(mean, action[part]) - log_prob[part]).exp()
                a = advantage_[part]
                objective = torch.min(ratio * a, ratio.clamp(1.0 - c.clip, 1.0 + c.clip) * a).mean()
                value_loss = 0.5 * (self.critic(observation[part], future[part]) - returns_[part]).square().mean()
                loss = value_loss - objective - c.entropy * self.actor.log_std.sum()
                if pull > 0.0:
                    with torch.no_grad():
                        wanted = self.start(observation[part])
                    loss = loss + pull * ((mean - wanted) / self.actor.log_std.exp().detach()).square().sum(1).mean()
                self._descend(loss)
                with torch.no_grad():
                    kls.append(float(((ratio - 1.0) - ratio.log()).mean()))
                    clipped.append(float(((ratio - 1.0).abs() > c.clip).float().mean()))
                losses.append(float(value_loss.detach()))
            if parallel.mean(float(np.mean(kls[-4:]))) > c.target_kl:
                break
        with torch.no_grad():
            for mine, theirs in zip(self.average.parameters(), self.actor.parameters(), strict=True):
                mine.lerp_(theirs, 1.0 - c.average)
        variance = float(returns_.var())
        explained = 1.0 - float(np.mean(losses[-4:])) * 2.0 / max(variance, 1e-9)
        return {"kl": float(np.mean(kls)), "clipped": float(np.mean(clipped)), "explained": explained}

    def _descend(self, loss: torch.Tensor) -> None:
        if not torch.isfinite(loss):
            raise TrainingError("the PPO loss is not finite; the last good checkpoint is kept")
        self.optimiser.zero_grad()
        loss.backward()
        parameters = [*self.actor.parameters(), *self.critic.parameters()]
        parallel.average_gradients(parameters)
        torch.nn.utils.clip_grad_norm_(self.actor.parameters(), self.config.max_grad)
        torch.nn.utils.clip_grad_norm_(self.critic.parameters(), self.config.max_grad)
        self.optimiser.step()
        with torch.no_grad():
            self.actor.log_std.clamp_(min=math.log(self.config.std_floor))

    def state(self) -> dict:
        """All that a resumed run needs."""
        modules = {k: getattr(self, k).state_dict() for k in ("actor", "critic", "start", "average", "optimiser")}
        return {
            **modules,
            "rng": self.rng.bit_generator.state,
            "env": env_state(self.env),
            "teacher": self.teacher.state() if self.teacher else None,
            "own": self.own.copy(),
            "lead": self.lead,
            "recent": self.recent,
            "samples": self.samples,
        }

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        for k in ("actor", "critic", "start", "average", "optimiser"):
            getattr(self, k).load_state_dict(state[k])
        self.rng.bit_generator.state = state["rng"]
        load_env(self.env, state["env"])
        if self.teacher:
            self.teacher.load(state["teacher"])
        self.own[:] = state["own"]
        self.lead, self.recent, self.samples = state["lead"], state["recent"], state["samples"]
