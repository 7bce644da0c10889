"""Training runs: recipe in, curve, checkpoints and a flyable ONNX file out.

    run("state", "imitate", seed=1, out_dir=Path("training_runs/a"))            # from nothing
    run("vision", "imitate", seed=1, out_dir=..., parent=Path(".../state.pt"))  # from a trained actor
    run("state", "imitate", seed=1, out_dir=Path("training_runs/a"), resume=True)

A checkpoint is written at least each minute and after each phase; a run that is killed and resumed gives the curve of
one that was not. `python -m policies.train --help` is the same on the command line, and what torchrun starts.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch

from policies import train_parallel as parallel
from policies.contract import CameraContract, Contract, ContractError, ObservationContract, Provenance
from policies.dagger import Dagger, DaggerConfig
from policies.env_config import EnvConfig
from policies.export import export
from policies.network import Actor, NetworkConfig, normalisation
from policies.ppo import Ppo
from policies.train_io import Curve, TrainingError, commit_id, load_checkpoint, save_checkpoint
from policies.train_plot import learning_curve
from policies.train_recipe import Recipe, RecipeError, load_recipe
from vehicle.airframe import load_airframe

CHECKPOINT, CURVE, PICTURE, POLICY, ACTOR = "checkpoint.pt", "curve.csv", "curve.svg", "policy.onnx", "actor.pt"
SAVE_EVERY = 50.0  # s

Progress = Callable[[dict], None]


def load_actor(path: Path) -> tuple[Actor, dict]:
    """An actor saved by a run, and its provenance. Raises TrainingError."""
    data = load_checkpoint(path)
    if not {"actor", "network", "provenance"} <= data.keys():
        raise TrainingError(f"{path} is not an actor of a training run; give the {ACTOR} of its folder")
    actor = Actor(NetworkConfig.of(data["network"]))
    actor.load_state_dict(data["actor"])
    return actor, data["provenance"]


def contract_for(env: EnvConfig, name: str, provenance: Provenance) -> Contract:
    """What a policy trained in `env` promises."""
    mount = load_airframe(env.airframe).camera
    shift, scale = normalisation()
    return Contract(
        name=name,
        stage=env.stage,  # type: ignore[arg-type]
        airframe=env.airframe,
        observation=ObservationContract(stride=env.stride),
        camera=CameraContract(offset=mount.offset, tilt=round(mount.tilt_deg * 0.017453292519943295, 12)),
        provenance=provenance,
        shift=shift,
        scale=scale,
    )


def run(
    stage: str,
    recipe: str | Recipe,
    seed: int,
    out_dir: Path,
    resume: bool = False,
    device: str = "cpu",
    parent: Path | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Path:
    """Train and export. Returns the ONNX file; `stop` is asked after each iteration and ends the run early, resumable.

    Raises RecipeError for a bad recipe, TrainingError for a device that is not there, a damaged checkpoint or a number
    that is not finite (the last good checkpoint stays).
    """
    plan = recipe if isinstance(recipe, Recipe) else load_recipe(recipe)
    rank, world, device = parallel.start(device)
    torch.set_num_threads(1) if device == "cpu" else None
    path = out_dir / CHECKPOINT if world == 1 else out_dir / f"checkpoint-{rank}.pt"
    saved = load_checkpoint(path) if resume else None
    if saved is not None and (saved["recipe"], saved["stage"], saved["seed"]) != (plan.model_dump(), stage, seed):
        raise TrainingError(f"{path} belongs to another recipe, stage or seed; start again without --resume")
    curve = Curve(out_dir / CURVE, saved["total"] if saved else None) if rank == 0 else None
    actor, ancestor = (None, {}) if parent is None else load_actor(parent)
    start = saved["phase"] if saved else 0
    before = saved["before"] if saved else int(ancestor.get("samples", 0))
    base = before
    if saved is not None and saved["actor"] is not None:
        actor = Actor(plan.network_config())
        actor.load_state_dict(saved["actor"])
    begun = time.monotonic()
    for index in range(start, len(plan.phase)):
        phase = plan.phase[index]
        env = plan.env_config(stage, seed, phase)
        settings = plan.phase_config(phase)
        first_weights = None if actor is None else {k: v.clone() for k, v in actor.state_dict().items()}
        kind = Dagger if isinstance(settings, DaggerConfig) else Ppo
        learner = kind(replace(env, seed=seed * 1000 + rank), plan.network_config(), settings, device, actor)  # type: ignore[arg-type]
        if saved is not None:
            learner.load(saved["learner"])
            saved = None

        def save(learner=learner, index=index, first=first_weights, base=base, env=env) -> None:
            state = {"learner": learner.state(), "actor": first, "phase": index, "before": base}
            keys = {"recipe": plan.model_dump(), "stage": stage, "seed": seed, "total": base + learner.samples * world}
            save_checkpoint(path, {**state, **keys})
            if rank == 0:
                _keep(out_dir, plan, stage, seed, env, learner, base + learner.samples * world, ancestor)

        last = time.monotonic()
        while not learner.finished:
            numbers = {"phase": index, **learner.step()}
            numbers["samples"] = base + numbers["samples"] * world
            if curve is not None:
                curve.add({"samples": numbers["samples"], "phase": index, "success": numbers["success"]})
                _log(out_dir, numbers)
            if progress is not None and rank == 0:
                done, whole = learner.samples, settings.samples
                progress({**numbers, "share": done / whole, "seconds": time.monotonic() - begun})
            halt = stop()
            if time.monotonic() - last > SAVE_EVERY or halt:
                save()
                last = time.monotonic()
            if halt:
                return out_dir / POLICY
        save()
        base += learner.samples * world
        actor = Actor(plan.network_config())
        actor.load_state_dict({k: v.cpu() for k, v in learner.average.state_dict().items()})
    if rank == 0:
        learning_curve(out_dir / CURVE, out_dir / PICTURE, f"{plan.title}, {stage}, seed {seed}")
    return out_dir / POLICY


def _log(out_dir: Path, numbers: dict) -> None:
    """Everything an iteration reports, one line of text each."""
    with (out_dir / "log.txt").open("a") as file:
        file.write("  ".join(f"{k} {v:.5g}" for k, v in numbers.items()) + "\n")


def _keep(out_dir: Path, plan: Recipe, stage: str, seed: int, env: EnvConfig, learner, samples: int, ancestor: dict):
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
    export(actor, contract_for(env, name, origin), out_dir / POLICY)
    learning_curve(out_dir / CURVE, out_dir / PICTURE, f"{plan.title}, {stage}, seed {seed}")


def main() -> int:
    """Command line; exits 1 with one line for anything that is wrong with what was asked."""
    parser = argparse.ArgumentParser(description="Train a perching policy.")
    parser.add_argument("--stage", choices=("state", "vision"), default="state")
    parser.add_argument("--recipe", default="imitate", help="name under policies/recipes, or a .toml file")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--parent", type=Path, help="actor.pt of another run to begin from")
    parser.add_argument("--device", default="cpu", help="cpu, cuda or cuda:N")
    parser.add_argument("--resume", action="store_true")
    options = parser.parse_args()
    shown = [0.0]

    def progress(numbers: dict) -> None:
        if time.monotonic() - shown[0] > 10.0:
            shown[0] = time.monotonic()
            text = " ".join(f"{k} {v:.4g}" for k, v in numbers.items() if isinstance(v, int | float))
            print(text, flush=True)

    try:
        path = run(
            options.stage,
            options.recipe,
            options.seed,
            options.out,
            options.resume,
            options.device,
            options.parent,
            progress,
        )
    except (RecipeError, TrainingError, ContractError, ValueError) as error:
        print(f"training stopped: {error}", file=sys.stderr)
        return 1
    print(path)
    return 0


if __name__ == "__main__":
    sys.exit(main())
