"""Training runs: recipe in, curve, checkpoints and a flyable ONNX file out.

    run("state", "imitate", seed=1, out_dir=Path("training_runs/a"))            # from nothing
    run("vision", "watch", seed=1, out_dir=..., parent=Path("training_runs/a"))  # from a trained actor
    run("state", "imitate", seed=1, out_dir=Path("training_runs/a"), resume=True)

A checkpoint is written at least each minute and after each phase; a run that is killed and resumed gives the curve of
one that was not. `perch-hil policy train` is the same on the command line, `torchrun -m hil policy train` in several
processes.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import torch

from policies.evaluation.plot import learning_curve
from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.widen import widened
from policies.training.actor import POLICY, keep_actor, load_actor
from policies.training.learners import parallel
from policies.training.learners.dagger import Dagger, DaggerConfig
from policies.training.learners.layer_fit import LayerFit, LayerFitConfig
from policies.training.learners.pgpe import Pgpe, PgpeConfig
from policies.training.learners.ppo import Ppo, PpoConfig
from policies.training.learners.storage import (
    Curve,
    DivergedError,
    TrainingError,
    bad_weights,
    load_checkpoint,
    not_finite,
    save_checkpoint,
)
from policies.training.recipe import Recipe, load_recipe

CHECKPOINT, CURVE, PICTURE, LOG = "checkpoint.pt", "curve.csv", "curve.svg", "log.txt"
SAVE_EVERY = 50.0  # s

_LEARNERS = {DaggerConfig: Dagger, PpoConfig: Ppo, PgpeConfig: Pgpe, LayerFitConfig: LayerFit}

Learner = Dagger | Ppo | Pgpe | LayerFit
Progress = Callable[[dict], None]


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

    Raises RecipeError for a bad recipe, TrainingError for a device, parent or checkpoint that is not there or does not
    fit, DivergedError for a number that is not finite (the last good checkpoint stays).
    """
    plan = recipe if isinstance(recipe, Recipe) else load_recipe(recipe)
    rank, world, device = parallel.start(device)
    if device == "cpu":
        torch.set_num_threads(1)
    path = out_dir / (CHECKPOINT if world == 1 else f"checkpoint-{rank}.pt")
    saved = _checkpoint(path, plan, stage, seed) if resume else None
    network = plan.network_config()
    actor, ancestor = (None, {}) if parent is None else load_actor(parent)
    if actor is not None and actor.config != network:
        try:
            actor = widened(actor, network)
        except ValueError as error:
            reason = f"{parent} holds another network than recipe {plan.name} asks for"
            raise TrainingError(f"{reason}: {error}") from None
    base, start, total = int(ancestor.get("samples", 0)), 0, None
    if saved is not None:
        base, start, total = saved["before"], saved["phase"], saved["total"]
        ancestor = saved.get("ancestor", ancestor)
        actor = _actor(network, saved["actor"])
    curve = Curve(out_dir / CURVE, total) if rank == 0 else None
    begun = time.monotonic()
    for index in range(start, len(plan.phase)):
        phase = plan.phase[index]
        env = plan.env_config(stage, seed, phase)
        settings = plan.phase_config(phase)
        first = None if actor is None else {k: v.clone() for k, v in actor.state_dict().items()}
        kind = _LEARNERS[type(settings)]
        learner = kind(replace(env, seed=seed * 1000 + rank), network, settings, device, actor)  # type: ignore[arg-type]
        if saved is not None:
            _continue(learner, saved, path)
            saved = None

        def save(learner=learner, index=index, first=first, base=base, env=env) -> None:
            total = base + learner.samples * world
            state = {"learner": learner.state(), "actor": first, "phase": index, "before": base, "ancestor": ancestor}
            keys = {"recipe": plan.model_dump(), "stage": stage, "seed": seed, "total": total}
            save_checkpoint(path, {**state, **keys}, agree=lambda: parallel.mean(1.0))
            if rank == 0:
                keep_actor(out_dir, plan, stage, seed, env, learner, total, ancestor)
                learning_curve(out_dir / CURVE, out_dir / PICTURE, f"{plan.title}, {stage}, seed {seed}")

        last = time.monotonic()
        while not learner.finished:
            numbers = {"phase": index, **_step(learner, path)}
            numbers["samples"] = base + numbers["samples"] * world
            if curve is not None:
                curve.add({"samples": numbers["samples"], "phase": index, "success": numbers["success"]})
                _log(out_dir, numbers)
            if progress is not None and rank == 0:
                progress({**numbers, "share": learner.samples / settings.samples, "seconds": time.monotonic() - begun})
            # all processes stop and save at the same iteration, whichever of them was asked to
            halt = parallel.mean(float(stop())) > 0.0
            if parallel.mean(float(time.monotonic() - last > SAVE_EVERY)) > 0.0 or halt:
                save()
                last = time.monotonic()
            if halt:
                return out_dir / POLICY
        save()
        base += learner.samples * world
        actor = _actor(network, {k: v.cpu() for k, v in learner.average.state_dict().items()})
    return out_dir / POLICY


def _checkpoint(path: Path, plan: Recipe, stage: str, seed: int) -> dict:
    """The checkpoint that this run goes on from. Raises TrainingError if it is another run's."""
    saved = load_checkpoint(path)
    if not {"recipe", "stage", "seed", "total", "phase", "before", "actor", "learner"} <= saved.keys():
        raise TrainingError(f"{path} is no checkpoint that a run can go on from")
    if (saved["recipe"], saved["stage"], saved["seed"]) != (plan.model_dump(), stage, seed):
        raise TrainingError(f"{path} belongs to another recipe, stage or seed; start again without --resume")
    if parallel.mean(float(saved["total"])) != float(saved["total"]):
        raise TrainingError(f"{path} and those of the other processes are of different moments; start again")
    return saved


def _continue(learner: Learner, saved: dict, path: Path) -> None:
    """Put a checkpoint's state into a new learner. Raises TrainingError if it does not fit."""
    try:
        learner.load(saved["learner"])
    except (KeyError, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise TrainingError(f"{path} does not fit this version or these settings ({reason}); start again") from None


def _actor(network: NetworkConfig, weights: dict | None) -> Actor | None:
    if weights is None:
        return None
    actor = Actor(network)
    actor.load_state_dict(weights)
    return actor


def _step(learner: Learner, path: Path) -> dict[str, float]:
    """One iteration. Raises DivergedError that names what is not finite: nothing of that kind is ever saved."""
    reason = "the learning step left weights that are not finite"
    try:
        numbers = learner.step()
        if not bad_weights(learner):
            return numbers
    except (TrainingError, ValueError) as error:
        if isinstance(error, ValueError) and not not_finite(learner):
            raise
        reason = str(error).partition(";")[0]
    found = not_finite(learner)
    kept = f"the last good checkpoint is kept in {path}" if path.exists() else "there was no checkpoint yet"
    raise DivergedError(f"{reason}{f' ({found})' if found else ''} after {learner.samples} samples; {kept}")


def _log(out_dir: Path, numbers: dict) -> None:
    """Everything an iteration reports, one line of text each."""
    with (out_dir / LOG).open("a") as file:
        file.write("  ".join(f"{k} {v:.5g}" for k, v in numbers.items()) + "\n")


if __name__ == "__main__":
    raise SystemExit("use `perch-hil policy train`; for several processes `torchrun ... -m hil policy train`")
