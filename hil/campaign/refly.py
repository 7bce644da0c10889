"""A recorded flight as a scenario: its board moves as it did, and the vehicle starts where it was."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from groundcar.motion import board_row
from groundcar.motion.kinematics import wrap
from hil.assembly.recorded_motion import recorded_motion
from hil.contract.messages import VehicleState
from hil.recording.reader import ReadError, Recording
from hil.recording.runs import Run
from kernel.toml_errors import ConfigError
from scenarios.spec import Scenario

_TILTS_DEG, _HEAVES_M = 1.0, 0.02  # one-sigma changes of inclination and height above those of motion capture's noise


def scenario_again(run: Run, source: str = "any") -> Scenario:
    """The scenario that flies `run` again: on the recorded motion, from the recorded start, without faults.

    `source` as for a recorded path. Raises ConfigError for a run without a usable motion or start.
    """
    try:
        first = Scenario.model_validate({**run.manifest["scenario"], "fault": []})
        recording = Recording(run.recording)
        wanted = [topic for topic in ("run/stage", "mocap/vehicle") if f"/perch/{topic}" in recording.topics]
        messages = list(recording.messages(wanted))
    except (ReadError, ValueError, KeyError) as error:
        raise ConfigError(f"{run.path}: cannot be flown again: {error}") from None
    stage = next((m for _, topic, m in messages if topic == "run/stage" and m.car_start_ns), None)
    vehicles: list[VehicleState] = [m for _, topic, m in messages if topic == "mocap/vehicle"]
    if stage is None or not vehicles:
        what = "its car never set off" if stage is None else "motion capture did not see the vehicle"
        raise ConfigError(f"{run.path}: cannot be flown again: {what}")
    lead = (stage.attempt_start_ns - stage.car_start_ns) * 1e-9
    path = {"kind": "recorded", "file": str(run.recording.resolve()), "source": source}
    tables = first.model_dump(mode="json") | {
        "name": f"{first.name[:34]}-again",
        "title": f"{first.title}, flown again",
        "description": f"The board moves as in {run.path.name}, and the vehicle starts where it was.",
        "path": path, "speed": {"kind": "recorded"}, "car": {"lead": lead},
    }  # fmt: skip
    tables["board"] = {key: first.board.model_dump()[key] for key in ("inclination_deg", "height", "size")}
    motion = recorded_motion(Scenario.model_validate(tables))
    start = min(vehicles, key=lambda one: abs(one.stamp_ns - stage.attempt_start_ns))
    board = motion.at(lead)
    dx, dy = start.position[0] - board[board_row.X], start.position[1] - board[board_row.Y]
    azimuth = math.degrees(float(wrap(math.atan2(dy, dx) - board[board_row.HEADING] - math.pi)))
    altitude = start.position[2] - first.board.height
    ranges = {"distance": math.hypot(dx, dy), "altitude": altitude, "azimuth_deg": azimuth}
    tables["start"] = {
        **{key: [round(float(value), 4)] * 2 for key, value in ranges.items()},
        "depression_max_deg": 89.0, "anchor": "attempt_start", "yaw": first.start.yaw,
    }  # fmt: skip
    rows = np.array([motion.at(t) for t in np.linspace(*motion.span, 50)])
    if source != "wheels" and math.degrees(float(np.std(rows[:, board_row.INCLINATION]))) > _TILTS_DEG:
        tables["board"]["inclination_law"] = {"kind": "recorded"}
    if source != "wheels" and float(np.std(rows[:, board_row.Z])) > _HEAVES_M:
        tables["board"]["height_law"] = {"kind": "recorded"}
    return Scenario.model_validate(tables)


def write_scenario(path: Path, scenario: Scenario) -> None:
    """Write it as a scenario file. Raises OSError."""
    lines: list[str] = []
    _table(lines, "", scenario.model_dump(mode="json", exclude_none=True))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _table(lines: list[str], name: str, table: dict[str, Any]) -> None:
    inner = {key: value for key, value in table.items() if isinstance(value, dict)}
    if name:
        lines.append(f"\n[{name}]")
    lines += [f"{key} = {json.dumps(value)}" for key, value in table.items() if key not in inner and value != []]
    for key, value in inner.items():
        _table(lines, f"{name}.{key}" if name else key, value)
