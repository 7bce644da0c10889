"""The report's sections, in the order of the page. Each is `build(recorded) -> Section`."""

from __future__ import annotations

from collections.abc import Iterator

from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded
from hil.report.sections import (
    attempt,
    car,
    commands,
    estimate,
    events,
    latency,
    missing,
    motion,
    paper_row,
    perception,
    pictures,
    provenance,
    px4_control,
    px4_estimator,
    px4_log,
    timing,
    touchdown,
)

_SECTIONS = (
    paper_row, touchdown, attempt, pictures, motion, perception, estimate, commands, latency, car, timing, px4_log,
    px4_control, px4_estimator, events,
)  # fmt: skip


def build_all(recorded: Recorded) -> Iterator[Section]:
    """Every section of one flight, each built when it is asked for; the last but one lists what could not be drawn."""
    built = []
    for module in _SECTIONS:
        built.append(module.build(recorded))
        for columns in recorded.topics.values():
            columns.forget()  # a long recording's columns of all sections would not fit
        yield built[-1]
    yield missing.build(recorded, built)
    yield provenance.build(recorded)
