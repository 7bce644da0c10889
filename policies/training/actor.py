"""The actor that a run produces: its weights for further training, and the ONNX file that flies, with provenance."""

from __future__ import annotations

from pathlib import Path

from policies.environment.config import EnvConfig
from policies.flying.contract import Contract, ContractError, ObservationContract, Provenance
from policies.network.actor_critic import Actor, NetworkConfig, normalisation
from policies.network.export import export, import_actor
from policies.training.learners.learner import Learner
from policies.training.learners.storage import TrainingError, commit_id, load_checkpoint, save_checkpoint
from policies.training.recipe import Recipe
from vehicle.quadrotor.airframe import load_airframe

POLICY, ACTOR = "policy.onnx", "actor.pt"


def load_actor(path: Path) -> tuple[Actor, dict]:
    """The actor of a run (its folder or file) or of an exported policy, and its provenance. Raises TrainingError."""
    if path.suffix == ".onnx":
        try:
            actor, contract = import_actor(path)
        except ContractError as error:
            raise TrainingError(str(error)) from None
        return actor, {**contract.provenance.model_dump(), "name": contract.name}
    path = path / ACTOR if path.is_dir() else path
    data = load_checkpoint(path)
    if not {"actor", "network", "provenance"} <= data.keys():
        raise TrainingError(f"{path} is not an actor of a training run; give the {ACTOR} of its folder")
    try:
        actor = Actor(NetworkConfig.of(data["network"]))
        actor.load_state_dict(data["actor"])
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        reason = " ".join(str(error).split())[:120]
        raise TrainingError(f"{path} holds a network that this version does not know ({reason})") from None
    return actor, data["provenance"]


def contract_for(env: EnvConfig, name: str, provenance: Provenance) -> Contract:
    """The contract of a policy trained in `env`."""
    shift, scale = normalisation()
    return Contract.of(
        load_airframe(env.airframe),
        name=name,
        stage=env.stage,  # type: ignore[arg-type]
        observation=ObservationContract(stride=env.stride),
        guidance=env.guidance,
        provenance=provenance,
        shift=shift,
        scale=scale,
    )


def keep_actor(
    out_dir: Path, recipe: Recipe, seed: int, env: EnvConfig, learner: Learner, samples: int, ancestor: dict
) -> None:
    """Write the averaged actor to `out_dir` as torch weights and as ONNX, with its provenance."""
    origin = Provenance(
        recipe=recipe.name, seed=seed, samples=samples, commit=commit_id(), parent=ancestor.get("name", "")
    )
    name = "-".join(dict.fromkeys((recipe.name, env.stage, Path(env.airframe).stem, str(seed))))
    weights = {k: v.cpu() for k, v in learner.average.state_dict().items()}
    config = learner.actor.config
    provenance = {**origin.model_dump(), "name": name}
    save_checkpoint(out_dir / ACTOR, {"actor": weights, "network": config.data(), "provenance": provenance})
    actor = Actor(config)
    actor.load_state_dict(weights)
    export(actor, contract_for(env, name, origin), out_dir / POLICY, learner.env.rows.observation)
