"""What an autopilot says of its own health on the ground station's link."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

CHECKS = {
    "gyro calibration": "is_gyrometer_calibration_ok",
    "accelerometer calibration": "is_accelerometer_calibration_ok",
    "magnetometer calibration": "is_magnetometer_calibration_ok",
    "local position": "is_local_position_ok",
    "global position": "is_global_position_ok",
    "home position": "is_home_position_ok",
    "armable": "is_armable",
}
"""Name of a check -> its field in MAVSDK's telemetry."""


class Problem(NamedTuple):
    """One thing that PX4's health and arming checks report. `level`: error, warning, info, ..."""

    text: str
    detail: str
    level: str
    component: str


@dataclass(frozen=True)
class Health:
    """`checks` by name (see `CHECKS`), `problems` of the mode that is selected, from PX4's events, and its `texts`.

    `events` is False where the autopilot gave no report: then its texts are all that it says.
    """

    checks: dict[str, bool]
    problems: list[Problem]
    texts: list[str]
    events: bool

    @property
    def armable(self) -> bool:
        """Whether the autopilot would arm now."""
        return self.checks["armable"]

    def reasons(self) -> list[str]:
        """Why it would not arm, in words; empty if it would."""
        if self.armable:
            return []
        serious = [one for one in self.problems if one.level in ("error", "critical")]
        said = [f"{one.text} ({one.component})" for one in serious]
        said += [text for text in dict.fromkeys(self.texts) if not any(one.text in text for one in serious)]
        failing = [name for name, fine in self.checks.items() if not fine and name != "armable"]
        return said or [f"no {name}" for name in failing] or ["the autopilot gives no reason"]
