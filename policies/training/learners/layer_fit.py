"""The last layer's part for steep boards from afar, fitted to the planner on what the student is told.

DAgger in closed form: the features before the last layer stay, so that what the layer should say of them is a least
squares problem, one for each of the four actions. A round of flights by the student tells what it meets, the planner on
its belief what to do there; rounds count less the older they are. Boards that the planner takes no run-up to are flown
as before. What a camera's belief costs in timing, no layer can follow: it does the mean.
"""

from __future__ import annotations

import math
from copy import deepcopy
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.regimes import AFAR
from policies.task import result_row
from policies.task.contact import SUCCESS
from policies.teachers.planner import PlannerTeacher
from policies.training.learners import parallel
from policies.training.learners.storage import TrainingError, env_state, load_env

_EVERY = 5  # one step in so many is learnt from
_LEAST = 0.3  # share of the layer below which a sample is left out
_RIDGE = 1e-5  # of the features' mean square


@dataclass(frozen=True)
class LayerFitConfig:
    """`samples` environment steps in all, `horizon` a round in each row. `forget`: what a round counts beside the next.
    `noise`: one-sigma added to the student's actions. `ignore`: s before the planner's contact without labels. `run_*`:
    the run-up that is taught, see `PlannerParams`."""

    samples: int = 3_000_000
    horizon: int = 700
    forget: float = 0.7
    noise: float = 0.05
    ignore: float = 0.045
    run_accel: float = 1.75
    run_away: float = 1.5
    run_swing: float = 0.5
    run_turn: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.forget <= 1.0:
            raise ValueError(f"forget is {self.forget}; give 0 to 1")
        if self.horizon < _EVERY:
            raise ValueError(f"horizon is {self.horizon}; it must be at least {_EVERY}")


class LayerFit:
    """One run. `step()` is one round and returns its numbers; `state()`/`load()` make it resumable.

    Raises TrainingError for a network without regimes, or not mirrored.
    """

    def __init__(
        self,
        env: EnvConfig,
        network: NetworkConfig,
        config: LayerFitConfig,
        device: str = "cpu",
        actor: Actor | None = None,
    ) -> None:
        if not (network.regimes and network.mirrored):
            raise TrainingError("a phase of kind 'fit' takes a network with regimes, mirrored: say so in [network]")
        self.config, self.device = config, torch.device(device)
        torch.manual_seed(env.seed)
        self.actor = (actor or Actor(network)).to(self.device)
        parallel.share_weights(self.actor)
        self.average, self.before = self.actor, deepcopy(self.actor)
        size = network.width + 2  # features, the bias's one, the label
        self.moments = torch.zeros(4, size, size, dtype=torch.float64)
        self.rng = np.random.default_rng([env.seed, 4])
        self.env = Env(env)
        self.env.reset()
        names = {"run_accel": "acceleration", "run_away": "away", "run_swing": "slow_share", "run_turn": "turn"}
        run_up = {f"run_up.{path}": getattr(config, name) for name, path in names.items()}
        self.teacher = PlannerTeacher(self.env, run_up)
        self.samples = 0

    @property
    def finished(self) -> bool:
        return self.samples >= self.config.samples

    def step(self) -> dict[str, float]:
        """Fly a round, then put the layer where all rounds so far want it."""
        self.env.tally.__init__()
        self.moments *= self.config.forget
        flown = self._collect()
        self.samples += round(parallel.mean(self.config.horizon * self.env.config.count))
        error = self._solve(parallel.summed(flown))
        rows = self.env.tally.rows
        success = parallel.mean(float((rows[:, result_row.OUTCOME] == SUCCESS).mean()) if len(rows) else math.nan)
        return {"samples": self.samples, "success": success, "error": error}

    def _collect(self) -> Tensor:
        """The round's moments (4, width + 2, width + 2)."""
        c, env, flown = self.config, self.env, torch.zeros_like(self.moments)
        for t in range(c.horizon):
            seen = torch.from_numpy(env.rows.observation.copy()).to(self.device)
            label = torch.from_numpy(self.teacher.act().astype(np.float32)).to(self.device)
            with torch.no_grad():
                action, share = self.actor(seen).cpu().numpy(), self.actor.shares(seen)[:, AFAR]
                used = (share > _LEAST) & torch.from_numpy(self.teacher.remaining > c.ignore).to(self.device)
                if t % _EVERY == 0 and used.any():
                    runs_up = torch.from_numpy(self.teacher.runs_up()).to(self.device)
                    label = torch.where(runs_up[:, None], label, self.before(seen)).clamp(-1.0, 1.0)
                    flown += self._moments(seen[used], label[used], share[used])
            env.step(action + c.noise * self.rng.standard_normal(action.shape))
        return flown

    def _moments(self, seen: Tensor, label: Tensor, share: Tensor) -> Tensor:
        """Those of features as the mirrored network uses them: the mean of two, each with the action's sign."""
        features = self.actor.trunk(seen)
        reflected = self.actor.trunk(seen * self.actor.observation_signs)
        parts = []
        for k, sign in enumerate(self.actor.action_signs):
            ones = torch.full_like(share, 0.5 * float(1.0 + sign))[:, None]
            both = torch.cat([0.5 * (features + sign * reflected), ones, label[:, k : k + 1]], 1).double()
            parts.append((both * share[:, None].double()).T @ both)
        return torch.stack(parts).cpu()

    @torch.no_grad()
    def _solve(self, flown: Tensor) -> float:
        """Add a round to the moments and fit the layer. Returns the rms error of its actions. Raises TrainingError."""
        self.moments += flown
        if not torch.isfinite(self.moments).all():
            raise TrainingError("the features' moments are not finite; the last good checkpoint is kept")
        # The bias's ones, where the action has no sign of its own (thrust), count the samples.
        count = float(self.moments[3, -2, -2])
        if not count:
            raise TrainingError(
                "no flight saw a steep, steady board from afar: there is nothing to fit that layer to; "
                "set [env] inclination_deg to more than 60 and its flights to begin more than 2.6 m away"
            )
        square, head = 0.0, self.actor.head
        for k, moments in enumerate(self.moments):
            gram, wanted = moments[:-1, :-1], moments[:-1, -1]
            ridge = _RIDGE * gram.diagonal().mean() * torch.eye(len(gram), dtype=gram.dtype)
            layer = torch.linalg.lstsq(gram + ridge, wanted[:, None], driver="gelsd").solution[:, 0]
            square += float(moments[-1, -1] - 2.0 * layer @ wanted + layer @ gram @ layer)
            head.weight[4 * AFAR + k], head.bias[4 * AFAR + k] = layer[:-1].to(head.weight), layer[-1].to(head.bias)
        return math.sqrt(max(0.0, square) / (4.0 * count))

    def state(self) -> dict:
        """All that a resumed run needs."""
        return {
            "actor": self.actor.state_dict(),
            "before": self.before.state_dict(),
            "moments": self.moments,
            "rng": self.rng.bit_generator.state,
            "env": env_state(self.env),
            "teacher": self.teacher.state(),
            "samples": self.samples,
        }

    def load(self, state: dict) -> None:
        """Inverse of `state`."""
        for name in ("actor", "before"):
            getattr(self, name).load_state_dict(state[name])
        self.moments.copy_(state["moments"])
        self.rng.bit_generator.state = state["rng"]
        load_env(self.env, state["env"])
        self.teacher.load(state["teacher"])
        self.samples = state["samples"]
