"""How long a picture takes to become an action, read from the recording of a run."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hil.messages import Action

BIN_MS = 5.0


def latencies_ns(messages: Iterable[tuple[int, str, Any]]) -> list[int]:
    """For every picture that moved an action: publication of the first action behind which it stands, less its
    exposure. `messages`: (log_ns, topic, message); others than policy/action are passed over."""
    newest, found = 0, []
    for log_ns, topic, message in messages:
        if topic != "policy/action":
            continue
        action: Action = message
        if action.exposure_ns > newest:
            newest = action.exposure_ns
            found.append(log_ns - action.exposure_ns)
    return found


def summary(samples_ns: list[int]) -> dict[str, Any]:
    """Counts, percentiles (ms) and a histogram of `BIN_MS` wide bins: lower edge (ms) -> count."""
    if not samples_ns:
        return {"count": 0}
    ordered = sorted(samples_ns)

    def percentile(share: float) -> float:
        return round(ordered[min(len(ordered) - 1, int(share * len(ordered)))] / 1e6, 2)

    bins: dict[str, int] = {}
    for value in ordered:
        edge = f"{int(value / 1e6 / BIN_MS) * BIN_MS:g}"
        bins[edge] = bins.get(edge, 0) + 1
    return {
        "count": len(ordered), "p50_ms": percentile(0.5), "p90_ms": percentile(0.9), "p99_ms": percentile(0.99),
        "max_ms": round(ordered[-1] / 1e6, 2), "histogram_ms": bins,
    }  # fmt: skip


def bars(table: dict[str, Any], width: int = 40) -> list[str]:
    """The histogram as lines of text."""
    bins: dict[str, int] = table.get("histogram_ms", {})
    most = max(bins.values(), default=0)
    return [
        f"{float(edge):6.0f} ms  {'#' * max(1, round(width * count / most)):{width}s} {count}"
        for edge, count in bins.items()
    ]
