"""The actor that a run leaves: its weights to train on from, and the ONNX file that flies, with where it comes from."""

from __future__ import annotations

from pathlib import Path

from policies.environment.config import EnvConfig
from policies.flying.contract import Contract, ObservationContract, Provenance
from policies.network.actor_critic import Actor, NetworkConfig, normalisation
from policies.network.export import export
from policies.training.import_onnx import import_actor
from policies.training.learners.storage import TrainingError, commit_id, load_checkpoint, save_checkpoint
from policies.training.recipe import Recipe
from vehicle.quadrotor.airframe import load_airframe

POLICY, ACTOR = "policy.onnx", "actor.pt"


def load_actor(path: Path) -> tuple[Actor, dict]:
    """The actor of a run (its folder or file) or of an exported policy, and its provenance. Raises TrainingError."""
    if path.suffix == ".onnx":
        return import_actor(path)
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
    """What a policy trained in `env` promises."""
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
    out_dir: Path, plan: Recipe, stage: str, seed: int, env: EnvConfig, learner, samples: int, ancestor: dict
):
    """The averaged actor as torch and as ONNX, with where it comes from."""
    origin = Provenance(
        recipe=plan.name,
        seed=seed,
        samples=samples,
        commit=commit_id(),
        parent=ancestor.get("name", ""),
    )
    name = f"{plan.name}-{stage}-{seed}"
    weights = {k: v.cpu() for k, v in learner.average.state_dict().items()}
    config = learner.actor.config
    origin_data = {**origin.model_dump(), "name": name, "stride": env.stride}
    save_checkpoint(out_dir / ACTOR, {"actor": weights, "network": config.data(), "provenance": origin_data})
    actor = Actor(config)
    actor.load_state_dict(weights)
    export(actor, contract_for(env, name, origin), out_dir / POLICY, learner.env.rows.observation)
