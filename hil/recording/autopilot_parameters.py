"""The autopilot's parameters of a run: copied from its recording into its manifest, and compared with earlier runs."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from hil.contract.messages import VehicleParameters
from hil.recording.reader import ReadError, Recording
from hil.recording.recorder import PREFIX
from hil.recording.runs import Run, RunError, list_runs
from vehicle.px4.driver.arming import same_value
from vehicle.px4.sim.params import DEFAULTS

TOPIC, TABLE = "vehicle/parameters", "autopilot"
BASE = "PX4 v1.17, simulated quadrotor"  # whose defaults are known here


class Change(NamedTuple):
    """One parameter and what it is compared with; None where there is none."""

    name: str
    value: float | None
    other: float | None


def note_parameters(run: Run) -> None:
    """Put what the run's recording holds of the autopilot's parameters into its manifest; without any, nothing."""
    try:
        recording = Recording(run.recording)
        if PREFIX + TOPIC in recording.topics:
            held = latest(message for _, _, message in recording.messages([TOPIC]))
            run.add({TABLE: table(held)})
    except (ReadError, OSError):
        return  # a recording that cannot be read, and a full disk, are reported elsewhere


def latest(messages: Iterable[VehicleParameters]) -> dict[str, float]:
    """Values by name, the last reported ones."""
    held: dict[str, float] = {}
    for message in messages:
        held.update(zip(message.names, message.values, strict=False))
    return held


def table(held: Mapping[str, float]) -> dict[str, Any]:
    """The manifest's table: all values, and the defaults of those that differ. What is not finite is left out."""
    finite = {name: _tidy(value) for name, value in sorted(held.items()) if math.isfinite(value)}
    return {"parameters": finite, "not_default": {c.name: c.other for c in not_default(finite)}, "defaults_of": BASE}


def not_default(held: Mapping[str, float]) -> list[Change]:
    """Parameters that differ from PX4's defaults, or that it does not have, by name."""
    return [Change(name, value, other) for name, value, other in changes(held, _defaults()) if name in held]


def changes(held: Mapping[str, float], before: Mapping[str, float]) -> list[Change]:
    """Parameters of `held` whose value in `before` is another, or missing, and those that are only in `before`."""
    names = sorted({*held, *before})
    found = (Change(name, held.get(name), before.get(name)) for name in names)
    return [c for c in found if c.value is None or c.other is None or not same_value(c.value, c.other)]


def of_run(manifest: Mapping[str, Any]) -> dict[str, float]:
    """The parameters in a manifest; empty if it has none or its table is damaged."""
    found = manifest.get(TABLE)
    values = found.get("parameters") if isinstance(found, Mapping) else None
    if not isinstance(values, Mapping):
        return {}
    return {str(k): float(v) for k, v in values.items() if isinstance(v, int | float) and not isinstance(v, bool)}


def last_flight(root: Path, rig: str) -> tuple[Run, dict[str, float]] | None:
    """The newest run under `root` of the rig called `rig` whose manifest holds parameters, and these."""
    for run in reversed(list_runs(root)):
        try:
            manifest = run.manifest
        except RunError:
            continue
        about = manifest.get("rig")
        held = of_run(manifest)
        if held and isinstance(about, dict) and about.get("name") == rig:
            return run, held
    return None


def _tidy(value: float) -> float:
    """Without the digits that a number in single precision does not have; a whole number as one."""
    return int(value) if value == int(value) else float(f"{value:.7g}")


@cache
def _defaults() -> dict[str, float]:
    return json.loads(DEFAULTS.read_text(encoding="utf-8"))
