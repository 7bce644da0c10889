"""One run, opened for reporting: the content of its folder and of its recording, and what they lack."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from hil.contract.topics import TOPICS
from hil.recording.manifest import clean_manifest, clean_score, nested
from hil.recording.reader import Recording
from hil.recording.recorder import PICTURES
from hil.recording.runs import MANIFEST, RunError, open_run
from hil.report.recorded.columns import Columns
from hil.report.recorded.geometry import Approach, Motion, approach
from hil.report.recorded.read import read_columns, scored_messages
from hil.report.recorded.ulog import PX4Log, ULogError, read_ulog
from hil.report.recorded.ulog_clock import LogClock, align
from hil.scoring.score import Score, Scorer
from scenarios.spec import Scenario, Tolerance
from vehicle.quadrotor.airframe import load_airframe

LIVE = "live.json"
_MAGNET_BELOW, _FOOTPRINT = 0.04, 0.13


@dataclass
class Recorded:
    """A run's folder, or a bare recording. Times are int64 ns of the run's clock; `seconds` is the plots' axis.

    `score` is the table of score.json, or None; `rescored` is the score by the current code,
    None without a scenario.
    """

    path: Path
    name: str
    recording: Recording
    manifest: dict[str, Any]
    score: dict[str, Any] | None
    scenario: Scenario | None
    topics: dict[str, Columns]
    rescored: Score | None
    live: dict[str, Any] = field(default_factory=dict)  # live.json: how a live run kept its time
    notes: list[str] = field(default_factory=list)  # remarks on the folder itself
    log: PX4Log | None = None  # the autopilot's own, where there is one
    log_clock: LogClock | None = None  # how it lies on the run's clock

    def has(self, *names: str) -> bool:
        """True if every one of these topics has messages."""
        return all(name in self.topics for name in names)

    @property
    def tolerance(self) -> Tolerance:
        return self.scenario.tolerance if self.scenario else Tolerance()

    @property
    def board_size(self) -> float:
        return self.scenario.board.size if self.scenario else 0.42

    @property
    def verdict(self) -> dict[str, Any] | None:
        """score.json, or the score of the recording where there is none."""
        return self.score or (self.rescored.as_dict() if self.rescored else None)

    @cached_property
    def contact_geometry(self) -> tuple[float, float]:
        """Magnet below the centre of mass and radius of the footprint, m, of the airframe the manifest names."""
        try:
            contact = load_airframe(nested(self.manifest, "rig", "vehicle")["airframe"]).contact
        except (KeyError, TypeError, ValueError):
            return _MAGNET_BELOW, _FOOTPRINT
        return contact.magnet_below, contact.footprint_radius

    @cached_property
    def span_ns(self) -> tuple[int, int]:
        """First and last publication."""
        return (
            min(int(c.log_ns[0]) for c in self.topics.values()),
            max(int(c.log_ns[-1]) for c in self.topics.values()),
        )

    @cached_property
    def attempt_ns(self) -> int | None:
        """When the attempt began, or None if the recording does not get as far."""
        stages = self.topics.get("run/stage")
        started = stages.nanoseconds("attempt_start_ns")[stages["name"] == "attempt"] if stages else []
        return int(started[0]) if len(started) else None

    @cached_property
    def decided_ns(self) -> int | None:
        """The instant the referee judged, or None."""
        contacts = self.topics.get("referee/contact")
        decided = np.flatnonzero(contacts["outcome"] != "ongoing") if contacts else []
        return int(contacts.nanoseconds()[decided[0]]) if contacts and len(decided) else None

    @property
    def touched(self) -> bool:
        """True if the referee detected contact."""
        return bool(self.verdict) and (self.verdict or {})["metrics"]["planar"] is not None

    @cached_property
    def window_ns(self) -> tuple[int, int]:
        """The attempt: from its start to shortly after the verdict; the whole recording if there was none."""
        first, last = self.span_ns
        start = self.attempt_ns if self.attempt_ns is not None else first
        return start, min(last, self.decided_ns + 400_000_000) if self.decided_ns else last

    def seconds(self, t_ns: np.ndarray | int) -> np.ndarray:
        """Seconds since the attempt began (since the recording's start if it never did)."""
        origin = self.attempt_ns if self.attempt_ns is not None else self.span_ns[0]
        return (np.asarray(t_ns) - origin) / 1e9

    @property
    def vehicle_source(self) -> str:
        """The best topic for the vehicle's pose, empty if there is none."""
        return next((t for t in ("truth/vehicle", "mocap/vehicle", "vehicle/odometry") if self.has(t)), "")

    @property
    def board_source(self) -> str:
        return next((t for t in ("truth/board", "mocap/board") if self.has(t)), "")

    def motion(self, topic: str) -> Motion | None:
        """A topic of poses as arrays, samples that are not finite or out of order left out; None if it is missing."""
        columns = self.topics.get(topic)
        if columns is None:
            return None
        t = columns.nanoseconds()
        parts = [columns[f] for f in ("position", "velocity", "orientation")]
        good = np.all(np.isfinite(np.column_stack(parts)), axis=1)
        good[1:] &= np.diff(t) > 0
        return Motion(t[good], *(part[good] for part in parts)) if good.sum() > 1 else None

    @cached_property
    def vehicle(self) -> Motion | None:
        return self.motion(self.vehicle_source)

    @cached_property
    def board(self) -> Motion | None:
        return self.motion(self.board_source)

    @cached_property
    def approach(self) -> Approach | None:
        """The vehicle in the board's frame, or None without both poses."""
        if self.vehicle is None or self.board is None:
            return None
        return approach(self.vehicle, self.board, self.contact_geometry[0])

    def during(self, t_ns: np.ndarray) -> np.ndarray:
        """Mask of the times that lie in the attempt, up to the verdict."""
        start, end = self.window_ns
        return (t_ns >= start) & (t_ns <= (self.decided_ns or end))


def load(path: Path | str, ulog: Path | None = None) -> Recorded:
    """Open a run folder or an .mcap file for reporting. Raises ReadError, RunError or ULogError, one line each.

    `ulog`: the autopilot's own log of this flight. Without it a log (.ulg) in the run's folder is used; one there that
    cannot be read is a remark.
    """
    path = Path(path)
    manifest, score, live, notes, folder = {}, None, {}, [], path if path.is_dir() else path.parent
    if path.is_dir() or path.name == "run.mcap":
        if path.is_dir() or (folder / MANIFEST).exists():
            run = open_run(folder)
            manifest, path = clean_manifest(run.manifest, notes), run.recording
            try:
                score = clean_score(run.score, notes)
                live = json.loads((folder / LIVE).read_text(encoding="utf-8")) if (folder / LIVE).exists() else {}
                live = live if isinstance(live, dict) else {}
            except (RunError, OSError, ValueError) as error:
                notes.append(str(error))
    elif not path.exists():
        raise RunError(f"{path}: no such run folder or recording")
    recording = Recording(path)
    if not manifest:
        notes.append("no manifest beside this recording: scenario, rig, code and policy are unknown")
    scenario = _scenario(manifest, notes)
    topics = read_columns(recording, [t for t in TOPICS if t != PICTURES])
    if not topics:
        raise RunError(f"{path}: holds no message that can be read{_because(recording)}")
    name = folder.resolve().name if manifest else path.name
    ended = nested(live, "ended")
    aborted = str(ended.get("trouble") or ("interrupted" if ended.get("interrupted") else ""))
    camera = nested(manifest, "rig", "policy").get("knows", "camera") == "camera"
    seed = int(manifest.get("seed") or 0)
    rescored = _rescored(scenario, seed, recording, aborted, camera) if scenario else None
    log = read_ulog(ulog) if ulog is not None else _log_in(folder, notes) if manifest else None
    clock = align(log, topics.get("vehicle/status"), topics.get("vehicle/odometry")) if log else None
    return Recorded(path, name, recording, manifest, score, scenario, topics, rescored, live, notes, log, clock)


def _log_in(folder: Path, notes: list[str]) -> PX4Log | None:
    """The autopilot's log in a run's folder, the newest if there are several."""
    found = sorted(folder.glob("*.ulg"), key=lambda one: (one.stat().st_mtime, one.name))
    if not found:
        return None
    if len(found) > 1:
        notes.append(f"several logs of the autopilot are in the folder: {found[-1].name} is shown")
    try:
        return read_ulog(found[-1])
    except (ULogError, OSError) as error:
        notes.append(f"the autopilot's log is left out: {error}")
        return None


def _rescored(scenario: Scenario, seed: int, recording: Recording, aborted: str, camera: bool) -> Score:
    scorer = Scorer(scenario, seed, camera)
    for log_ns, topic, message in scored_messages(recording):
        scorer(log_ns, topic, message)
    if aborted:
        scorer.abort(aborted)
    return scorer.result()


def _because(recording: Recording) -> str:
    return f" ({recording.faults[0]})" if recording.faults else ""


def _scenario(manifest: dict[str, Any], notes: list[str]) -> Scenario | None:
    if not manifest:
        return None
    try:
        return Scenario.model_validate_json(_json(manifest.get("scenario")))
    except ValidationError as error:
        notes.append(f"the manifest's scenario is not one of this version: {error.errors()[0]['msg']}")
        return None


def _json(table: Any) -> str:
    return json.dumps(table or {})
