"""Trains the motion predictor.

python -m policies.prediction.learned_training [--minutes M] [--drives N] [--seed S] [--out FILE]

Supervised: the path that the network's speeds and turn rates give, integrated as in flight but without
`learned.believe_filter`, is trained to be the path that was driven. One thread. Prints the error at about 0.5, 1, 1.5
and 2 s on held-out drives beside the base motion's. The committed weights: --minutes 9 --seed 1 --out A, then --minutes
7 --seed 2 --start A --out B, each with earlier filter parameters, then --minutes 5 --seed 3 --start B with accel_sigma
1.2, accel_tau 0.3 and settle 0.8.
"""

from __future__ import annotations

import argparse
import itertools
import math
import time
from pathlib import Path

import numpy as np
import torch
from torch import Tensor, nn

from policies.prediction import context_row, input_row, net_row
from policies.prediction import learned as pd
from policies.prediction.future import HORIZON, STEP
from policies.prediction.learned_data import EVERY, TARGETS, Examples, make_examples

BATCH = 1024
LIMITS = (0.3, 0.7, 0.8, 1.6, 0.0)  # of trust, as in net_row from LIMITS on; from the validation below
AHEAD = np.arange(TARGETS) * EVERY * STEP
_REFLECTED = (input_row.TURN_RATE, input_row.ACROSS)  # channels of a tap that change sign in a reflection


def mirror_signs() -> tuple[Tensor, Tensor]:
    """Signs of inputs ((net_row.INPUTS,)) and of a target ((target_row.DIM,)) of the reflected drive."""
    inputs = torch.ones(net_row.INPUTS)
    for channel in _REFLECTED:
        inputs[channel : input_row.NOW : input_row.CHANNELS] = -1.0
    inputs[input_row.NOW + input_row.TURN_RATE] = -1.0
    return inputs, torch.tensor([1.0, -1.0, -1.0, 1.0])


def build_network() -> nn.Sequential:
    """The network in torch; its last layer starts at zero, that is at the base motion."""
    last = nn.Linear(net_row.HIDDEN2, net_row.OUTPUTS)
    nn.init.zeros_(last.weight)
    nn.init.zeros_(last.bias)
    return nn.Sequential(
        nn.Linear(net_row.INPUTS, net_row.HIDDEN1),
        nn.ReLU(),
        nn.Linear(net_row.HIDDEN1, net_row.HIDDEN2),
        nn.ReLU(),
        last,
    )


def network_row(network: nn.Sequential) -> np.ndarray:
    """The network as the kernels' row."""
    linear = [layer for layer in network if isinstance(layer, nn.Linear)]
    layers = [(m.weight.detach().numpy().T.copy(), m.bias.detach().numpy()) for m in linear]
    return pd.pack_network(layers, LIMITS)


class DrivenPath(nn.Module):
    """From outputs to the path: base motion + interpolated residuals, integrated like `learned.integrate_rows`."""

    def __init__(self) -> None:
        super().__init__()
        ahead = torch.arange(HORIZON) * STEP
        self.spread = torch.tensor(pd.interpolation(), dtype=torch.float32)
        self.gain = pd.TAU * (1.0 - torch.exp(-ahead / pd.TAU))

    def forward(self, now: Tensor, outputs: Tensor) -> Tensor:
        """`now` (B, 3): speed, turn rate, acceleration; outputs (B, OUTPUTS). Returns (B, HORIZON, 4)."""
        speed, turn = now[:, :1], now[:, 1:2]
        speeds = speed + now[:, 2:] * self.gain
        ratio = torch.where(speed.abs() > 0.5, speeds / torch.where(speed.abs() > 0.5, speed, 1.0), 1.0)
        turns = turn * ratio.clamp(-1.0, 2.0) + outputs[:, net_row.KNOTS : 2 * net_row.KNOTS] @ self.spread
        speeds = speeds + outputs[:, : net_row.KNOTS] @ self.spread
        turns, speeds = turns.clamp(-2.5, 2.5), speeds.clamp(-4.0, 4.0)
        step = 0.5 * STEP * (turns[:, 1:] + turns[:, :-1])
        heading = torch.cat([torch.zeros_like(speed), step.cumsum(1)], 1)
        half = 0.5 * step
        chord = 0.5 * STEP * (speeds[:, 1:] + speeds[:, :-1]) * (1.0 - half * half / 6.0)
        angle = heading[:, :-1] + half
        zero = torch.zeros_like(speed)
        x = torch.cat([zero, (chord * angle.cos()).cumsum(1)], 1)
        y = torch.cat([zero, (chord * angle.sin()).cumsum(1)], 1)
        return torch.stack([x, y, heading, speeds], -1)


def loss_of(path: Tensor, outputs: Tensor, target: Tensor) -> Tensor:
    """Mean of position, heading and speed errors, near horizons weighing more, and the fit of the expected error."""
    got, ahead = path[:, ::EVERY], torch.tensor(AHEAD, dtype=torch.float32)
    weight = 1.0 / (0.06 + 0.15 * ahead)
    error = got - target
    place = (error[..., :2].square().sum(-1) + 4e-4).sqrt()
    heading, speed = (error[..., 2].square() + 4e-4).sqrt(), (error[..., 3].square() + 4e-4).sqrt()
    near = error[:, : round(0.75 / (EVERY * STEP)), 3].detach().square().mean(1)
    spread = outputs[:, -1].clamp(-5.0, 1.0)
    surprise = 0.5 * near * torch.exp(-2.0 * spread) + spread
    return (weight * (place + 0.1 * heading + 0.1 * speed)).mean() + 0.02 * surprise.mean()


@torch.no_grad()
def errors(network: nn.Module, path: DrivenPath, data: Examples) -> dict[str, np.ndarray]:
    """Mean position errors (m) by target time: of the network and of the base motion alone, (N, TARGETS) each."""
    out = {"learned": [], "base": []}
    for i in range(0, len(data.inputs), 8192):
        now = torch.from_numpy(data.contexts[i : i + 8192, :3])
        outputs = network(torch.from_numpy(data.inputs[i : i + 8192]))
        target = torch.from_numpy(data.targets[i : i + 8192])
        for name, answer in (("learned", outputs), ("base", torch.zeros_like(outputs))):
            error = path(now, answer)[:, ::EVERY, :2] - target[..., :2]
            out[name].append(error.square().sum(-1).sqrt().numpy())
    return {name: np.concatenate(parts) for name, parts in out.items()}


def report(found: dict[str, np.ndarray], data: Examples) -> str:
    """Errors by horizon, then by length of history and by age at 0.9 s."""
    at = [int(np.argmin(np.abs(AHEAD - t))) for t in (0.45, 0.9, 1.5, 2.1)]
    lines = [f"{name:8} " + " ".join(f"{e[:, at].mean(0)[j]:.3f}" for j in range(4)) for name, e in found.items()]
    ratio = found["learned"][:, at[1]], found["base"][:, at[1]]
    for name, column, edges in (
        ("history", context_row.HISTORY, (0, 0.2, 0.4, 0.6, 0.8, 1.2, 2, 3, 5.1)),
        ("age", context_row.AGE, (0, 0.1, 0.2, 0.4, 0.6, 0.9, 1.2, 2)),
    ):
        value = data.contexts[:, column]
        for low, high in itertools.pairwise(edges):
            chosen = (value >= low) & (value < high)
            if chosen.sum() > 30:
                lines.append(
                    f"{name} {low}-{high} s: learned {ratio[0][chosen].mean():.3f} base {ratio[1][chosen].mean():.3f}"
                )
    return "\n".join(lines)


def start_from(network: nn.Sequential, row: np.ndarray) -> None:
    """Copy a predictor's row into the torch network."""
    at = 0
    for layer in network:
        if isinstance(layer, nn.Linear):
            for part in (layer.weight.data.T, layer.bias.data):
                part.copy_(torch.from_numpy(row[at : at + part.numel()].reshape(part.shape)))
                at += part.numel()


def train(minutes: float, drives: int, seed: int, out: Path, start: Path | None = None) -> None:
    """Train for `minutes` of wall time and write `out`. RuntimeError, `out` left alone, if the loss is not finite."""
    torch.set_num_threads(1)
    torch.manual_seed(seed)
    data, held = make_examples(drives, seed), make_examples(max(50, drives // 20), seed + 1_000_003)
    print(f"{len(data.inputs)} examples, {len(held.inputs)} held out", flush=True)
    network, path = build_network(), DrivenPath()
    if start is not None:
        start_from(network, pd.load_predictor(start))
    top_rate = 1.2e-3 if start is None else 7e-4
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-3)
    average = torch.optim.swa_utils.AveragedModel(
        network, multi_avg_fn=torch.optim.swa_utils.get_ema_multi_avg_fn(0.999)
    )
    flip, flip_target = mirror_signs()
    order = np.random.default_rng(seed)
    inputs, now, target = (torch.from_numpy(part) for part in (data.inputs, data.contexts, data.targets))
    begun, steps, running, reported = time.perf_counter(), 0, 0.0, 0.0
    while (spent := (time.perf_counter() - begun) / (60.0 * minutes)) < 1.0:
        for group in optimiser.param_groups:
            group["lr"] = 1e-5 + top_rate * min(1.0, steps / 500) * 0.5 * (1.0 + math.cos(math.pi * spent))
        rows = torch.from_numpy(order.integers(0, len(inputs), BATCH))
        x, n, y = inputs[rows], now[rows, :3], target[rows]
        if steps % 2:
            x, n, y = x * flip, n * torch.tensor([1.0, -1.0, 1.0]), y * flip_target
        outputs = network(x)
        loss = loss_of(path(n, outputs), outputs, y)
        if not torch.isfinite(loss):
            raise RuntimeError(f"the predictor's loss is {loss.item()} after {steps} steps: nothing was written")
        optimiser.zero_grad()
        loss.backward()
        nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        average.update_parameters(network)
        steps, running = steps + 1, 0.99 * running + 0.01 * loss.item() if steps else loss.item()
        if spent - reported > 0.1:
            reported = spent
            print(f"{spent:.0%} {steps} steps, loss {running:.4f}", flush=True)
    final = average.module
    assert isinstance(final, nn.Sequential)
    found = errors(final, path, held)
    print(report(found, held))
    note = f"policies.prediction.learned_training --minutes {minutes} --drives {drives} --seed {seed}"
    note += f"{' --start FILE' if start else ''}: {steps} steps of {BATCH}"
    pd.save_predictor(out, network_row(final), note)
    print(f"wrote {out}")


def main() -> None:
    """The command line of this module."""
    parser = argparse.ArgumentParser(description="train the motion predictor")
    parser.add_argument("--minutes", type=float, default=9.0)
    parser.add_argument("--drives", type=int, default=30_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, default=pd.CHECKPOINT)
    parser.add_argument("--start", type=Path, help="go on from this predictor")
    given = parser.parse_args()
    train(given.minutes, given.drives, given.seed, given.out, given.start)


if __name__ == "__main__":
    main()
