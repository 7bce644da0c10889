"""Training runs: recipe in, curve, checkpoints and a flyable ONNX file out.

    run(load_recipe("state"), "state", seed=1, out_dir=Path("training_runs/a"))              # from its teacher
    run(load_recipe("vision"), "vision", seed=1, out_dir=..., parent=Path("training_runs/a"))  # from a trained actor
    run(load_recipe("state"), "state", seed=1, out_dir=Path("training_runs/a"), resume=True)

A checkpoint is written at least each minute and after each phase; a run that is killed and resumed on the same device
gives the same curve as one without interruption. `perch-hil policy train` is the same on the command line.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import torch

from policies.environment.config import EnvConfig
from policies.evaluation.plot import learning_curve
from policies.network.actor_critic import Actor, NetworkConfig
from policies.training.actor import POLICY, keep_actor, load_actor
from policies.training.learners.dagger import Dagger, DaggerConfig
from policies.training.learners.device import open_device
from policies.training.learners.learner import Learner
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
from policies.training.recipe import Recipe

CHECKPOINT, CURVE, PICTURE, LOG = "checkpoint.pt", "curve.csv", "curve.svg", "log.txt"
CURVE_COLUMNS = ("samples", "phase", "success", "episodes", "rho")
SAVE_EVERY = 50.0  # s

Progress = Callable[[dict], None]


def run(
    recipe: Recipe,
    stage: str,
    seed: int,
    out_dir: Path,
    resume: bool = False,
    device: str = "cpu",
    parent: Path | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] = lambda: False,
) -> Path:
    """Train and export. Returns the ONNX file; `stop` is called after each iteration: True ends the run early.

    A run that has ended early can be resumed. Raises RecipeError for a bad recipe, TrainingError for a device, parent,
    airframe or checkpoint that is not there or does not fit, and for a device with too little memory, DivergedError for
    a number that is not finite (the last good checkpoint stays).
    """
    where, path, network = open_device(device), out_dir / CHECKPOINT, recipe.network_config()
    saved = _checkpoint(path, recipe, stage, seed) if resume else None
    actor, ancestor = (None, {}) if parent is None or saved else load_actor(parent)
    if actor is not None and actor.config != network:
        raise TrainingError(f"{parent} holds another network than recipe {recipe.name} asks for")
    base, start = int(ancestor.get("samples", 0)), 0
    if saved is not None:
        base, start, ancestor = saved["before"], saved["phase"], saved["ancestor"]
    curve = Curve(out_dir / CURVE, None if saved is None else saved["total"])
    begun = last = time.monotonic()
    for index in range(start, len(recipe.phase)):
        env = recipe.env_config(stage, seed * 1000, recipe.phase[index])
        settings = recipe.phase_config(recipe.phase[index])
        learner = _learner(settings, env, network, where, actor)
        if saved is not None:
            _continue(learner, saved, path)
            saved = None

        def save(learner: Learner = learner, index: int = index, base: int = base, env: EnvConfig = env) -> None:
            total = base + learner.samples
            state = {"learner": learner.state(), "phase": index, "before": base, "ancestor": ancestor}
            keys = {"recipe": recipe.model_dump(), "stage": stage, "seed": seed, "total": total}
            save_checkpoint(path, {**state, **keys})
            keep_actor(out_dir, recipe, seed, env, learner, total, ancestor)
            learning_curve(out_dir / CURVE, out_dir / PICTURE, f"{recipe.title}, {stage}, seed {seed}")

        while not learner.finished:
            numbers = {"phase": index, **_step(learner, path)}
            numbers["samples"] = base + numbers["samples"]
            seconds = time.monotonic() - begun
            curve.add({key: numbers[key] for key in CURVE_COLUMNS})
            _log(out_dir, {**numbers, "seconds": seconds})
            if progress is not None:
                progress({**numbers, "share": learner.samples / settings.samples, "seconds": seconds})
            halt = stop()
            if halt or time.monotonic() - last > SAVE_EVERY:
                save()
                last = time.monotonic()
            if halt:
                return out_dir / POLICY
        save()
        base += learner.samples
        actor = Actor(network)
        actor.load_state_dict({k: v.cpu() for k, v in learner.average.state_dict().items()})
    return out_dir / POLICY


def _learner(
    settings: DaggerConfig | PpoConfig,
    env: EnvConfig,
    network: NetworkConfig,
    device: torch.device,
    actor: Actor | None,
) -> Learner:
    """The learner of a phase. Raises TrainingError for buffers too large for the device, or an airframe not there."""
    kind = Dagger if isinstance(settings, DaggerConfig) else Ppo
    try:
        return kind(env, network, settings, device, actor)  # type: ignore[arg-type]
    except torch.OutOfMemoryError:
        raise TrainingError(f"{device} has too little memory for phase {kind.name}: {_LOWER[kind]}") from None
    except ValueError as error:
        raise TrainingError(str(error)) from None


_LOWER = {
    Dagger: "lower its setting replay or batch, or env.count",
    Ppo: "lower env.count, or its setting horizon or minibatch",
}


def _checkpoint(path: Path, recipe: Recipe, stage: str, seed: int) -> dict:
    """The checkpoint that this run goes on from. Raises TrainingError if it is another run's."""
    saved = load_checkpoint(path)
    if not {"recipe", "stage", "seed", "total", "phase", "before", "ancestor", "learner"} <= saved.keys():
        raise TrainingError(f"{path} is no checkpoint that a run can go on from")
    if (saved["recipe"], saved["stage"], saved["seed"]) != (recipe.model_dump(), stage, seed):
        raise TrainingError(f"{path} belongs to another recipe, airframe, stage or seed; start again without --resume")
    return saved


def _continue(learner: Learner, saved: dict, path: Path) -> None:
    """Put a checkpoint's state into a new learner. Raises TrainingError if it does not fit."""
    try:
        learner.load(saved["learner"])
    except (KeyError, RuntimeError, ValueError) as error:
        reason = " ".join(str(error).split())[:120]
        raise TrainingError(f"{path} does not fit this version or these settings ({reason}); start again") from None


def _step(learner: Learner, path: Path) -> dict[str, float]:
    """One iteration. Raises DivergedError that names what is not finite: nothing of that kind is ever saved."""
    reason = "the learning step left weights that are not finite"
    try:
        numbers = learner.step()
        if not bad_weights(learner):
            return numbers
    except torch.OutOfMemoryError:
        lower = _LOWER[type(learner)]  # type: ignore[index]
        raise TrainingError(f"the device ran out of memory in phase {learner.name}: {lower}") from None
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
