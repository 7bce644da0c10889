"""Automatic checks after a flight: the contents of the run folder."""

from __future__ import annotations

from hil.bench.devices import Context
from hil.bench.reading import Unavailable
from hil.check.judge import Reading
from hil.check.registry import check
from hil.recording.reader import ReadError, Recording
from hil.recording.runs import Run, RunError, list_runs, open_run


@check("run.recording")
def recording(context: Context) -> Reading:
    """The run's recording was finished and nothing in it is damaged."""
    run, found = _recording(context)
    faults = found.faults if not found.complete or found.faults else []
    if faults:
        return Reading("damaged", f"{faults[0]}; try: perch-hil runs recover {run.path}", str(run.path), ok=False)
    return Reading("complete", "", str(run.path), ok=True)


@check("run.messages", unit="messages")
def messages(context: Context) -> Reading:
    """How many messages can be read back."""
    run, found = _recording(context)
    return Reading(sum(found.counts().values()), f"{len(found.topics)} topics", str(run.path))


@check("run.score")
def score(context: Context) -> Reading:
    """The run was scored; perching itself is not judged here."""
    run = _run(context)
    try:
        found = run.score
    except RunError as error:
        return Reading(None, str(error), str(run.path), ok=False)
    if found is None:
        return Reading(None, "the run has no score.json", str(run.path), ok=False)
    return Reading(str(found.get("outcome", "unknown")), "; ".join(found.get("reasons", ())), str(run.path))


@check("run.trips", unit="trips")
def trips(context: Context) -> Reading:
    """How often the safety gate tripped."""
    run, found = _recording(context)
    try:
        events = [e.message for e in found.messages(["event"])]
    except ReadError as error:
        raise Unavailable(str(error)) from None
    texts = [event.text for event in events if event.text.startswith("gate tripped")]
    return Reading(len(texts), "; ".join(texts[:2]), str(run.path))


def _run(context: Context) -> Run:
    try:
        if context.run is not None:
            return open_run(context.run)
    except RunError as error:
        raise Unavailable(str(error)) from None
    runs = list_runs(context.out)
    if not runs:
        raise Unavailable(f"there is no run under {context.out}: name one with --run")
    return runs[-1]


def _recording(context: Context) -> tuple[Run, Recording]:
    run = _run(context)
    try:
        return run, Recording(run.recording)
    except ReadError as error:
        raise Unavailable(str(error)) from None
