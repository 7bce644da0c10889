"""Reads manifests and scores from disk: damaged entries are left out and named."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from hil.scoring.score import Metrics

_KINDS: dict[str, type] = {
    "identity": str, "state": str, "host": str, "seed": int, "policy": dict, "scenario": dict, "rig": dict,
    "code": dict, "packages": dict, "machine": dict, "wall_clock": dict,
}  # fmt: skip
_SCORE: dict[str, type] = {"attached": bool, "within_tolerance": bool, "outcome": str, "reasons": list, "metrics": dict}


def clean_manifest(manifest: Mapping[str, Any], notes: list[str]) -> dict[str, Any]:
    """The manifest without entries of the wrong kind; `notes` gets a line for each."""
    bad = [key for key, kind in _KINDS.items() if key in manifest and not isinstance(manifest[key], kind)]
    notes += [f"the manifest's {key!r} is damaged and was left out" for key in bad]
    return {key: value for key, value in manifest.items() if key not in bad}


def clean_score(score: Mapping[str, Any] | None, notes: list[str]) -> dict[str, Any] | None:
    """The score with every metric named (None where the file has none), or None and a note if it is damaged."""
    if score is None:
        return None
    bad = [key for key, kind in _SCORE.items() if not isinstance(score.get(key), kind)]
    metrics = {} if "metrics" in bad else {f.name: score["metrics"].get(f.name) for f in fields(Metrics)}
    bad += [f"metrics.{key}" for key, value in metrics.items() if not _measured(value)]
    if bad:
        notes.append(f"score.json is damaged ({', '.join(bad)}) and was left out")
        return None
    return {**score, "metrics": metrics}


def nested(table: Any, *keys: str) -> dict[str, Any]:
    """The table at `keys` in `table`, empty if there is none."""
    for key in keys:
        table = table.get(key) if isinstance(table, Mapping) else None
    return dict(table) if isinstance(table, Mapping) else {}


def board_known_by(rig: Any) -> str:
    """By what a flight knew the board: "pictures", "model" (of a camera) or "mocap"; "unknown" if the manifest's `rig`
    does not say."""
    if nested(rig, "policy").get("knows") == "mocap":
        return "mocap"
    return str(nested(rig, "camera").get("source", "unknown"))


def _measured(value: Any) -> bool:
    """None, a number, or a range of two."""
    if isinstance(value, list | tuple):
        return len(value) == 2 and all(isinstance(v, int | float) for v in value)
    return value is None or isinstance(value, int | float)
