"""Proximal policy optimisation (Schulman et al. 2017) with the paper's asymmetric critic.

An iteration: `horizon` steps in all rows with actions drawn from the policy; advantages by GAE; `epochs` passes over
the samples in minibatches with the clipped objective. Rollout and networks are on the device; the environment is not.
Additions to the published method, each switched off by its default:

- `clone`: weight of the squared distance from the actions of the initial actor. Without it the first noisy gradients
  destroy a precise clone of a teacher. `critic_only`: samples before the actor is trained, for the same reason.
- `std_floor`: least standard deviation of the exploration noise. The printed reward makes a policy reduce its noise
  until it explores nothing.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch
from torch import Tensor

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.network.actor_critic import Actor, Critic, NetworkConfig
from policies.task import result_row
from policies.task.contact import SUCCESS
from policies.training.learners.averaging import average_in
from policies.training.learners.device import Uplink
from policies.training.learners.learner import take_episodes
from policies.training.learners.rollout import Rollout
from policies.training.learners.storage import TrainingError, env_state, load_env

_STAGGER = 300  # control steps over which the rows' first episodes begin: about a flight


@dataclass(frozen=True)
class PpoConfig:
    """`samples` environment steps in all. Rewards are multiplied by `reward_scale` before learning. SI units.

    An iteration ends early once the policy has moved by `target_kl`. `average`: decay, an iteration, of the averaged
    weights, which are exported, see `average_in`."""

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
    std: float = 0.3
    std_floor: float = 0.1
    max_grad: float = 0.5
    reward_scale: float = 0.01
    critic_only: int = 0
    clone: float = 0.0
    average: float = 0.98


class Ppo:
    """The learner of PPO, see `learner.Learner`."""

    name: ClassVar[str] = "ppo"
    _MODULES = ("actor", "critic", "start", "average", "optimiser")

    def __init__(
        self,
        env: EnvConfig,
        network: NetworkConfig,
        config: PpoConfig,
        device: torch.device,
        actor: Actor | None = None,
    ) -> None:
        """`actor`: the initial actor; None: new weights."""
        self.config, self.device = config, device
        torch.manual_seed(env.seed)
        self.actor = (actor or Actor(network)).to(device)
        self.critic = Critic(network).to(device)
        with torch.no_grad():
            self.actor.log_std.fill_(math.log(config.std))
        self.start, self.average = deepcopy(self.actor), deepcopy(self.actor)
        self.optimiser = torch.optim.Adam(
            [
                {"params": self.actor.parameters(), "lr": config.rate},
                {"params": self.critic.parameters(), "lr": config.critic_rate},
            ],
            eps=1e-5,
        )
        self.rng = torch.Generator().manual_seed(env.seed)  # the host's: the same numbers on every device
        self.env = Env(env)
        self._uplink = Uplink(self.env, device)
        self.env.reset()
        self.rollout = Rollout(config.horizon, env.count, device)
        self.samples = 0

    @property
    def finished(self) -> bool:
        return self.samples >= self.config.samples

    def step(self) -> dict[str, float]:
        c = self.config
        if self.samples == 0:
            self._stagger()
        last_value = self._collect()
        progress = min(1.0, self.samples / c.samples)
        rate = c.rate + (c.rate_end - c.rate) * progress
        self.optimiser.param_groups[0]["lr"] = 0.0 if self.samples < c.critic_only else rate
        numbers = self._learn(last_value)
        rows, episodes = take_episodes(self.env)
        good = rows[:, result_row.OUTCOME] == SUCCESS
        return {
            "samples": self.samples,
            **episodes,
            "reward": float(self.rollout.reward.mean()) / c.reward_scale,
            "normal_speed": float(-rows[good, result_row.NORMAL_SPEED].mean()) if good.any() else math.nan,
            "std": float(self.actor.log_std.exp().mean().detach()),
            **numbers,
        }

    @torch.no_grad()
    def _stagger(self) -> None:
        """Begin the rows' first episodes at different times. Rows of one age show the learner one part of a flight at a
        time; learning that one it forgets the others, and a clone of a teacher is lost before it sees them again."""
        env = self.env
        begin = torch.randint(_STAGGER, (env.config.count,), generator=self.rng).numpy()
        for t in range(_STAGGER):
            env.step(self.actor(self._uplink.observation()).cpu().numpy())
            env.restart(begin == t)
        env.tally.__init__()

    @torch.no_grad()
    def _collect(self) -> Tensor:
        """Fill the rollout; returns the value of the states it ends in, (N,)."""
        env, r, c = self.env, self.rollout, self.config
        std = self.actor.log_std.exp()
        noise = torch.randn(c.horizon, env.config.count, 4, generator=self.rng).to(self.device)
        reward, done = np.zeros((2, c.horizon, env.config.count), dtype=np.float32)
        for t in range(c.horizon):
            r.observation[t], r.future[t] = self._uplink.observation(), self._uplink.future()
            mean = self.actor(r.observation[t])
            r.action[t] = mean + std * noise[t]
            flown = r.action[t].cpu().numpy()  # waits for the device; what follows runs beside the environment
            r.log_prob[t] = self.actor.log_prob(mean, r.action[t])
            r.value[t] = self.critic(r.observation[t], r.future[t])
            if c.clone > 0.0:
                r.wanted[t] = self.start(r.observation[t])
            env.step(flown)
            reward[t], done[t] = env.rows.reward * c.reward_scale, env.rows.done
            self.samples += env.config.count
        if not np.isfinite(reward).all():
            names = [k for k in env.rows._fields if not np.isfinite(getattr(env.rows, k)).all()]
            raise TrainingError(f"the reward is not finite (rows with bad numbers: {', '.join(names)})")
        r.reward.copy_(torch.from_numpy(reward))
        r.done.copy_(torch.from_numpy(done))
        return self.critic(self._uplink.observation(), self._uplink.future())

    def _learn(self, last_value: Tensor) -> dict[str, float]:
        """Epochs of minibatches. Raises TrainingError for a loss that is not finite."""
        r, c = self.rollout, self.config
        advantage, returns = r.advantages(last_value, c.gamma, c.gae)
        advantage = (advantage - advantage.mean()) / (advantage.std(unbiased=False) + 1e-8)
        samples = [x.flatten(0, 1) for x in (r.observation, r.future, r.action, r.log_prob, r.wanted)]
        samples += [advantage.flatten(), returns.flatten()]
        moved, clipped, errors = [], [], []
        for _ in range(c.epochs):
            for part in torch.randperm(returns.numel(), generator=self.rng).to(self.device).split(c.minibatch):
                kl, share, error = self._descend(*(x[part] for x in samples))
                moved.append(kl)
                clipped.append(share)
                errors.append(error)
            if float(torch.stack(moved[-4:]).mean()) > c.target_kl:
                break
        average_in(self.average, self.actor, c.average, self.samples // (self.env.config.count * c.horizon))
        distance, clips, mean_error = (float(torch.stack(x).mean()) for x in (moved, clipped, errors))
        if not math.isfinite(distance + mean_error):
            raise TrainingError("the PPO loss is not finite; the last good checkpoint is kept")
        explained = 1.0 - float(torch.stack(errors[-4:]).mean()) / max(float(returns.var()), 1e-9)
        return {"kl": distance, "clipped": clips, "explained": explained, "updates": float(len(moved))}

    def _descend(
        self,
        observation: Tensor,
        future: Tensor,
        action: Tensor,
        log_prob: Tensor,
        wanted: Tensor,
        advantage: Tensor,
        returns: Tensor,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One step of Adam; KL divergence, share of clipped ratios, squared error of the value."""
        c = self.config
        mean = self.actor(observation)
        log_ratio = self.actor.log_prob(mean, action) - log_prob
        ratio = log_ratio.exp()
        objective = torch.min(ratio * advantage, ratio.clamp(1.0 - c.clip, 1.0 + c.clip) * advantage).mean()
        error = (self.critic(observation, future) - returns).square().mean()
        loss = 0.5 * error - objective
        if c.clone > 0.0:
            off = (mean - wanted) / self.actor.log_std.exp().detach()
            loss = loss + c.clone * off.square().sum(1).mean()
        self.optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(self.actor.parameters(), c.max_grad)
        torch.nn.utils.clip_grad_norm_(self.critic.parameters(), c.max_grad)
        self.optimiser.step()
        with torch.no_grad():
            self.actor.log_std.clamp_(min=math.log(c.std_floor))
            kl, share = (ratio - 1.0 - log_ratio).mean(), ((ratio - 1.0).abs() > c.clip).float().mean()
        return kl, share, error.detach()

    def state(self) -> dict:
        modules = {name: getattr(self, name).state_dict() for name in self._MODULES}
        return {**modules, "rng": self.rng.get_state(), "env": env_state(self.env), "samples": self.samples}

    def load(self, state: dict) -> None:
        for name in self._MODULES:
            getattr(self, name).load_state_dict(state[name])
        self.rng.set_state(state["rng"])
        load_env(self.env, state["env"])
        self.samples = state["samples"]
