"""Body rates and thrust: requested by the policy, changed by guidance, sent by the gate, achieved by the vehicle."""

from __future__ import annotations

from typing import Any

import numpy as np
from markupsafe import Markup

from hil.recording.manifest import nested
from hil.report.drawing.charts import ASKED, BAD, BOARD, SEEN, VEHICLE, TimePlot
from hil.report.drawing.section import Section, table
from hil.report.recorded.columns import Columns
from hil.report.recorded.flight import Recorded
from hil.report.recorded.geometry import specific_thrust
from policies.guidance.guide import LAWS, NOT_FINITE


def build(recorded: Recorded) -> Section:
    section = Section("commands", "Commands: asked, sent, achieved")
    asked = (
        recorded.topics.get("policy/action")
        if section.needs(recorded, "commands asked by the policy", "policy/action")
        else None
    )
    sent = (
        recorded.topics.get("vehicle/sent")
        if section.needs(recorded, "commands sent after the gate", "vehicle/sent")
        else None
    )
    achieved = recorded.topics.get(recorded.vehicle_source)
    if achieved is None:
        section.lost.append(
            ("achieved body rates and thrust", "no messages on truth/vehicle, mocap/vehicle or vehicle/odometry")
        )
    if asked is None and sent is None:
        return section
    limits = nested(recorded.manifest, "rig", "gate")
    thrust = limits.get("thrust")
    low, high = thrust if isinstance(thrust, list) and len(thrust) == 2 else (None, None)
    for axis, name in enumerate(("roll rate p", "pitch rate q", "yaw rate r")):
        plot = TimePlot(f"rate-{axis}", f"Body {name}", "rad/s", height=120)
        _both(plot, recorded, asked, sent, "body_rate", "asked_rate", axis)
        if achieved is not None:
            plot.add("achieved", BOARD, achieved.nanoseconds(), achieved["body_rate"][:, axis])
        _limits(plot, limits.get("rate"))
        _keep(plot, recorded, limits.get("rate"))
        section.plot(plot)
    plot = TimePlot("thrust", "Mass-normalised collective thrust", "m/s²", height=140)
    _both(plot, recorded, asked, sent, "thrust", "asked_thrust")
    if recorded.vehicle is not None:
        t, achieved = recorded.vehicle.t, specific_thrust(recorded.vehicle)
        if recorded.decided_ns:  # what the impact does to the velocity is no thrust
            achieved = np.where(t <= recorded.decided_ns, achieved, np.nan)
        plot.add("achieved, from velocity", BOARD, t, achieved)
    plot.lines += [(float(v), f"gate, {side}") for v, side in ((low, "least"), (high, "most")) if v is not None]
    _keep(plot, recorded, high, low=0.0)
    section.plot(plot)
    if recorded.decided_ns and asked is not None and (asked.nanoseconds() > recorded.decided_ns).any():
        section.html(
            Markup('<p class="small">The policy goes on after the verdict; its commands are not sent any more.</p>')
        )
    if sent is not None:
        _counts(section, recorded, asked, sent)
    return section


def _both(
    plot: TimePlot, recorded: Recorded, asked: Columns | None, sent: Columns | None,
    name: str, unguided: str, axis: int | None = None,
) -> None:  # fmt: skip
    def values(columns: Columns, field: str = name) -> np.ndarray:
        return columns[field] if axis is None else columns[field][:, axis]

    if asked is not None:
        engaged_rows = asked["engaged"] > 0
        if recorded.decided_ns:
            engaged_rows &= asked.nanoseconds() <= recorded.decided_ns
        by_policy = np.where(_guided(asked), values(asked, unguided), values(asked))
        plot.add("asked", ASKED, asked.nanoseconds(), np.where(engaged_rows, by_policy, np.nan), "dash")
        changed = engaged_rows & (values(asked) != by_policy)
        if changed.any():
            plot.add("changed by guidance", SEEN, asked.nanoseconds()[changed], values(asked)[changed], "dots")
    if sent is not None:
        went = sent["tripped"] == ""
        plot.add("sent", VEHICLE, sent.nanoseconds(), np.where(went, values(sent), np.nan), "step")
        limited = sent["limited"] > 0
        if limited.any():
            plot.add("limited by the gate", BAD, sent.nanoseconds()[limited], values(sent)[limited], "dots")


def _guided(asked: Columns) -> np.ndarray:
    """Which actions passed through guidance: they also hold the policy's request."""
    return asked["asked_thrust"] > 0.0


def _limits(plot: TimePlot, rate: Any) -> None:
    if isinstance(rate, int | float):
        plot.lines += [(float(rate), "gate"), (-float(rate), "")]


def _keep(plot: TimePlot, recorded: Recorded, limit: Any, low: float | None = None) -> None:
    """The impact is a spike far beyond every command: leave the axis at what was flown before it."""
    end = recorded.decided_ns or recorded.window_ns[1]
    start = recorded.window_ns[0]
    flown = [s.y[(s.t >= start) & (s.t < end - 20_000_000)] for s in plot.series]
    values = np.concatenate([y[np.isfinite(y)] for y in flown]) if flown else np.empty(0)
    if not len(values):
        return
    bottom, top = float(values.min()), float(values.max())
    if isinstance(limit, int | float):
        top = max(top, min(float(limit), 1.3 * top))
    room = 0.06 * max(top - bottom, 0.5)
    plot.fixed = (bottom - room if low is None else min(low, bottom), top + room)


def _counts(section: Section, recorded: Recorded, asked: Columns | None, sent: Columns) -> None:
    chosen = recorded.during(sent.nanoseconds())
    went = chosen & (sent["tripped"] == "")
    trips = [sent.messages[i] for i in np.flatnonzero(sent["tripped"] != "").tolist()]
    rows: list[tuple[object, ...]] = [
        ("commands sent during the attempt", int(went.sum())),
        ("of them limited by the gate", int((sent["limited"][went] > 0).sum())),
    ]
    rows += _laws(recorded, asked) if asked is not None and _guided(asked).any() else []
    rows += [(f"gate tripped at {recorded.seconds(m.stamp_ns):.3f} s", m.tripped) for m in trips]
    if not trips:
        rows.append(("gate trips", "none"))
    section.html(table(("", ""), rows, "narrow"))


def _laws(recorded: Recorded, asked: Columns) -> list[tuple[object, ...]]:
    """How many actions of the attempt each law of guidance changed."""
    laws = asked["laws"].astype(int)[np.asarray(recorded.during(asked.nanoseconds()), dtype=bool)]
    names = {**LAWS, NOT_FINITE: "guidance left out: a number was not finite"}
    counts = {name: int((laws & bit > 0).sum()) for bit, name in names.items()}
    return [(name, count) for name, count in counts.items() if count or "left out" not in name]
