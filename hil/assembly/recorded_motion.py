"""The recorded motion that a scenario's path names: a run, a recording, or a table of numbers."""

from __future__ import annotations

import csv
import hashlib
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

from groundcar.motion import board_row
from groundcar.motion.recorded import RecordedMotion
from groundcar.scout.dead_reckoning import DeadReckoning
from hil.recording.reader import ReadError, Recording
from kernel.toml_errors import ConfigError
from scenarios.spec import RecordedPath, Scenario

_COLUMNS = ("t", "x", "y", "z", "heading", "speed", "turn_rate", "inclination")


def recorded_motion(scenario: Scenario) -> RecordedMotion:
    """The motion of the scenario's recorded path. Raises ConfigError for a file that is not there, has another content
    than the scenario says, or holds no usable motion."""
    path = scenario.path
    assert isinstance(path, RecordedPath)
    board = scenario.board
    return _read(path.file, path.source, path.sha256, board.height, math.radians(board.inclination_deg))


def identified(scenario: Scenario) -> Scenario:
    """The scenario with the digest of its recorded path, so that its content is what it is known by."""
    path = scenario.path
    if not isinstance(path, RecordedPath):
        return scenario
    recorded_motion(scenario)
    digest = _digest(recorded_file(path.file))
    return scenario.model_copy(update={"path": path.model_copy(update={"sha256": digest})})


def recorded_file(name: str) -> Path:
    """The file that is read for `name`: of a run's folder its recording."""
    return Path(name) / "run.mcap" if Path(name).is_dir() else Path(name)


def _digest(path: Path) -> str:
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise ConfigError(f"path.file: {path}: cannot be read: {error.strerror}") from None


@lru_cache(maxsize=8)
def _read(name: str, source: str, sha256: str, height: float, inclination: float) -> RecordedMotion:
    file = recorded_file(name)
    if sha256 and _digest(file) != sha256:
        raise ConfigError(f"path.file: {file}: is another recording than the scenario says (its sha256 differs)")
    try:
        if file.suffix == ".csv":
            return RecordedMotion(_csv(file), height, inclination)
        return RecordedMotion(_mcap(file, source, height, inclination), height, inclination)
    except (ReadError, ValueError, OSError) as error:
        raise ConfigError(f"path.file: {file}: {error}") from None


def _csv(file: Path) -> dict[str, Any]:
    with file.open(encoding="utf-8", newline="") as lines:
        reader = csv.DictReader(lines)
        names = [name for name in reader.fieldnames or () if name in _COLUMNS]
        rows = list(reader)
    try:
        return {name: [float(row[name]) for row in rows] for name in names}
    except (TypeError, ValueError):
        raise ValueError(f"a value of {', '.join(names)} is no number") from None


def _mcap(file: Path, source: str, height: float, inclination: float) -> dict[str, Any]:
    """Columns of a recording: from the moment at which its car set off."""
    recording = Recording(file)
    topics = {"mocap": "mocap/board", "truth": "truth/board", "wheels": "car/feedback"}
    there = [kind for kind in ("mocap", "truth", "wheels") if f"/perch/{topics[kind]}" in recording.topics]
    kind = next((one for one in there if one != "truth"), "") if source == "any" else source
    if kind not in there:
        raise ValueError(f"holds no motion of the board from {source}; it has {', '.join(there) or 'none'}")
    rows: list[tuple[float, ...]] = []
    reckoned: DeadReckoning | None = None
    stages = ["run/stage"] if "/perch/run/stage" in recording.topics else []
    messages = list(recording.messages([topics[kind], *stages]))
    start_ns = next((m.car_start_ns for _, topic, m in messages if topic == "run/stage" and m.car_start_ns), 0)
    for _, topic, message in messages:
        if topic == "run/stage":
            continue
        t = (message.stamp_ns - start_ns) * 1e-9
        if kind == "wheels":
            reckoned = reckoned or DeadReckoning((0.0, 0.0, 0.0), height, inclination)
            reckoned.add(message.stamp_ns, message.speed, message.turn_rate)
            row = reckoned.board_row(message.stamp_ns)
            values = [float(row[i]) for i in (board_row.X, board_row.Y, board_row.Z, board_row.HEADING)]
            rows.append((t, *values, message.speed, message.turn_rate, inclination))
        else:
            _, x, y, _ = message.orientation
            leaning = math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y))))
            rows.append((t, *message.position, message.heading, message.speed, message.turn_rate, leaning))
    rows = [row for row in rows if row[0] >= 0.0]
    return dict(zip(_COLUMNS, zip(*rows, strict=True), strict=True)) if rows else {}
