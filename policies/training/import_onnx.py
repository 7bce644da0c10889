"""The actor inside an exported policy, to train on from a file that flies where its torch weights are not at hand.

What only training used is not in the file: the head that foretells the board, and the exploration noise, begin anew,
from the same numbers each time, so that a training run is repeated by its seed.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import onnx
import torch
from onnx import numpy_helper
from torch import Tensor

from policies.flying.contract import ContractError, check_contract, open_policy
from policies.network.actor_critic import Actor, FlightActor, NetworkConfig
from policies.network.export import compare
from policies.network.regimes import REGIMES
from policies.training.learners.storage import TrainingError

_PREFIX = "actor."
_SAME = 1e-3  # of actions on random observations; on such, rounding alone may differ by a tenth of it
_TCN = tuple(f"trunk.tcn.{name}.weight" for name in ("first", "second"))


def import_actor(path: Path) -> tuple[Actor, dict]:
    """The actor of a policy exported by `export`, and where it comes from.

    Raises TrainingError for a file that could not be flown, or that holds another network (one without `geometry` too).
    """
    try:
        _, contract = open_policy(path)
        check_contract(contract)
    except ContractError as error:
        raise TrainingError(str(error)) from None
    origin = {**contract.provenance.model_dump(), "name": contract.name, "stride": contract.observation.stride}
    weights = _weights(onnx.load(path))
    try:
        config = _config(weights)
        for mirrored in (False, True):
            with torch.random.fork_rng(devices=[]):
                torch.manual_seed(0)
                actor = Actor(replace(config, mirrored=mirrored))
            actor.load_state_dict({**actor.state_dict(), **weights})
            if compare(FlightActor(actor), path) <= _SAME:
                return actor, origin
    except (KeyError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise TrainingError(f"{path} holds a network that this version does not know ({reason})") from None
    raise TrainingError(f"{path} holds another network than its weights tell")


def _weights(model: onnx.ModelProto) -> dict[str, Tensor]:
    """Weights by the actor's own names.

    The exporter keeps these, except of layers that act on more than two axes: their weights, transposed, are the
    nameless inputs of its matrix products.
    """
    arrays = {each.name: torch.from_numpy(numpy_helper.to_array(each).copy()) for each in model.graph.initializer}
    named = {name.removeprefix(_PREFIX): array for name, array in arrays.items() if name.startswith(_PREFIX)}
    products = [node.input[1] for node in model.graph.node if node.op_type == "MatMul" and node.input[1] in arrays]
    return named | {name: arrays[product].T.contiguous() for name, product in zip(_TCN, products, strict=False)}


def _config(weights: dict[str, Tensor]) -> NetworkConfig:
    """Sizes that the weights have, how it leans and touches, whether it has regimes. Raises KeyError if one misses."""
    width = len(weights["trunk.first.bias"])
    kind: dict[str, Any] = {"aligned": "lean" in weights, "regimes": len(weights["head.bias"]) == 4 * REGIMES}
    kind |= {name: round(float(weights[name]), 6) for name in ("lean", "lean_unsure", "soft") if name in weights}
    temporal = "trunk.tcn.third.bias" in weights
    if not temporal:
        return NetworkConfig(temporal=False, width=width, **kind)
    a, b, c = (len(weights[f"trunk.tcn.{name}.bias"]) for name in ("first", "second", "third"))
    return NetworkConfig(channels=(a, b, c), width=width, **kind)
