"""Measures one experiment by the project's own commands, and keeps its data with what it was made from."""

from __future__ import annotations

import hashlib
import json
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

from hil.recording.runs import write_json
from hil.results.experiments import Experiment
from policies.flying.shipped import CHECKPOINTS

FLYING = ("campaign", "policy")  # commands that can fly on a cluster
DONE = (0, 1)  # a campaign or an evaluation that was carried out


class MeasureError(RuntimeError):
    """A command of an experiment did not end well; the message names it and its exit code."""


def files(experiment: Experiment) -> dict[str, str]:
    """sha256 of every shipped network that it flies or learns from, by its place in policies/checkpoints."""
    return {name: hashlib.sha256((CHECKPOINTS / name).read_bytes()).hexdigest() for name in experiment.networks}


def data_file(experiment: Experiment, results: Path) -> Path:
    """Where its data is kept."""
    return results / f"{experiment.name}.json"


def kept(experiment: Experiment, results: Path) -> dict[str, Any] | None:
    """Its data with what it was made from, or None if there is none that can be read."""
    try:
        found = json.loads(data_file(experiment, results).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return found if isinstance(found, dict) and "data" in found else None


def is_measured(experiment: Experiment, results: Path) -> bool:
    """True if its data was made by the same commands with the networks that ship now."""
    found = kept(experiment, results)
    return found is not None and (found["commands"], found["files"]) == (list(experiment.commands), files(experiment))


def measure(
    experiment: Experiment, results: Path, runs: Path, code: dict[str, Any], cluster: str | None = None
) -> None:
    """Run its commands and write its data into `results`; flights go to a folder of `runs`, and a training too, which
    goes on where it was stopped. `code`: a manifest's table; `cluster`: address of that on which its commands fly, None
    for this machine.

    What a command does not print on stdout, progress and errors, goes to this process's stderr. Raises MeasureError.
    """
    results.mkdir(parents=True, exist_ok=True)
    places = {"runs": str(runs / experiment.name), "results": str(results)}
    printed = ""
    for command in experiment.commands:
        words = shlex.split(command.format_map({name: shlex.quote(path) for name, path in places.items()}))
        if words[:2] == ["policy", "train"]:
            words += ["--resume"] if any((runs / experiment.name).glob("checkpoint*.pt")) else []
        elif cluster is not None and words[0] in FLYING:
            words += ["--cluster", cluster]
        done = subprocess.run([sys.executable, "-m", "hil", *words], stdout=subprocess.PIPE, text=True, check=False)
        if done.returncode not in DONE:
            raise MeasureError(f"perch-hil {shlex.join(words)}: exit code {done.returncode}")
        printed = done.stdout
    for name, path in places.items():  # the data is the same on every machine
        printed = printed.replace(path, f"{{{name}}}")
    try:
        data = json.loads(printed)
    except ValueError:
        raise MeasureError(f"perch-hil {experiment.commands[-1]}: printed no JSON") from None
    if experiment.keep:
        data = [{field: row[field] for field in experiment.keep} for row in data]
    made = {"commands": list(experiment.commands), "code": code, "files": files(experiment), "data": data}
    write_json(data_file(experiment, results), made)
