"""How long a picture takes to become an action, read from the recording of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

BIN_MS = 5.0
_PAUSE_NS = 50_000_000  # since the last action: the next one waited for something else than a picture


class Latency(NamedTuple):
    """One picture's way, ns from the middle of its exposure: to its detection published, to the first action behind
    which it stands published. `detected_ns` is 0 where no detection was recorded."""

    detected_ns: int
    acted_ns: int


def latencies(messages: Iterable[tuple[int, str, Any]]) -> list[Latency]:
    """Of every picture that moved an action. `messages`: (log_ns, topic, message) in the order of time; others than
    policy/action and board/detection are passed over.

    The first action, and the first after a pause, does not count: it waited to be handed the vehicle.
    """
    newest, found, acted_ns = 0, [], -_PAUSE_NS
    detected: dict[int, int] = {}  # exposure -> publication
    for log_ns, topic, message in messages:
        if topic == "board/detection":
            detected[message.stamp_ns] = log_ns
        elif topic == "policy/action":
            if message.exposure_ns > newest:
                newest = message.exposure_ns
                if log_ns - acted_ns < _PAUSE_NS:
                    found.append(Latency(detected.get(newest, newest) - newest, log_ns - newest))
            acted_ns = log_ns
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


def table(found: Sequence[Latency]) -> dict[str, Any]:
    """The summary of the whole way, and of its two parts: what a network waits for its next tick is in the second."""
    parts = [one for one in found if one.detected_ns]
    return summary([one.acted_ns for one in found]) | {
        "to_detection": _short(summary([one.detected_ns for one in parts])),
        "then_to_action": _short(summary([one.acted_ns - one.detected_ns for one in parts])),
    }


def _short(whole: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in whole.items() if key != "histogram_ms"}


def bars(table: dict[str, Any], width: int = 40) -> list[str]:
    """The histogram as lines of text."""
    bins: dict[str, int] = table.get("histogram_ms", {})
    most = max(bins.values(), default=0)
    return [
        f"{float(edge):6.0f} ms  {'#' * max(1, round(width * count / most)):{width}s} {count}"
        for edge, count in bins.items()
    ]
