"""Torch weights to the ONNX file that flies, its contract in the metadata; and back, to train on."""

from __future__ import annotations

import io
import json
import warnings
from pathlib import Path

import numpy as np
import onnx
import torch
from onnx import numpy_helper

from policies.flying.contract import METADATA_KEY, Contract, ContractError, check_contract
from policies.flying.onnx_file import open_policy
from policies.flying.trial import recorded_observations
from policies.network.actor_critic import Actor, FlightActor, NetworkConfig
from policies.task.observation import OBS_DIM

NETWORK_KEY = "perch_hil_network"  # metadata: the network's configuration as JSON
_PREFIX = "actor."  # of the weights' names in the file
_SAME = 1e-3  # of actions, between a file and its own weights
MAX_BYTES = 2_000_000
# Of actions in [-1, 1]: the same sums in another order, in single precision. On 20,480 observations of episodes the
# plain networks, which this exporter wrote, differ by at most 0.8e-6, and the shipped vision.onnx by 3.8e-6.
TOLERANCE = 1e-5
_COMPARED = 256  # observations at most


def export(actor: Actor, contract: Contract, path: str | Path, observations: np.ndarray | None = None) -> float:
    """Write `path`, read it back and compare with torch; returns the largest difference (of actions in [-1, 1]).

    `observations` ((N, OBS_DIM) float32) are what they are compared on, by default the recorded ones.

    Raises ContractError if a weight is not finite, ONNX and torch disagree by more than TOLERANCE, or the file is over
    2 MB; the old file is kept then.
    """
    path = Path(path)
    if not all(bool(torch.isfinite(value).all()) for value in actor.state_dict().values()):
        raise ContractError(f"policy '{contract.name}' has weights that are not finite; {path} was not written")
    flight = FlightActor(actor).to("cpu").eval()
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter needing no further package is deprecated; torch is pinned
        torch.onnx.export(
            flight,
            (torch.zeros(1, OBS_DIM),),
            buffer,  # type: ignore[arg-type]  # any file object will do
            input_names=["observation"],
            output_names=["action"],
            opset_version=17,
            dynamic_axes={"observation": {0: "batch"}, "action": {0: "batch"}},
            dynamo=False,
        )
    model = onnx.load_from_string(buffer.getvalue())
    described = {METADATA_KEY: contract.model_dump_json(), NETWORK_KEY: json.dumps(actor.config.data())}
    onnx.helper.set_model_props(model, described)
    data = model.SerializeToString()
    if len(data) > MAX_BYTES:
        raise ContractError(
            f"policy '{contract.name}' takes {len(data)} bytes, more than {MAX_BYTES}; use a smaller network"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    trial = path.with_suffix(".tmp.onnx")
    trial.write_bytes(data)
    try:
        difference = compare(flight, trial, observations)
        if not difference <= TOLERANCE:
            raise ContractError(
                f"ONNX and torch differ by {difference:.2e}, more than {TOLERANCE}; {path} was not written"
            )
        trial.replace(path)
    finally:
        trial.unlink(missing_ok=True)
    return difference


def compare(flight: FlightActor, path: Path, observations: np.ndarray | None = None) -> float:
    """Largest difference of action between torch and the ONNX file on `observations`, as `export` takes them."""
    network = open_policy(path)
    observation = (recorded_observations() if observations is None else observations)[:_COMPARED]
    with torch.no_grad():
        wanted = flight(torch.from_numpy(observation)).numpy()
    got = np.concatenate([network.run(row[None]) for row in observation])
    return float(np.abs(got - wanted).max())


def import_actor(path: Path) -> tuple[Actor, Contract]:
    """The actor of a policy that `export` wrote, and its contract.

    What only training used is not in the file: the head that predicts the board, and the exploration noise, are
    initialised anew, with the same numbers each time, so that a training run is repeated by its seed.

    Raises ContractError for a file that could not be flown, or whose network this version cannot build.
    """
    network = open_policy(path)
    contract = network.contract
    check_contract(contract)
    described = network.session.get_modelmeta().custom_metadata_map.get(NETWORK_KEY)
    if described is None:
        raise ContractError(f"{path} does not describe its network: it can be a teacher, not a parent")
    arrays = {each.name: numpy_helper.to_array(each) for each in onnx.load(path).graph.initializer}
    weights = {k.removeprefix(_PREFIX): torch.tensor(v) for k, v in arrays.items() if k.startswith(_PREFIX)}
    try:
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(0)
            actor = Actor(NetworkConfig.of(json.loads(described)))
        actor.load_state_dict({**actor.state_dict(), **weights})
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise ContractError(f"{path} holds a network that this version does not know ({reason})") from None
    if not compare(FlightActor(actor), path) <= _SAME:
        raise ContractError(f"{path} computes something else than its weights tell")
    return actor, contract
