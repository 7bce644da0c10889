"""Flights with faults, counted by class: what breaks, in which scenario, and how the flight then ended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hil.campaign.lines import Line
from hil.recording.manifest import clean_manifest, nested
from hil.recording.runs import Run, RunError
from hil.scoring.flight_class import CLASSES


@dataclass(frozen=True)
class Classified:
    """One flight with a fault. `counts`: the fault happened, and the flight has a class."""

    name: str
    fault: str
    scenario: str
    policy: str
    camera: str
    seed: int
    flight_class: str
    why: tuple[str, ...]
    counts: bool


def classified(runs: Sequence[Run]) -> list[Classified]:
    """Every flight of `runs` whose scenario has faults. An unreadable run is none."""
    found = []
    for run in runs:
        try:
            manifest, score = clean_manifest(run.manifest, []), run.score or {}
        except RunError:
            continue
        group = Line(run.path.name, manifest, score).group
        flight = nested(score, "flight")
        if not group.fault or manifest.get("state") in ("running", "interrupted"):
            continue
        known = flight.get("class") in CLASSES
        found.append(
            Classified(
                run.path.name, group.fault, group.scenario, group.policy, group.camera, int(manifest.get("seed", 0)),
                str(flight["class"]) if known else "", tuple(map(str, flight.get("why", ()))),
                known and not flight.get("not_begun"),
            )
        )  # fmt: skip
    return found


def counts(flights: Sequence[Classified]) -> list[dict[str, Any]]:
    """A row for each fault, scenario and policy: how many flights of each class, and how many do not count."""
    rows: dict[tuple[str, str, str], dict[str, Any]] = {}
    for flight in flights:
        key = (flight.fault, flight.scenario, flight.policy)
        named = dict(zip(("fault", "scenario", "policy"), key, strict=True))
        row = rows.setdefault(key, {**named, **dict.fromkeys((*CLASSES, "not counted"), 0)})
        row[flight.flight_class if flight.counts else "not counted"] += 1
    return [rows[key] for key in sorted(rows)]
