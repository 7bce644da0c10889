"""What only the autopilot knows of its estimate: tests of the innovations, resets."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from hil.report.drawing.charts import ASKED, BAD, BELIEF, BOARD, SEEN, VEHICLE, TimePlot
from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded
from hil.report.recorded.ulog import LogTopic, PX4Log
from hil.report.recorded.ulog_clock import LogClock
from hil.report.sections.px4_control import topic_of

_COLOURS = (VEHICLE, BOARD, BELIEF, SEEN, ASKED, BAD)
# Groups of test ratios: key, title, what is in a source's name.
_GROUPS = (
    ("px4-ratio-gps", "PX4: test ratios of GPS", ("gps_",)),
    ("px4-ratio-vision", "PX4: test ratios of external poses", ("ev_",)),
    ("px4-ratio-height", "PX4: test ratios of height sources", ("baro_", "rng_", "hagl")),
    ("px4-ratio-heading", "PX4: test ratios of heading and magnetometer", ("heading", "mag_", "gravity")),
)
# Counter of resets, its jump, its unit and how many numbers it has.
_RESETS = (
    ("xy_reset_counter", "delta_xy", "m", 2), ("z_reset_counter", "delta_z", "m", 1),
    ("vxy_reset_counter", "delta_vxy", "m/s", 2), ("vz_reset_counter", "delta_vz", "m/s", 1),
    ("heading_reset_counter", "delta_heading", "rad", 1),
)  # fmt: skip


def build(recorded: Recorded) -> Section:
    section = Section("px4-estimator", "PX4's own log: estimator")
    log, clock = recorded.log, recorded.log_clock
    if log is None or clock is None or clock.trouble:
        return section
    ratios = topic_of(section, log, "estimator_innovation_test_ratios", "innovations of the estimator")
    if ratios is not None:
        section.text(
            "A ratio above 1 is a measurement that PX4's estimator refuses. Sources that are not used are left out."
        )
        _ratios(section, ratios, clock)
    resets = sorted(_resets(recorded, log, clock))
    if resets:
        head = ("s from the attempt's start", "reset of", "jump")
        section.html(table(head, [(f"{t:.3f}", what, jump) for t, what, jump in resets], "narrow"))
    elif "vehicle_local_position" in log.topics:
        section.text("No reset of position, velocity or heading in this log.")
    return section


def _ratios(section: Section, ratios: LogTopic, clock: LogClock) -> None:
    t = clock.run_ns(ratios.us)
    for key, title, words in _GROUPS:
        plot = TimePlot(key, title, "1, refused above 1", height=120, lines=[(1.0, "refused above")])
        names = [name for name in ratios.fields if name.startswith(words)]
        used = [name for name in names if np.nanmax(np.abs(ratios[name]), initial=0.0) > 0.0]
        for i, name in enumerate(used):
            plot.add(name, _COLOURS[i % len(_COLOURS)], t, ratios[name])
        if used:
            section.plot(plot)


def _resets(recorded: Recorded, log: PX4Log, clock: LogClock) -> Iterator[tuple[float, str, str]]:
    """(s, what, how far it jumped) of each reset that PX4 counted."""
    position = log.topics.get("vehicle_local_position")
    if position is None:
        return
    times = recorded.seconds(clock.run_ns(position.us))
    for counter, delta, unit, width in _RESETS:
        values = position[delta][:, None] if width == 1 else position.vector(delta, width)
        for i in (np.flatnonzero(np.diff(position[counter]) != 0) + 1).tolist():
            what = counter.removesuffix("_reset_counter")
            yield float(times[i]), what, f"{float(np.linalg.norm(values[i])):.3f} {unit}"
