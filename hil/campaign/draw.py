"""Real flights in a random order that is fixed before the first: a list, sealed by a digest."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hil.campaign.lines import Line
from kernel.random import next_uint64, stream
from kernel.toml_errors import ConfigError

FORMAT = 1


def draw_list(scenarios: Sequence[str], policies: Sequence[str], flights: int, rig: str, seed: int) -> dict[str, Any]:
    """`flights` of each scenario with each policy, in a random order, with the digest that seals them."""
    wanted = [{"scenario": s, "policy": p} for s in scenarios for p in policies for _ in range(flights)]
    rng = stream(seed, 0xD4A)
    order = sorted(range(len(wanted)), key=lambda _: int(next_uint64(rng)))
    listed = [{"number": number + 1, **wanted[place]} for number, place in enumerate(order)]
    content = {"format": FORMAT, "rig": rig, "seed": seed, "flights": listed}
    return {**content, "sha256": _digest(content)}


def read_list(path: Path) -> dict[str, Any]:
    """The sealed list at `path`. Raises ConfigError if it is none, or was changed after it was drawn."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        content = {key: value for key, value in found.items() if key != "sha256"}
        sealed = found["sha256"] == _digest(content) and isinstance(found["flights"], list)
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise ConfigError(f"{path}: is no list of `perch-hil campaign draw`: {error}") from None
    if not sealed:
        raise ConfigError(f"{path}: was changed after it was drawn: its digest does not fit")
    return found


def compare_list(listed: dict[str, Any], lines: Sequence[Line]) -> list[str]:
    """Remarks on the real flights of `lines` against the sealed list: how many were flown, and if in another order."""
    real = sorted((line for line in lines if line.group.identity == "real"), key=_started)
    flown = [(line.named("scenario"), line.named("policy")) for line in real]
    asked = [(one["scenario"], Path(one["policy"]).name) for one in listed["flights"]]
    remarks = [f"{len(flown)} of the {len(asked)} real flights of the sealed list {listed['sha256'][:12]} were flown."]
    if flown != asked[: len(flown)]:
        first = next(i for i, one in enumerate(flown) if i >= len(asked) or one != asked[i])
        remarks.append(f"They were not flown as it says: flight {first + 1} was {' with '.join(flown[first])}.")
    return remarks


def _started(line: Line) -> str:
    return str(line.manifest.get("wall_clock", {}).get("started_utc", ""))


def _digest(content: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()
