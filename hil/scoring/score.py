"""The verdict of a run and the paper's row of numbers, gathered while the run goes on.

Everything comes from recorded topics, so that scoring a recording gives the same score as scoring the run. What did
not happen is None, never a number.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import asdict, dataclass
from typing import Any

from hil.contract.messages import BoardState, Contact, Detection, Event, Sent, Stage
from hil.scoring.verdict import NOT_HELD, verdict_word
from policies.task.contact import GROUND, INVALID, REASONS, TIMEOUT, WORKSPACE
from scenarios.spec import Scenario

_SELDOM = 0.1  # share of pictures that show the board below which a drone that never touches could not know better
SCORED = ("run/stage", "referee/contact", "truth/board", "mocap/board", "board/detection", "vehicle/sent", "event")
ABORTED = "run aborted: "  # begins the event of a supervisor or host from which on nothing is scored
_NO_CONTACT = {REASONS[i] for i in (GROUND, WORKSPACE, TIMEOUT, INVALID)}


@dataclass(frozen=True, slots=True)
class Metrics:
    """The paper's row, by the names of scenarios.paper.RealRow, and what else says how the attempt went.

    m, m/s, s, Hz; impact_normal is negative into the board. None: no contact, or nothing to measure it on, as
    perception where no camera flies.
    """

    platform_speed: tuple[float, float] | None  # least and greatest, attempt's start to its end
    inclination_deg: float  # as set; what the board held is inclination_measured_deg
    x: float | None  # board frame, at contact
    y: float | None
    planar: float | None
    normal_alignment_deg: float | None
    impact_normal: float | None
    impact_tangential: float | None
    perception_desired_hz: float | None
    perception_actual_hz: float | None  # pictures looked at, board seen or not
    perception_found_hz: float | None  # board poses published
    inclination_measured_deg: float | None
    duration: float | None  # attempt's start to contact, violation or time limit
    blind_time: float | None  # last picture that showed the board to the end
    detection_latency: float | None  # median, exposure to published pose
    commands: int  # sent to the vehicle during the attempt
    commands_limited: int  # of them, changed by the gate


@dataclass(frozen=True, slots=True)
class Score:
    """What the referee said, and the numbers."""

    scenario: str
    seed: int
    attached: bool
    within_tolerance: bool
    outcome: str  # success, fail, or incomplete if the run ended or was aborted before the referee decided
    reasons: tuple[str, ...]
    metrics: Metrics

    @property
    def verdict(self) -> str:
        """One word of `hil.scoring.verdict`."""
        return verdict_word(attached=self.attached, within_tolerance=self.within_tolerance, outcome=self.outcome)

    def as_dict(self) -> dict[str, Any]:
        """Plain tables for JSON."""
        return asdict(self)


class Scorer:
    """Feed it every message (`scorer(now_ns, topic, message)`, a host's tap); ask `result` at any time."""

    def __init__(self, scenario: Scenario, seed: int, camera: bool = True) -> None:
        """`camera`: whether the board is seen by a camera, not known by motion capture."""
        self._scenario, self._seed, self._camera = scenario, seed, camera
        self._start_ns = 0
        self._verdict: Contact | None = None
        self._last_ns = 0
        self._speeds: dict[str, tuple[float, float]] = {}
        self._tilt: dict[str, float] = {}
        # exposure, publication, found, if not, why; from the attempt's start
        self._looks: list[tuple[int, int, bool, str]] = []
        self._sent = self._limited = 0
        self._tripped = self._aborted = ""
        self._fell = False

    def abort(self, why: str) -> None:
        """The run does not end by itself: what follows is no verdict on the policy."""
        self._aborted = self._aborted or why or "unknown"

    def __call__(self, now_ns: int, topic: str, message: Any) -> None:
        if topic == "run/stage":
            self._stage(message)
        elif topic == "event":
            self._event(message)
        elif topic == "referee/contact":
            self._contact(message)
        elif self._verdict is not None or self._aborted:
            return
        elif topic in ("truth/board", "mocap/board"):
            self._board(topic, message)
        elif topic == "board/detection":
            self._detection(now_ns, message)
        elif topic == "vehicle/sent":
            self._command(message)

    def _open(self, stamp_ns: int) -> bool:
        return bool(self._start_ns) and stamp_ns >= self._start_ns and self._verdict is None

    def _stage(self, stage: Stage) -> None:
        if stage.name in ("lead", "attempt") and stage.attempt_start_ns:
            self._start_ns = stage.attempt_start_ns
        if stage.name == "attempt" and self._verdict is None and not self._aborted:
            self._last_ns = max(self._last_ns, stage.stamp_ns)

    def _event(self, event: Event) -> None:
        if event.source == "supervisor" and event.text.startswith(ABORTED):
            self.abort(event.text.removeprefix(ABORTED))
        self._fell = self._fell or event.text == NOT_HELD

    def _contact(self, contact: Contact) -> None:
        if self._verdict is None and contact.outcome != "ongoing" and not self._aborted:
            self._verdict = contact
            self._last_ns = contact.stamp_ns

    def _board(self, topic: str, board: BoardState) -> None:
        if not self._open(board.stamp_ns):
            return
        speed = abs(board.speed)
        low, high = self._speeds.get(topic, (speed, speed))
        self._speeds[topic] = (min(low, speed), max(high, speed))
        _, x, y, _ = board.orientation
        # world z component of the board's normal: 1 - 2 (x^2 + y^2) for a unit quaternion
        self._tilt[topic] = math.degrees(math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))))

    def _detection(self, now_ns: int, seen: Detection) -> None:
        if self._open(seen.stamp_ns):
            self._looks.append((seen.stamp_ns, now_ns, seen.found, seen.reason))

    def _command(self, sent: Sent) -> None:
        if self._open(sent.stamp_ns):
            self._sent += 1
            self._limited += sent.limited
            self._tripped = self._tripped or sent.tripped

    def result(self) -> Score:
        """The score of what has been seen so far."""
        contact, start, end = self._verdict, self._start_ns, self._last_ns
        duration = (end - start) / 1e9 if start and end > start else None
        looks = [look for look in self._looks if look[0] <= end]
        found = [look for look in looks if look[2]]
        touched = contact is not None and contact.reason not in _NO_CONTACT
        source = "truth/board" if "truth/board" in self._speeds else "mocap/board"
        metrics = Metrics(
            platform_speed=self._speeds.get(source),
            inclination_deg=self._scenario.board.inclination_deg,
            x=contact.x if contact and touched else None,
            y=contact.y if contact and touched else None,
            planar=math.hypot(contact.x, contact.y) if contact and touched else None,
            normal_alignment_deg=math.degrees(contact.normal_error) if contact and touched else None,
            impact_normal=contact.normal_speed if contact and touched else None,
            impact_tangential=contact.tangential_speed if contact and touched else None,
            perception_desired_hz=self._scenario.camera.rate if self._camera else None,
            perception_actual_hz=_rate([look[0] for look in looks]),
            perception_found_hz=len(found) / duration if duration and self._camera else None,
            inclination_measured_deg=self._tilt.get(source),
            duration=duration,
            blind_time=(end - found[-1][0]) / 1e9 if found else None,
            detection_latency=_median([look[1] - look[0] for look in looks]),
            commands=self._sent,
            commands_limited=self._limited,
        )
        reasons = [contact.reason] if contact and contact.reason else []
        if self._fell:
            reasons.append(NOT_HELD)
        if self._aborted:
            reasons.append(f"aborted: {self._aborted}")
        elif contact is None:
            reasons.append("the run ended before the referee decided")
        if self._tripped:
            reasons.append(f"gate: {self._tripped}")
        if looks and not touched and len(found) < _SELDOM * len(looks):
            usual = Counter(look[3] for look in looks if not look[2]).most_common(1)[0][0]
            reasons.append(f"the board was found in {len(found)} of {len(looks)} pictures; mostly: {usual}")
        return Score(
            scenario=self._scenario.name,
            seed=self._seed,
            attached=contact is not None and contact.attached and not self._fell,
            within_tolerance=contact is not None and contact.within_tolerance,
            outcome=contact.outcome if contact and not self._aborted else "incomplete",
            reasons=tuple(reasons),
            metrics=metrics,
        )


def score_messages(scenario: Scenario, seed: int, messages: Any, aborted: str = "", camera: bool = True) -> Score:
    """The score of a recording: `messages` as `hil.recording.reader.Recording.messages` gives them.

    `aborted`: why the run did not end by itself, if it did not and the recording may lack the event that says so.
    `camera`: as for a `Scorer`.
    """
    scorer = Scorer(scenario, seed, camera)
    for log_ns, topic, message in messages:
        scorer(log_ns, topic, message)
    if aborted:
        scorer.abort(aborted)
    return scorer.result()


def _rate(stamps: list[int]) -> float | None:
    return (len(stamps) - 1) * 1e9 / (stamps[-1] - stamps[0]) if len(stamps) > 1 else None


def _median(delays: list[int]) -> float | None:
    if not delays:
        return None
    ordered, middle = sorted(delays), len(delays) // 2
    ns = ordered[middle] if len(ordered) % 2 else (ordered[middle - 1] + ordered[middle]) / 2
    return ns / 1e9
