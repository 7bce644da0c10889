"""Latency from exposure to action, computed from a run's recording."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

BIN_MS = 5.0
_PAUSE_NS = 50_000_000  # since the last action: the next one did not wait for a picture


class Latency(NamedTuple):
    """Latency of one picture, ns from mid-exposure: to the publication of its detection, and of the first action that
    used it. `detected_ns` is 0 if no detection was recorded."""

    detected_ns: int
    acted_ns: int


def latencies(messages: Iterable[tuple[int, str, Any]]) -> list[Latency]:
    """Latencies of all pictures that an action used. `messages`: (log_ns, topic, message) in the order of time; topics
    other than policy/action and board/detection are ignored.

    The first action, and the first after a pause, is left out: it waited until the policy got control of the vehicle.
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
    """The summary of the whole latency and of its two parts; the second includes the wait for the policy's tick."""
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
