"""Storage of a training run: checkpoints that are replaced atomically, curves that continue, provenance."""

from __future__ import annotations

import csv
import os
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import torch

from policies.environment.env import Env, Tally
from policies.task.observation import LAYOUT_NAME, LAYOUT_VERSION
from policies.task.reward import TERMS

VERSION = (3, LAYOUT_NAME, LAYOUT_VERSION)  # of a checkpoint's own layout, and of what its network reads
_ARRAY = "numpy array"


class TrainingError(RuntimeError):
    """Training cannot go on; the message says why in one line."""


class DivergedError(TrainingError):
    """A number is not finite; the message names it."""


def env_state(env: Env) -> dict[str, np.ndarray]:
    """Copies of all rows of an environment."""
    return {name: array.copy() for name, array in env.rows._asdict().items()} | {"steps": np.array(env.steps)}


def load_env(env: Env, state: dict[str, np.ndarray]) -> None:
    """Inverse of `env_state`. Raises TrainingError if the checkpoint belongs to another environment."""
    for name, array in env.rows._asdict().items():
        if state[name].shape != array.shape:
            raise TrainingError(f"checkpoint has {name} {state[name].shape}, this run {array.shape}: other settings")
        array[:] = state[name]
    env.steps = int(state["steps"])
    env.tally = Tally()


def save_checkpoint(path: Path, data: dict[str, Any]) -> None:
    """Write so that a kill at any moment leaves either the old or the new file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    trial = path.with_suffix(".tmp")
    with trial.open("wb") as file:
        torch.save({"version": VERSION, **_packed(data)}, file)
        file.flush()
        os.fsync(file.fileno())
    trial.replace(path)


def load_checkpoint(path: Path) -> dict[str, Any]:
    """Read a checkpoint of this project and version: tensors and plain values, no code. Raises TrainingError in one
    line if it is anything else, or another user's."""
    try:
        file = path.open("rb")
    except FileNotFoundError:
        raise TrainingError(f"checkpoint {path} does not exist") from None
    except OSError as error:
        raise TrainingError(f"checkpoint {path} cannot be read: {error.strerror}") from None
    with file:
        owner = os.fstat(file.fileno()).st_uid
        if owner != os.geteuid():
            raise TrainingError(f"checkpoint {path} belongs to another user (uid {owner}); copy it to use it")
        try:
            data = torch.load(file, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises pickle, zip and runtime errors alike
            raise TrainingError(
                f"checkpoint {path} is damaged or of an older version ({type(error).__name__}); start again or use "
                "another"
            ) from None
    if not isinstance(data, dict):
        raise TrainingError(f"{path} is no checkpoint of a training run")
    version = data.get("version", (1,))
    if version != VERSION:
        has, here = (" ".join(map(str, numbers)) for numbers in (version, VERSION))
        raise TrainingError(f"checkpoint {path} is of version {has}, this is {here}; train again from the start")
    return _unpacked(data)


def _packed(data: Any) -> Any:
    """Arrays as tensors on the same memory: pickled as arrays, a replay would take several times its size to write."""
    if isinstance(data, dict):
        return {k: _packed(v) for k, v in data.items()}
    if isinstance(data, np.ndarray):
        return {_ARRAY: torch.from_numpy(data.copy() if data.ndim == 0 else np.ascontiguousarray(data))}
    return data


def _unpacked(data: Any) -> Any:
    """Inverse of `_packed`."""
    if not isinstance(data, dict):
        return data
    return data[_ARRAY].numpy() if _ARRAY in data else {k: _unpacked(v) for k, v in data.items()}


def bad_weights(learner: Any) -> list[str]:
    """Names of a learner's weights that are NaN or infinite."""
    networks = [k for k in ("actor", "critic") if hasattr(learner, k)]
    states = [(k, name, value) for k in networks for name, value in getattr(learner, k).state_dict().items()]
    return [f"{k}.{name}" for k, name, value in states if not bool(torch.isfinite(value).all())]


def not_finite(learner: Any) -> str:
    """Names of reward terms, environment rows and weights of a learner that are NaN or infinite; '' if none is."""
    rows = learner.env.rows
    terms = [name for name, column in zip(TERMS, rows.terms.T, strict=True) if not np.isfinite(column).all()]
    # a motion's row holds infinity where a change never comes
    numbers = {k: v for k, v in rows._asdict().items() if k not in ("terms", "reward", "motion", "rng", "done")}
    arrays = [k for k, v in numbers.items() if not np.isfinite(v).all()]
    parts = (("reward term", terms), ("environment", arrays), ("weights", bad_weights(learner)))
    return "; ".join(f"{what} {', '.join(names[:4])}" for what, names in parts if names)


def read_curve(path: Path) -> list[dict[str, float]]:
    """The lines of a run's curve, by column."""
    with path.open() as file:
        return [{k: float(v) for k, v in line.items()} for line in csv.DictReader(file)]


class Curve:
    """A CSV of one line an iteration. Lines after the checkpoint that a run resumes from are dropped."""

    def __init__(self, path: Path, resume_at: int | None) -> None:
        self._path, self._columns = path, []
        path.parent.mkdir(parents=True, exist_ok=True)
        if resume_at is None or not path.exists():
            path.unlink(missing_ok=True)
            return
        lines = read_curve(path)
        path.unlink()
        for line in lines:
            if line["samples"] <= resume_at:
                self.add(line)

    def add(self, line: dict[str, float]) -> None:
        """Append; the first line names the columns."""
        fresh = not self._path.exists()
        if fresh or not self._columns:
            self._columns = list(line)
        with self._path.open("a", newline="") as file:
            writer = csv.DictWriter(file, self._columns, extrasaction="ignore")
            if fresh:
                writer.writeheader()
            writer.writerow({k: f"{v:.6g}" if k != "samples" else int(v) for k, v in line.items()})


def commit_id() -> str:
    """Short hash of the checked-out commit, with + if files differ, or 'unknown'."""
    here = Path(__file__).parents[3]

    def git(*words: str) -> str:
        return subprocess.run(["git", *words], cwd=here, capture_output=True, text=True, check=True).stdout.strip()

    try:
        return git("rev-parse", "--short", "HEAD") + ("+" if git("status", "--porcelain", "--", ".") else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
