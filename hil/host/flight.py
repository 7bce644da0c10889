"""One flight in the lockstep host: scenario, rig, policy and seed in, a run folder out."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from numba import get_num_threads

from hil.assembly.rig import Rig
from hil.assembly.simulation import build, counters
from hil.contract.graph import check_graph
from hil.contract.messages import Event, Stage
from hil.contract.topics import TOPICS
from hil.host.failure import why_no_attempt
from hil.host.landing import Landing
from hil.host.lockstep import Clock, Lockstep, Tap
from hil.host.space import check_space
from hil.recording.foxglove import FoxgloveView
from hil.recording.provenance import Code
from hil.recording.receipts import ReceiptBook
from hil.recording.recorder import Recorder, RecordingError
from hil.recording.runs import SCORE, Run, new_run, policy_identity
from hil.scoring.flight_class import READ, FlightClass, FlightJudge
from hil.scoring.score import ABORTED, SCORED, Score, Scorer
from hil.wires import WireError
from kernel.interrupts import interrupts_kept
from policies.task.interface import FlyingPolicy
from scenarios.draw import draw
from scenarios.spec import Scenario

Progress = Callable[[int, str], None]


@dataclass(frozen=True)
class Flight:
    """What one flight left: its score, its class, its folder, and how fast its attempt ran against virtual time."""

    score: Score
    run: Run
    real_time_factor: float | None
    failure: str  # why no attempt took place; empty if one did
    counters: Mapping[str, int]  # what was rejected or dropped on the way
    interrupted: bool
    flight_class: FlightClass | None = None  # None if it was interrupted


WATCHED = ("event", "run/stage")


class _Watch:
    """A tap that notes when the attempt began and what went wrong, for the console and the real-time factor."""

    def __init__(self, progress: Progress) -> None:
        self._progress = progress
        self._next_ns = 0
        self._wall = 0.0
        self._virtual_ns = 0
        self.stage = "prepare"
        self.errors: list[Event] = []
        self.real_time_factor: float | None = None

    def __call__(self, now_ns: int, topic: str, message: Any) -> None:
        if topic == "event":
            event: Event = message
            if event.severity == "error":
                self.errors.append(event)
        elif topic == "run/stage":
            stage: Stage = message
            if stage.name != self.stage:
                if stage.name == "lead" or (stage.name == "attempt" and not self._virtual_ns):
                    self._wall, self._virtual_ns = time.perf_counter(), now_ns
                self.stage = stage.name
            if now_ns >= self._next_ns:
                self._next_ns = now_ns + 200_000_000
                self._progress(now_ns, self.stage)

    @property
    def failure(self) -> str:
        """Why no attempt took place; empty if one did."""
        return why_no_attempt([(error.source, error.text) for error in self.errors])

    def finish(self, now_ns: int) -> None:
        if self._virtual_ns and now_ns > self._virtual_ns:
            self.real_time_factor = (now_ns - self._virtual_ns) * 1e-9 / (time.perf_counter() - self._wall)


def fly(
    scenario: Scenario,
    rig: Rig,
    policy: FlyingPolicy,
    seed: int,
    *,
    policy_name: str,
    rig_name: str,
    pictures: str,
    out: Path,
    code: Code,
    progress: Progress,
    clearance: Mapping[str, Any] | None = None,
    viewer: Tap | None = None,
) -> Flight:
    """Fly one seed. An interruption (Ctrl-C) closes the recording and is reported in the result, not raised.

    `viewer` receives every message too.

    Raises RunError, ProvenanceError or RecordingError if the run cannot be kept, WireError if the link to a firmware
    cannot be opened: such a run does not take off.
    """
    drawn = draw(scenario, seed)
    clock = Clock()
    simulation = build(scenario, rig, drawn, policy, clock)
    check_graph(simulation.nodes, rig.policy.knows)
    check_space(out, pictures)
    run = new_run(
        out,
        scenario={**scenario.model_dump(mode="json"), "name": scenario.name},
        rig={**rig.model_dump(mode="json"), "name": rig_name},
        seed=seed,
        host="lockstep",
        policy=policy_identity(policy_name),
        simulated=rig.simulated,
        started_utc=datetime.now(UTC),
        code=code,
        more={"clearance": dict(clearance or {})},
    )
    scorer = Scorer(scenario, seed, rig.policy.knows == "camera")
    watch, judge = _Watch(progress), flight_judge(scenario, rig)
    landing = Landing(simulation.nodes, judge, watched=bool(scenario.fault))
    state, lost, now_ns, wall = "failed", "", 0, time.perf_counter()
    try:
        view = FoxgloveView(simulation.camera, pictures, scenario.board.size)
        with (
            ReceiptBook(run.path / "receipts.mcap", simulation.nodes) as book,
            Recorder(run.recording, view=view) as recorder,
            interrupts_kept() as interrupted,
        ):
            readers: list[tuple[Tap, Collection[str]]] = [
                (recorder, TOPICS), (scorer, SCORED), (watch, WATCHED), (judge, READ), (landing, landing.topics),
            ]  # fmt: skip
            readers += [(viewer, TOPICS)] if viewer is not None else []
            taps = {topic: [one for one, read in readers if topic in read] for topic in TOPICS}

            def tap(now: int, topic: str, message: Any) -> None:
                for one in taps[topic]:
                    one(now, topic, message)

            run.begin(datetime.now(UTC))

            def over(now: int) -> bool:
                interrupted()
                before, done = landing.trouble, landing.over(now, watch.stage)
                if landing.trouble != before:
                    tap(now, "event", Event(now, "warning", "supervisor", f"{ABORTED}{landing.trouble}"))
                return done

            host = Lockstep(simulation.nodes, clock, tap, book=book, threads=get_num_threads())
            ended = "finished"
            try:
                simulation.wires.start(run.path)
                now_ns = host.run(over)
                ended = "failed" if landing.trouble or watch.failure else "finished"
            except KeyboardInterrupt:
                now_ns, ended = clock.now_ns, "interrupted"
                tap(now_ns, "event", Event(now_ns, "warning", "supervisor", f"{ABORTED}{ended}"))
            except WireError as error:
                now_ns, lost, ended = clock.now_ns, str(error), "failed"
                tap(now_ns, "event", Event(now_ns, "error", "supervisor", f"{ABORTED}{lost}"))
            watch.finish(now_ns)
        state = ended  # not before both files have their ends
    finally:
        for node in simulation.nodes:
            node.close()
        simulation.wires.close()
        found = None if state == "interrupted" else judge.result(landing.motors_off, lost or landing.trouble)
        score = with_faults_said(scorer.result(), found)
        told = {**score.as_dict(), **({"flight": found.as_dict()} if found else {})}
        fault = run.finish(
            state, datetime.now(UTC), {SCORE: told}, wall_s=time.perf_counter() - wall, virtual_s=now_ns * 1e-9
        )
    if fault:
        raise RecordingError(fault)
    failure = "" if state == "interrupted" else lost or landing.trouble or watch.failure
    return Flight(
        score, run, watch.real_time_factor, failure, counters(simulation.nodes), state == "interrupted", found
    )


def flight_judge(scenario: Scenario, rig: Rig) -> FlightJudge:
    """What gives the flight its class."""
    titles = [f"{fault.title} ({fault.condition.text})" for fault in scenario.fault]
    return FlightJudge((rig.gate.x, rig.gate.y, rig.gate.z), scenario.board.size, titles)


def with_faults_said(score: Score, found: FlightClass | None) -> Score:
    """The score, whose reasons say which faults did not happen: the flight then says nothing about them."""
    titles = found.not_begun if found else ()
    missing = [f"the fault did not happen, the flight does not count: {title}" for title in titles]
    return replace(score, reasons=(*score.reasons, *missing))
