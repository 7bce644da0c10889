"""Computes score and timing of a live run from its recording and the last health message of each service."""

from __future__ import annotations

from typing import Any

from hil.assembly.plan import Plan
from hil.host.flight import flight_judge, with_faults_said
from hil.live.latency import latencies
from hil.live.latency import table as latency_table
from hil.live.load import load_now, load_table
from hil.recording.reader import ReadError, Recording
from hil.recording.runs import Run
from hil.scoring.flight_class import LAND_LIMIT_S, READ, FlightClass
from hil.scoring.score import ABORTED, SCORED, Score, score_messages

_READ = (*SCORED, "policy/action")
_SILENT_S = 2.0  # without a status at the end: the vehicle's driver has ended before


class Ended:
    """How a run ended."""

    def __init__(self) -> None:
        self.interrupted = False
        self.trouble = self.failure = ""
        self.stage = "prepare"
        self.health: dict[str, dict[str, Any]] = {}
        self.remarks: list[str] = []
        self.before = self.after = load_now()


def judge(run: Run, plan: Plan, seed: int, ended: Ended) -> tuple[Score, dict[str, Any], FlightClass | None]:
    """Score, timing and class from the recording. A run that was interrupted or failed is no verdict on its policy; one
    that did not wait for the vehicle's landing has no class."""
    found: FlightClass | None = None
    camera = plan.rig.policy.knows == "camera"
    aborted = ended.trouble or ("interrupted" if ended.interrupted else "")
    try:
        recording = Recording(run.recording)
        messages = list(recording.messages([t for t in _READ if "/perch/" + t in recording.topics]))
        score = score_messages(plan.scenario, seed, messages, aborted, camera)
        latency = latency_table(latencies(messages))
        if not ended.interrupted and (ended.trouble or plan.scenario.fault or not plan.rig.simulated):
            found = _class(recording, plan, ended.trouble or ended.failure)
            score = with_faults_said(score, found)
    except ReadError as error:
        ended.trouble = ended.trouble or str(error)
        score, latency = score_messages(plan.scenario, seed, (), ended.trouble, camera), {"count": 0}
    slot = plan.rig.camera
    table = {
        "ended": {"trouble": ended.trouble, "interrupted": ended.interrupted, "stage": ended.stage},
        "exposure_to_action": latency,
        "of_it_exposure_and_transport_ms": (
            slot.exposure_ms / 2 + slot.transport_ms if camera and slot.kind == "sim" else None
        ),
        **load_table(ended.before, ended.after),
        "remarks": ended.remarks,
        "services": {name: _kept(one) for name, one in sorted(ended.health.items())},
    }
    return score, table, found


def _class(recording: Recording, plan: Plan, trouble: str) -> FlightClass | None:
    """None where nothing says when the motors stopped: the vehicle's driver or its link ended in flight, or the
    recording ends before the wait for the landing does, as it does with a hub that was lost."""
    one, armed, now_ns, told_ns = flight_judge(plan.scenario, plan.rig), False, 0, 0
    ended_ns: int | None = None
    for log_ns, topic, message in recording.messages([t for t in READ if "/perch/" + t in recording.topics]):
        one(log_ns, topic, message)
        now_ns = log_ns
        if topic == "vehicle/status":
            armed, told_ns = message.armed, log_ns if message.connected else told_ns
        if ended_ns is None and _is_end(topic, message):
            ended_ns = log_ns
    waited = ended_ns is not None and now_ns - ended_ns > (LAND_LIMIT_S - _SILENT_S) * 1e9
    return one.result(not armed, trouble) if not armed or (waited and now_ns - told_ns < _SILENT_S * 1e9) else None


def _is_end(topic: str, message: Any) -> bool:
    """Whether the message is the end of the run, after which the vehicle is awaited on the ground."""
    if topic == "run/stage":
        return message.name == "ended"
    return topic == "event" and message.source == "supervisor" and message.text.startswith(ABORTED)


def _kept(table: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in table.items() if key not in ("received_ns", "service", "outputs", "memory")}
