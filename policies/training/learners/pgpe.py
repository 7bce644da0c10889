"""Policy search by trying: parameter-exploring policy gradients (Sehnke et al. 2010) on the last layer of an actor.

Imitation ends at what its teacher does. Here nobody teaches: each flight is flown by an actor whose last layer is
off by a random little, and again, from the same moment and through the same noise, by one that is off by as much the
other way. How much better the first ended, times how it was off, is in the mean over thousands of such pairs the
gradient. It takes no critic, no reward but how flights end, and no noise on the actions.

Where in the last layer it searches: `pgpe_space.py`.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.environment.rows import E_STEPS, Rows
from policies.evaluation.evaluate import IMPACT_BAND
from policies.network.actor_critic import Actor, NetworkConfig
from policies.task import result_row
from policies.task.contact import SUCCESS, ContactRules
from policies.training.learners import parallel
from policies.training.learners.pgpe_flights import STRAIGHT, Act, fly_near, fly_out, rather_turning
from policies.training.learners.pgpe_space import HeadSpace
from policies.training.learners.storage import TrainingError

_EVERY = 5  # one feature vector in so many is looked at
_FEW = 0.1  # share of the flights
_TRAINING_SEEDS = 1 << 40  # evaluation's begin there


@dataclass(frozen=True)
class PgpeConfig:
    """`samples` environment steps in all. Each iteration flies `pairs` pairs of flights from where every row of the
    environment comes within `near` m of its board; with `turning`, rather from where a board turns, all at so many
    rad/s or more (0: all, however they turn). `directions` of the features are searched, by `sigma` (one-sigma, of an
    action in [-1, 1]). `rate`: sigmas that a gradient of one (score by sigma) moves the layer by, falling to zero.
    `momentum` and `average`: decay of the gradient, and of the averaged weights, which are what flies.
    The score of a flight that touched is a product: for each tolerance of Algorithm 1 a logistic function, one half at
    the limit, `soft` of the limit wide; and one, less `hard` for every m/s into the board above what the paper flew and
    `late` for every s that it took."""

    samples: int = 300_000_000
    pairs: int = 8
    near: float = 2.0
    turning: float = 0.0
    directions: int = 32
    sigma: float = 0.01
    rate: float = 20.0
    momentum: float = 0.8
    average: float = 0.95
    soft: float = 0.12
    hard: float = 0.2
    late: float = 0.03

    def __post_init__(self) -> None:
        for name in ("pairs", "directions"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("near", "sigma", "rate", "soft"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive")
        if self.turning and not self.turning > STRAIGHT:
            raise ValueError(f"turning is {self.turning} rad/s; give more than {STRAIGHT}, or 0 for all boards alike")
        for name in ("momentum", "average"):
            if not 0.0 <= getattr(self, name) < 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; give a decay from 0 to below 1")


def score(ended: np.ndarray, rules: ContactRules, config: PgpeConfig) -> np.ndarray:
    """How well flights ended ((K, ENDED_DIM), see env_rows), (K,) from 0 to 1; see `PgpeConfig`."""
    share = (ended[:, result_row.TOUCHED] > 0.0).astype(np.float64)
    for column, limit in (
        (result_row.PLANAR, rules.delta_d),
        (result_row.TANGENTIAL_SPEED, rules.delta_v),
        (result_row.NORMAL_ERROR, rules.delta_theta),
    ):
        margin = np.clip((1.0 - ended[:, column] / limit) / config.soft, -40.0, 40.0)
        share /= 1.0 + np.exp(-margin)
    hard = np.maximum(0.0, -ended[:, result_row.NORMAL_SPEED] - IMPACT_BAND[1])
    return share * np.maximum(0.0, 1.0 - config.hard * hard - config.late * TICK * ended[:, E_STEPS])


class Pgpe:
    """One run. `step()` is one iteration and returns its numbers; `state()`/`load()` make it resumable."""

    def __init__(
        self,
        env: EnvConfig,
        network: NetworkConfig,
        config: PgpeConfig,
        device: str = "cpu",
        actor: Actor | None = None,
    ) -> None:
        self.config, self.device = config, torch.device(device)
        torch.manual_seed(env.seed)
        self.actor = (actor or Actor(network)).to(self.device)
        parallel.share_weights(self.actor)
        self.average = deepcopy(self.actor)
        self.space = HeadSpace(self.actor.head, config.directions, config.sigma).to(self.device)
        self.optimiser = torch.optim.SGD(self.space.parameters(), lr=config.rate, momentum=config.momentum)
        self.rng = np.random.default_rng([env.seed, 3])
        self.env = Env(env)
        self.env.reset()
        self.samples = 0

    @property
    def finished(self) -> bool:
        return self.samples >= self.config.samples

    def step(self) -> dict[str, float]:
        """Fly near, fly out in pairs, move the layer."""
        c = self.config
        start, steps_near = fly_near(self.env, self._act(), c.near)
        if c.turning:
            start = rather_turning(start, c.turning, self.rng)
        if not self.space.basis.any():
            self._span(start)
        shape = (c.pairs, 1, len(start.done), *self.space.offset.shape)
        change = torch.from_numpy(self.rng.standard_normal(shape).astype(np.float32)).to(self.device)
        both = torch.cat([change, -change], 1).flatten(0, 2)
        seeds = self.rng.integers(_TRAINING_SEEDS, size=c.pairs).repeat(2).tolist()
        shares = torch.zeros(2 * c.pairs * len(start.done), self.actor.head.out_features // 4, device=self.device)
        ended, steps_out = fly_out(start, self.env.shared, self._act(both, shares=shares), seeds)
        self.samples += round(parallel.mean(steps_near + steps_out))  # all processes end together
        scores = score(ended, self.env.config.rules, c).reshape(c.pairs, 2, -1)
        better = torch.from_numpy(0.5 * (scores[:, 0] - scores[:, 1])).float().to(self.device)
        # Who does not fly by a regime's layer tells nothing of it; one that few fly by moves as much less.
        mine = shares.reshape(c.pairs, 2, len(start.done), -1).amax(1).repeat_interleave(4, 2)
        gradient = torch.einsum("pn,pnok,pno->ok", better, change[:, 0], mine)
        gradient /= mine.sum((0, 1))[:, None].clamp(min=_FEW * better.numel())
        self._move(gradient)
        return {
            "samples": self.samples,
            "success": parallel.mean(float((ended[:, result_row.OUTCOME] == SUCCESS).mean())),
            "score": parallel.mean(float(scores.mean())),
            "slope": float(gradient.norm()),
            "moved": float(self.space.offset.detach().norm()),
        }

    def _act(
        self,
        change: Tensor | None = None,
        watch: Callable[[Tensor], None] | None = None,
        shares: Tensor | None = None,
    ) -> Act:
        """The actor, row by row `change`d; `watch` is shown the features, `shares` (rows, regimes) raised to the
        largest that each regime had of a row's flight."""
        head = self.actor.head

        def act(observation: np.ndarray, which: np.ndarray) -> np.ndarray:
            seen, rows = (torch.from_numpy(array).to(self.device) for array in (observation, which))
            mine = None if change is None else change[rows]

            def changed(features: Tensor) -> Tensor:
                if watch is not None:
                    watch(features)
                return head(features) if mine is None else head(features) + self.space.changed(features, mine)

            with torch.no_grad():
                if shares is not None:
                    shares[rows] = torch.maximum(shares[rows], self.actor.shares(seen))
                return self.actor(seen, changed).cpu().numpy()

        return act

    def _span(self, start: Rows) -> None:
        """Look at the features on the way from `start` to the board."""
        seen: list[Tensor] = []
        act = self._act(watch=lambda features: seen.append(features[len(seen) % _EVERY :: _EVERY]))
        fly_out(start, self.env.shared, act, [int(self.rng.integers(_TRAINING_SEEDS))])
        self.space.span(torch.cat(seen))
        parallel.share_weights(self.space)

    def _move(self, gradient: Tensor) -> None:
        if not torch.isfinite(gradient).all():
            raise TrainingError("the score is not finite; the last good checkpoint is kept")
        c = self.config
        for group in self.optimiser.param_groups:
            group["lr"] = c.rate * (1.0 - c.momentum) * max(0.0, 1.0 - self.samples / c.samples)
        self.space.offset.grad = -gradient
        parallel.average_gradients([self.space.offset])
        self.optimiser.step()
        self.space.write(self.actor.head)
        with torch.no_grad():
            for mine, theirs in zip(self.average.head.parameters(), self.actor.head.parameters(), strict=True):
                mine.lerp_(theirs, 1.0 - c.average)

    def state(self) -> dict:
        """All that a resumed run needs."""
        modules = {k: getattr(self, k).state_dict() for k in ("actor", "average", "space", "optimiser")}
        numbers = {"rng": self.rng.bit_generator.state, "samples": self.samples}
        return {**modules, **numbers, "rows": self.env.rows.rng.copy()}

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        for k in ("actor", "average", "space", "optimiser"):
            getattr(self, k).load_state_dict(state[k])
        self.rng.bit_generator.state = state["rng"]
        self.samples = state["samples"]
        self.env.rows.rng[:] = state["rows"]  # an iteration begins with a reset
