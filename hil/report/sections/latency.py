"""Latency from exposure to the first action that used the picture, and its stages."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from hil.report.drawing.charts import BELIEF, SEEN, VEHICLE, TimePlot
from hil.report.drawing.section import Section, table
from hil.report.drawing.svg import histogram
from hil.report.recorded.columns import Columns
from hil.report.recorded.flight import Recorded


def build(recorded: Recorded) -> Section:
    section = Section("latency", "Latency, exposure to action")
    rows: list[tuple[object, ...]] = []
    if section.needs(recorded, "exposure to action, histogram and age of the newest picture", "policy/action"):
        actions = recorded.topics["policy/action"]
        delays = first_use_ms(recorded, actions)
        if len(delays):
            section.html(histogram(delays, name="exposure to first action that used it", unit="ms", colour=VEHICLE))
            rows.append(_row("exposure to action", delays))
        else:
            section.lost.append(("exposure to action, histogram", "no action used a new picture"))
        plot = TimePlot("age", "Age of the newest picture behind each action", "ms", height=120)
        exposure = actions.nanoseconds("exposure_ns")
        age = np.where(exposure > 0, (actions.log_ns - exposure) / 1e6, np.nan)
        plot.add("age", VEHICLE, actions.log_ns, age)
        section.plot(plot)
    if section.needs(recorded, "exposure to detection", "board/detection"):
        detections = recorded.topics["board/detection"]
        delay = (detections.log_ns - detections.nanoseconds()) / 1e6
        processing = detections["processing_ns"] / 1e6
        chosen = recorded.during(detections.nanoseconds())
        if chosen.any():
            rows.append(_row("exposure to detection", delay[chosen]))
            rows.append(_row("of it, processing the picture", processing[chosen]))
        plot = TimePlot("detection-latency", "Exposure to detection, and the processing in it", "ms", height=120)
        plot.add("exposure to detection", SEEN, detections.nanoseconds(), delay, "dots")
        plot.add("processing", BELIEF, detections.nanoseconds(), processing, "dots")
        section.plot(plot)
    if recorded.has("vehicle/odometry"):
        odometry = recorded.topics["vehicle/odometry"]
        chosen = recorded.during(odometry.nanoseconds())
        if chosen.any():
            rows.append(_row("age of odometry at arrival", ((odometry.log_ns - odometry.nanoseconds()) / 1e6)[chosen]))
    if rows:
        section.html(table(("during the attempt", "n", "median ms", "95 % ms", "99 % ms", "most ms"), rows, "narrow"))
    if recorded.manifest.get("host") == "lockstep":
        section.html(Markup('<p class="small">Lockstep host: these delays are the rig\'s model, not measurements.</p>'))
    return section


def first_use_ms(recorded: Recorded, actions: Columns) -> np.ndarray:
    """For each picture used in the attempt: ms from its exposure to the first action that used it.

    The picture behind the first action of all is left out: it waited for the attempt, not for the computer.
    """
    chosen = recorded.during(actions.log_ns)
    exposure, log = actions.nanoseconds("exposure_ns")[chosen], actions.log_ns[chosen]
    fresh = np.concatenate([[False], exposure[1:] > exposure[:-1]]) if len(exposure) else np.zeros(0, dtype=bool)
    return (log[fresh] - exposure[fresh]) / 1e6


def _row(name: str, ms: np.ndarray) -> tuple[object, ...]:
    quantiles = (f"{np.quantile(ms, q):.1f}" for q in (0.5, 0.95, 0.99, 1.0))
    return (name, len(ms), *quantiles)
