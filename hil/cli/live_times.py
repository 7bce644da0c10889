"""How a live run kept time, as lines of text."""

from __future__ import annotations

from typing import Any

from hil.live.latency import bars
from hil.live.load import load_line
from hil.live.run_clock import clock_lines


def live_lines(table: dict[str, Any]) -> list[str]:
    """How a live run kept time, as lines of text."""
    lines, latency = [], table["exposure_to_action"]
    if latency["count"]:
        part = table["of_it_exposure_and_transport_ms"]
        of_it = f", of it {part:g} ms exposure and transport of the simulated camera" if part else ""
        lines.append(
            f"exposure to action: p50 {latency['p50_ms']} ms, p90 {latency['p90_ms']}, p99 {latency['p99_ms']}, "
            f"max {latency['max_ms']} ({latency['count']} pictures{of_it})"
        )
        lines += bars(latency)
        seen, acted = latency["to_detection"], latency["then_to_action"]
        if seen["count"]:
            lines.append(
                f"of it to the detection: p50 {seen['p50_ms']} ms, p99 {seen['p99_ms']}; from there to the action: "
                f"p50 {acted['p50_ms']} ms, p99 {acted['p99_ms']}"
            )
    lines.append(load_line(table))
    for service, one in table["services"].items():
        for node, pace in one.get("nodes", {}).items():
            lost = sum(one.get("dropped", {}).values()) + sum(one.get("lost", {}).values())
            lines.append(
                f"{node:15s} {pace['steps']:6d} steps  {pace['late']:5d} late  {pace['missed']:5d} missed  worst "
                f"{pace['worst_ns'] / 1e6:7.1f} ms  {lost:4d} messages lost or dropped by {service}"
            )
        lines += clock_lines(service, one.get("clock", {}))
    return lines + table["remarks"]
