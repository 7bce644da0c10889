"""Timing of a live run as lines of text."""

from __future__ import annotations

from typing import Any

from hil.live.latency import bars
from hil.live.load import load_line
from hil.live.run_clock import clock_lines

_HEAD = "node             service         steps   late missed worst ms   lost"


def timing_lines(table: dict[str, Any]) -> list[str]:
    """The latency from exposure to action, the machine's load, a row for each node, clocks, remarks.

    `table`: summary of the live run. The rows are a table of at most 80 columns; `lost` counts a service's messages
    that were lost on their way to it or dropped by it, and stands at each of its nodes.
    """
    lines, latency = [], table["exposure_to_action"]
    if latency["count"]:
        part, seen, acted = table["of_it_exposure_and_transport_ms"], latency["to_detection"], latency["then_to_action"]
        what = "pictures" if seen["count"] else "measurements by motion capture"
        lines += [f"exposure to action, {latency['count']} {what}:", f"  {_percentiles(latency)}"]
        if part:
            lines.append(f"  of it {part:g} ms exposure and transport of the simulated camera")
        if seen["count"]:
            lines.append(f"  of it to the detection: p50 {seen['p50_ms']} ms, p99 {seen['p99_ms']} ms")
            lines.append(f"  from there to the action: p50 {acted['p50_ms']} ms, p99 {acted['p99_ms']} ms")
        lines += bars(latency)
    lines += [load_line(table), _HEAD]
    clocks = []
    for service, one in table["services"].items():
        lost = sum(one.get("dropped", {}).values()) + sum(one.get("lost", {}).values())
        for node, pace in one.get("nodes", {}).items():
            lines.append(
                f"{node:16s} {service:14s} {pace['steps']:6d} {pace['late']:6d} {pace['missed']:6d} "
                f"{pace['worst_ns'] / 1e6:8.1f} {lost:6d}"
            )
        clocks += clock_lines(service, one.get("clock", {}))
    return lines + clocks + table["remarks"]


def _percentiles(latency: dict[str, Any]) -> str:
    return " ".join(f"{name} {latency[f'{name}_ms']}" for name in ("p50", "p90", "p99", "max")) + " ms"
