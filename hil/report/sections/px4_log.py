"""The autopilot's own log: what was read, how it lies on the run's clock, what PX4 said, parameters, failsafe flags."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from markupsafe import Markup

from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded
from hil.report.recorded.ulog import PX4Log
from hil.report.recorded.ulog_clock import LogClock

_MOST_TEXTS = 200
_ORDERED = ("emergency", "alert", "critical", "error", "warning")


def build(recorded: Recorded) -> Section:
    section = Section("px4-log", "PX4's own log")
    log, clock = recorded.log, recorded.log_clock
    if log is None or clock is None:
        return section
    section.html(table(("", ""), [*_facts(log, clock)], "left"))
    for fault in log.faults:
        section.html(Markup('<p class="lost">The log is not whole: {}.</p>').format(fault))
    if clock.trouble:
        section.html(Markup('<p class="lost">The log is not drawn over time: {}.</p>').format(clock.trouble))
    else:
        rows = _texts(recorded, log, clock)
        if rows:
            head = ("s from the attempt's start", "", "what PX4 logged")
            section.html(Markup("<details><summary>PX4's texts and events ({})</summary>{}</details>").format(
                len(rows), table(head, rows[:_MOST_TEXTS], "events")
            ))  # fmt: skip
        flags = _flags(recorded, log, clock)
        if flags:
            section.html(table(("failsafe flag or state", "from s", "to s"), flags, "left"))
    _parameters(section, log)
    return section


def _facts(log: PX4Log, clock: LogClock) -> Iterator[tuple[object, ...]]:
    seconds = (log.span_us[1] - log.span_us[0]) / 1e6
    yield "log", f"{log.path.name}: {log.path.stat().st_size / 1e6:.2f} MB, {seconds:.1f} s, {log.firmware}"
    yield "on the run's clock by", clock.source or "nothing"
    if clock.check is not None:
        offset, sigma, correlation = clock.check
        what = "body rates of log and run" if clock.source != "body rates" else "body rates, which are the only measure"
        yield what, f"{1e3 * offset:+.2f} ± {1e3 * sigma:.2f} ms apart (one sigma), correlation {correlation:.3f}"
    count, lost = log.dropouts
    yield "gaps in which PX4 could not write", f"{count}, {lost:.2f} s in all" if count else "none"


def _texts(recorded: Recorded, log: PX4Log, clock: LogClock) -> list[tuple[object, ...]]:
    if not log.texts:
        return []
    times = recorded.seconds(clock.run_ns(np.array([us for us, _, _ in log.texts])))
    return [
        (f"{t:.3f}", Markup('<span class="badge {}">{}</span>').format(_badge(level), level), text)
        for t, (_, level, text) in zip(times, log.texts, strict=True)
    ]


def _badge(level: str) -> str:
    return "error" if level in _ORDERED[:4] else "warning" if level == "warning" else "info"


def _flags(recorded: Recorded, log: PX4Log, clock: LogClock) -> list[tuple[object, ...]]:
    """Intervals in which a flag of failsafe_flags, or vehicle_status.failsafe, was set while armed."""
    rows: list[tuple[float, tuple[object, ...]]] = []
    armed = _armed(log)
    for topic, names in (("failsafe_flags", None), ("vehicle_status", ("failsafe",))):
        found = log.topics.get(topic)
        if found is None:
            continue
        times = recorded.seconds(clock.run_ns(found.us))
        inside = np.ones(len(found.us), bool) if armed is None else (found.us >= armed[0]) & (found.us <= armed[1])
        for name in names or [n for n in found.fields if n != "timestamp" and not n.startswith(("mode_req", "_"))]:
            set_ = (found[name] > 0) & inside
            edges = np.flatnonzero(np.diff(np.concatenate([[0], set_.astype(np.int8), [0]])))
            for start, end in edges.reshape(-1, 2).tolist():
                last = times[min(end, len(times) - 1)]
                rows.append((float(times[start]), (name, f"{times[start]:.2f}", f"{last:.2f}")))
    return [row for _, row in sorted(rows, key=lambda one: one[0])]


def _armed(log: PX4Log) -> tuple[int, int] | None:
    """First and last time at which PX4 was armed."""
    status = log.topics.get("vehicle_status")
    if status is None:
        return None
    at = np.flatnonzero(status["arming_state"] == 2)
    return (int(status.us[at[0]]), int(status.us[min(at[-1] + 1, len(status.us) - 1)])) if len(at) else None


def _parameters(section: Section, log: PX4Log) -> None:
    rows: list[tuple[object, ...]] = [
        (name, f"{value:.7g}", f"{default:.7g}") for name, (value, default) in sorted(log.not_default.items())
    ]
    rows += [(f"{name}, set at {us / 1e6:.1f} s of PX4's time", f"{value:.7g}", "") for us, name, value in log.changed]
    title = f"PX4's parameters that are not default ({len(rows)} of {len(log.parameters)})"
    inside = table(("parameter", "this log", "default"), rows, "left")
    section.html(Markup("<details><summary>{}</summary>{}</details>").format(title, inside))
