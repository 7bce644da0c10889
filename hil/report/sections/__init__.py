"""The report's sections, in the order of the page. Each is `build(recorded) -> Section`."""

from __future__ import annotations

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
    timing,
    touchdown,
)


def build_all(recorded: Recorded) -> list[Section]:
    """Every section of one flight; the last but one lists what the others could not draw."""
    built = [
        paper_row.build(recorded),
        touchdown.build(recorded),
        attempt.build(recorded),
        pictures.build(recorded),
        motion.build(recorded),
        perception.build(recorded),
        estimate.build(recorded),
        commands.build(recorded),
        latency.build(recorded),
        car.build(recorded),
        timing.build(recorded),
    ]
    return [*built, events.build(recorded), missing.build(recorded, built), provenance.build(recorded)]
