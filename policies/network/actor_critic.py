"""The networks of PerchRL: a TCN over the history, an MLP head; a critic that also sees the board's future.

Convolutions whose kernel equals their stride (5, 2, 3 over 30 entries) are matrix products over reshaped input, which
costs half of overlapping ones on a CPU and leaves nothing but Gemm in the exported file. The newest entry also skips
to the MLP: what matters in the last half second should not have to pass three layers.

`geometry`: a handful of products of the newest entry (offset along and across the normal, closing velocity, body axis
against normal) that an MLP of this size approximates poorly near contact. They are functions of the paper's inputs.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict, dataclass

import torch
from torch import Tensor, nn

from policies.network.regimes import REGIMES, regime_shares
from policies.network.soft import softened_action
from policies.network.touch import aligned_action, flared_action, lean_everywhere, relative_velocity, seen_poorly
from policies.task import entry_row, tail_row
from policies.task.observation import HISTORY, NEWEST, TAIL, USUAL_DRAG
from policies.task.symmetry import ACTION_SIGNS, OBSERVATION_SIGNS

FUTURE = 15  # N of the paper
FORESEEN = (2, 5, 9, 14)  # which of them the trunk is asked to foretell while it imitates
GEOMETRY_DIM = 17
# Divisors by entry of [p_rel, normal, vx, vy, turn rate, t] and of [v, R, rho, action, gain, drag, sigma].
ENTRY_SCALE = (2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 1.0, 0.5)
TAIL_SCALE = (2.0, 2.0, 1.0, *(1.0,) * 9, 1.0, *(1.0,) * 4, 0.15, 0.15, 0.02)
TAIL_SHIFT = (0.0,) * tail_row.GAIN + (1.0, USUAL_DRAG, 0.0)


@dataclass(frozen=True)
class NetworkConfig:
    """Architecture and the paper's ablations. `temporal` False is PerchRL w/o TA: no TCN, no future for the critic.

    `mirrored`: the actor is asked about its observation and about the mirror image of it, and does the mean of both:
    right and left are the same to it. `aligned`: its rates are corrected for an aligned contact, `lean` rad up
    a vertical slope (`touch_attitude.py`), and for a flare begun too late (`late_flare.py`); where the surface is seen
    poorly, `lean_unsure` rad more up any slope: thrust then holds against the pull along it, and a contact too early or
    too late skids less. `soft`: m/s that thrust brakes to before contact, where more is not needed (`network_soft.py`);
    0: it does not. `regimes`: its last layer is one of several, blended by how steep the board is, how far and
    how well it is seen (`network_regimes.py`).
    """

    temporal: bool = True
    geometry: bool = True
    mirrored: bool = False
    aligned: bool = False
    lean: float = 0.0
    lean_unsure: float = 0.0
    soft: float = 0.0
    regimes: bool = False
    channels: tuple[int, int, int] = (24, 32, 48)
    width: int = 128
    log_std: float = -1.2

    def __post_init__(self) -> None:
        if len(self.channels) != 3 or min(*self.channels, self.width) < 1:
            raise ValueError(
                f"channels are {self.channels}, width is {self.width}; give three sizes, then one, all positive"
            )
        for name in ("lean", "lean_unsure", "soft"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; give a finite number that is not negative")

    def data(self) -> dict:
        """As plain data, for a checkpoint."""
        return {**asdict(self), "channels": list(self.channels)}

    @classmethod
    def of(cls, data: dict) -> NetworkConfig:
        """Inverse of `data`."""
        return cls(**{**data, "channels": tuple(data["channels"])})


def normalisation() -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(shift, scale) for each entry of a history element, then of the tail."""
    return (0.0,) * entry_row.DIM + TAIL_SHIFT, ENTRY_SCALE + TAIL_SCALE


class Tcn(nn.Module):
    """Three strided temporal convolutions: (B, 30, 10) -> (B, channels[2])."""

    def __init__(self, channels: tuple[int, int, int]) -> None:
        super().__init__()
        a, b, c = channels
        self.first, self.second, self.third = nn.Linear(5 * entry_row.DIM, a), nn.Linear(2 * a, b), nn.Linear(3 * b, c)
        self.act = nn.ELU()

    def forward(self, history: Tensor) -> Tensor:
        x = self.act(self.first(history.reshape(-1, 6, 5 * entry_row.DIM)))
        x = self.act(self.second(x.reshape(-1, 3, 2 * x.shape[-1])))
        return self.act(self.third(x.reshape(-1, 3 * x.shape[-1])))


def geometry(newest: Tensor, tail: Tensor) -> Tensor:
    """(B, GEOMETRY_DIM) products of the newest entry (physical units) and the tail; see the module's text."""
    p, n = newest[:, 0:3], newest[:, 3:6]
    v = relative_velocity(newest, tail)
    z = tail[:, [tail_row.R + 2, tail_row.R + 5, tail_row.R + 8]]
    along, closing = (p * n).sum(1, keepdim=True), (v * n).sum(1, keepdim=True)
    across, sliding = p - along * n, v - closing * n
    lean = z - n
    near = 1.0 / (0.25 + p.norm(dim=1, keepdim=True))
    return torch.cat(
        [along, closing, across, sliding, 2.0 * lean, v, 0.5 * near * along, 0.5 * near * closing, near], 1
    )


class Trunk(nn.Module):
    """History and tail to features: normalisation, TCN, newest entry, tail, geometry, optionally futures."""

    shift: Tensor
    scale: Tensor
    future_scale: Tensor

    def __init__(self, config: NetworkConfig, futures: int) -> None:
        super().__init__()
        self.config, self.futures = config, futures
        shift, scale = normalisation()
        entry, tail = slice(0, entry_row.DIM), slice(entry_row.DIM, None)
        self.register_buffer("shift", torch.tensor(shift[entry] * HISTORY + shift[tail]), persistent=False)
        self.register_buffer("scale", torch.tensor(scale[entry] * HISTORY + scale[tail]), persistent=False)
        self.register_buffer("future_scale", torch.tensor(ENTRY_SCALE * futures), persistent=False)
        self.tcn = Tcn(config.channels) if config.temporal else None
        size = entry_row.DIM + tail_row.DIM + futures * entry_row.DIM
        size += config.channels[2] if config.temporal else 0
        size += GEOMETRY_DIM if config.geometry else 0
        self.first, self.second, self.act = (
            nn.Linear(size, config.width),
            nn.Linear(config.width, config.width),
            nn.ELU(),
        )

    def forward(self, observation: Tensor, future: Tensor | None = None) -> Tensor:
        x = (observation - self.shift) / self.scale
        parts = [x[:, NEWEST:TAIL], x[:, TAIL:]]
        if self.tcn is not None:
            parts.append(self.tcn(x[:, :TAIL].reshape(-1, HISTORY, entry_row.DIM)))
        if self.config.geometry:
            parts.append(geometry(observation[:, NEWEST:TAIL], observation[:, TAIL:]))
        if self.futures:
            if future is None:
                raise ValueError("this network was built to see future states; none were given")
            parts.append(future / self.future_scale)
        return self.act(self.second(self.act(self.first(torch.cat(parts, 1)))))


class Actor(nn.Module):
    """Observation (B, OBS_DIM) to the mean action (B, 4), in [-1, 1] after clipping; Gaussian with a free log-std."""

    observation_signs: Tensor
    action_signs: Tensor
    lean: Tensor
    lean_unsure: Tensor
    soft: Tensor
    future_signs: Tensor

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("observation_signs", torch.tensor(OBSERVATION_SIGNS), persistent=False)
        self.register_buffer("action_signs", torch.tensor(ACTION_SIGNS), persistent=False)
        self.register_buffer("future_signs", torch.tensor((1.0, -1.0) * len(FORESEEN)), persistent=False)
        if config.aligned:  # with the weights: an exported file keeps it
            self.register_buffer("lean", torch.tensor([config.lean]))
            if config.lean_unsure:
                self.register_buffer("lean_unsure", torch.tensor([config.lean_unsure]))
        if config.soft:
            self.register_buffer("soft", torch.tensor([config.soft]))
        self.trunk = Trunk(config, 0)
        self.head = nn.Linear(config.width, 4 * REGIMES if config.regimes else 4)
        self.foresight = nn.Linear(config.width, 2 * len(FORESEEN))
        self.log_std = nn.Parameter(torch.full((4,), config.log_std))
        nn.init.uniform_(self.head.weight, -0.01, 0.01)
        nn.init.zeros_(self.head.bias)

    def forward(self, observation: Tensor, head: Callable[[Tensor], Tensor] | None = None) -> Tensor:
        """The mean action; `head` in place of the actor's own, from features (B, width) to what that gives."""
        head, shares = head or self.head, self.shares(observation)
        if self.config.mirrored:  # at once: in flight it is the operations that take time, not the numbers
            both = self.trunk(torch.cat([observation, observation * self.observation_signs]))
            seen, reflected = (_blended(head(features), shares) for features in both.chunk(2))
            action = 0.5 * (seen + self.action_signs * reflected)
        else:
            action = _blended(head(self.trunk(observation)), shares)
        newest, tail = observation[:, NEWEST:TAIL], observation[:, TAIL:]
        if self.config.aligned:
            lean = self.lean
            if self.config.lean_unsure:
                lean = lean + self.lean_unsure * seen_poorly(tail) * lean_everywhere(newest)
            action = flared_action(newest, tail, aligned_action(newest, tail, action, lean), lean)
        return softened_action(newest, tail, action, self.soft) if self.config.soft else action

    def shares(self, observation: Tensor) -> Tensor:
        """How much each of the last layer's regimes counts, (B, REGIMES) or, if it has none, (B, 1) ones."""
        if not self.config.regimes:
            return torch.ones_like(observation[:, :1])
        return regime_shares(observation)

    def with_foresight(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """The mean action, and where the board will be ((B, 2 * len(FORESEEN)), m): a training aid."""
        features = self.trunk(observation)
        return _blended(self.head(features), self.shares(observation)), self.foresight(features)

    def log_prob(self, mean: Tensor, action: Tensor) -> Tensor:
        """Log density (B,) of unclipped actions."""
        return torch.distributions.Normal(mean, self.log_std.exp()).log_prob(action).sum(1)


def _blended(actions: Tensor, shares: Tensor) -> Tensor:
    """(B, 4) of one action for each regime (B, 4 * R) and their shares (B, R)."""
    if shares.shape[1] == 1:
        return actions
    return (actions.reshape(-1, REGIMES, 4) * shares[:, :, None]).sum(1)


class Critic(nn.Module):
    """Value (B,) from the observation and, unless ablated, FUTURE future board states (B, FUTURE * ENTRY_DIM)."""

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.trunk = Trunk(config, FUTURE if config.temporal else 0)
        self.head = nn.Linear(config.width, 1)

    def forward(self, observation: Tensor, future: Tensor) -> Tensor:
        return self.head(self.trunk(observation, future)).squeeze(1)


class FlightActor(nn.Module):
    """What is exported: the mean action, clipped."""

    def __init__(self, actor: Actor) -> None:
        super().__init__()
        self.actor = actor

    def forward(self, observation: Tensor) -> Tensor:
        return self.actor(observation).clamp(-1.0, 1.0)
