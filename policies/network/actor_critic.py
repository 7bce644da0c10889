"""The networks of PerchRL: a TCN over the history, an MLP head; a critic that also sees the board's future.

Convolutions whose kernel equals their stride (5, 2, 3 over 30 entries) are matrix products over reshaped input, which
costs half of overlapping ones on a CPU and leaves nothing but Gemm in the exported file. The newest entry is also
given to the MLP directly, because it decides the last half second.

`geometry`: a handful of products of the newest entry (offset along and across the normal, closing velocity, body axis
against normal) that an MLP of this size approximates poorly near contact. They are functions of the paper's inputs.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass

import torch
from torch import Tensor, nn

from policies.task import entry_row, tail_row
from policies.task.observation import HISTORY, NEWEST, TAIL, USUAL_DRAG
from policies.task.symmetry import ACTION_SIGNS, OBSERVATION_SIGNS

FUTURE = 15  # N of the paper
FORESEEN = (2, 5, 9, 14)  # which of them the trunk predicts during imitation
GEOMETRY_DIM = 17
# Divisors by entry of [p_rel, normal, vx, vy, turn rate, t] and of [v, R, rho, action, gain, drag, sigma].
ENTRY_SCALE = (2.0, 2.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 1.0, 0.5)
TAIL_SCALE = (2.0, 2.0, 1.0, *(1.0,) * 9, 1.0, *(1.0,) * 4, 0.15, 0.15, 0.02)
TAIL_SHIFT = (0.0,) * tail_row.GAIN + (1.0, USUAL_DRAG, 0.0)


@dataclass(frozen=True)
class NetworkConfig:
    """Architecture and the paper's ablations. `temporal` False is PerchRL w/o TA: no TCN, no future for the critic.

    `symmetric`: reflection symmetry. The actor evaluates its observation and the reflected observation in one batch and
    answers the mean of both actions, the second reflected back: left and right are treated alike.
    """

    temporal: bool = True
    geometry: bool = True
    symmetric: bool = True
    channels: tuple[int, int, int] = (48, 64, 96)
    width: int = 256
    log_std: float = -1.2

    def __post_init__(self) -> None:
        if len(self.channels) != 3 or min(*self.channels, self.width) < 1:
            raise ValueError(
                f"channels are {self.channels}, width is {self.width}; give three sizes, then one, all positive"
            )

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
        x = self.act(
            self.first(history.reshape(-1, 5 * entry_row.DIM))
        )  # two axes only: the file keeps the weights' names
        x = self.act(self.second(x.reshape(-1, 2 * x.shape[1])))
        return self.act(self.third(x.reshape(-1, 3 * x.shape[1])))


def geometry(newest: Tensor, tail: Tensor) -> Tensor:
    """(B, GEOMETRY_DIM) products of the newest entry (physical units) and the tail; see the module's text."""
    p, n = newest[:, 0:3], newest[:, 3:6]
    v = tail[:, tail_row.V : tail_row.V + 3] - newest[:, 6:9] * newest.new_tensor(
        [1.0, 1.0, 0.0]
    )  # a board has none upwards
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
    future_signs: Tensor
    reflections: Tensor
    reflected_back: Tensor

    def __init__(self, config: NetworkConfig) -> None:
        super().__init__()
        self.config = config
        self.register_buffer("observation_signs", torch.tensor(OBSERVATION_SIGNS), persistent=False)
        self.register_buffer("action_signs", torch.tensor(ACTION_SIGNS), persistent=False)
        self.register_buffer("future_signs", torch.tensor((1.0, -1.0) * len(FORESEEN)), persistent=False)
        sides = torch.stack([torch.ones_like(self.observation_signs), self.observation_signs])
        back = 0.5 * torch.stack([torch.ones_like(self.action_signs), self.action_signs])
        self.register_buffer("reflections", sides, persistent=False)  # (2, OBS_DIM)
        self.register_buffer("reflected_back", back, persistent=False)  # (2, 4): of both actions the mean
        self.trunk = Trunk(config, 0)
        self.head = nn.Linear(config.width, 4)
        self.foresight = nn.Linear(config.width, 2 * len(FORESEEN))
        self.log_std = nn.Parameter(torch.full((4,), config.log_std))
        nn.init.uniform_(self.head.weight, -0.01, 0.01)
        nn.init.zeros_(self.head.bias)

    def forward(self, observation: Tensor) -> Tensor:
        """The mean action."""
        if not self.config.symmetric:
            return self.head(self.trunk(observation))
        both = (observation[:, None] * self.reflections).reshape(-1, observation.shape[1])
        return (self.head(self.trunk(both)).reshape(-1, 2, 4) * self.reflected_back).sum(1)

    def with_foresight(self, observation: Tensor) -> tuple[Tensor, Tensor]:
        """For imitation: the action (B, 4) without the reflection, and the board's future horizontal positions
        (B, 2 * len(FORESEEN)), m, in the vehicle's yaw frame."""
        features = self.trunk(observation)
        return self.head(features), self.foresight(features)

    def log_prob(self, mean: Tensor, action: Tensor) -> Tensor:
        """Log density (B,) of unclipped actions."""
        return torch.distributions.Normal(mean, self.log_std.exp()).log_prob(action).sum(1)


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
