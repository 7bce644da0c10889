"""A trained actor made wider without changing what it computes (Net2Net; Chen, Goodfellow, Shlens 2016).

Each unit becomes several copies, and what the next layer takes from a unit it takes from its copies in unequal random
shares: equal ones would learn the same for ever. What a small network has learnt quickly a larger one goes on from.
"""

from __future__ import annotations

import torch
from torch import Tensor

from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.regimes import REGIMES
from policies.task import entry_row, tail_row

_TRUNK = ("trunk.first", "trunk.second")
_TCN = ("trunk.tcn.first", "trunk.tcn.second", "trunk.tcn.third")


def widened(actor: Actor, wanted: NetworkConfig, seed: int = 0) -> Actor:
    """A copy of `actor` with the sizes of `wanted`, mirrored, aligned, soft and with regimes as that says.

    Raises ValueError unless the sizes are whole multiples of its own, or if it would lose its regimes.
    """
    has = actor.config
    old, new = (*has.channels, has.width), (*wanted.channels, wanted.width)
    kind = (has.temporal, has.geometry), (wanted.temporal, wanted.geometry)
    if kind[0] != kind[1] or any(n % o for o, n in zip(old, new, strict=True)):
        raise ValueError(f"a network of {old} does not widen to one of {new}: give whole multiples, parts unchanged")
    if has.regimes and not wanted.regimes:
        raise ValueError("its last layer is one for each regime: say `regimes = true`")
    a, b, c, width = (n // o for o, n in zip(old, new, strict=True))
    random = torch.Generator().manual_seed(seed)
    weights = dict(actor.state_dict())
    if has.temporal:
        for layer, copies in zip(_TCN, (a, b, c), strict=True):
            _copy_units(weights, layer, copies)
        # A convolution whose kernel is its stride reads 2 and 3 steps, each with all units of the layer before.
        _share_inputs(weights, _TCN[1], 0, has.channels[0], 2, a, random)
        _share_inputs(weights, _TCN[2], 0, has.channels[1], 3, b, random)
        _share_inputs(weights, _TRUNK[0], entry_row.DIM + tail_row.DIM, has.channels[2], 1, c, random)
    for layer in _TRUNK:
        _copy_units(weights, layer, width)
    for layer in (_TRUNK[1], "head", "foresight"):
        _share_inputs(weights, layer, 0, has.width, 1, width, random)
    if wanted.regimes and not has.regimes:
        _copy_units(weights, "head", REGIMES)
    wider = Actor(wanted)
    for told in ("lean", "lean_unsure", "soft"):  # no weights that were learnt: `wanted` tells
        weights.pop(told, None)
    wider.load_state_dict({**wider.state_dict(), **weights})
    return wider


def _copy_units(weights: dict[str, Tensor], layer: str, copies: int) -> None:
    for part in ("weight", "bias"):
        weights[f"{layer}.{part}"] = torch.cat([weights[f"{layer}.{part}"]] * copies, 0)


def _share_inputs(
    weights: dict[str, Tensor], layer: str, start: int, size: int, steps: int, copies: int, random: torch.Generator
) -> None:
    """Spread the columns from `start` on, `steps` times `size` units, over the units' copies."""
    shares = torch.rand(copies, size, generator=random) + 0.5
    shares = shares / shares.sum(0)
    matrix = weights[f"{layer}.weight"]
    parts = [matrix[:, :start]]
    for step in range(steps):
        block = matrix[:, start + step * size : start + (step + 1) * size]
        parts += [block * share for share in shares]
    weights[f"{layer}.weight"] = torch.cat([*parts, matrix[:, start + steps * size :]], 1)
