"""The motion of a board as it was recorded: samples over time, checked, and interpolated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from groundcar.motion import board_row
from groundcar.motion.kinematics import drive, wrap

LONGEST_GAP_S = 0.25
FEWEST = 10
_LAST_S = 0.3  # whose mean speed and turn rate the board keeps after the end
COLUMNS = ("x", "y", "z", "heading", "speed", "turn_rate", "inclination")


class RecordedMotion:
    """Samples over `t` (s, 0 when the car set off): x, y, z (m), heading, inclination (rad), speed (m/s), turn_rate."""

    def __init__(self, columns: Mapping[str, Any], height: float, inclination: float) -> None:
        """`columns`: t, x, y and heading, and what is known of z, speed, turn_rate and inclination, equally long.
        `height` (m) and `inclination` (rad) stand for a z or inclination that is not known.

        Raises ValueError for missing or unequal columns, numbers that are not finite, gaps, and time that does not
        rise.
        """
        missing = [name for name in ("t", "x", "y", "heading") if name not in columns]
        if missing:
            raise ValueError(f"the recorded motion has no column {', '.join(missing)}")
        table = {name: np.asarray(values, float) for name, values in columns.items() if name in ("t", *COLUMNS)}
        count = len(table["t"])
        if count < FEWEST or any(values.shape != (count,) for values in table.values()):
            raise ValueError(f"the recorded motion has {count} samples: it needs {FEWEST}, and as many in each column")
        for name, values in table.items():
            if not np.isfinite(values).all():
                raise ValueError(f"the recorded motion is not finite: {name} of sample {_first(~np.isfinite(values))}")
        t = table["t"]
        steps = np.diff(t)
        if (steps <= 0.0).any():
            at = _first(steps <= 0.0)
            raise ValueError(f"the time of the recorded motion runs backwards: {t[at + 1]:g} s comes after {t[at]:g} s")
        if (steps > LONGEST_GAP_S).any():
            at = _first(steps > LONGEST_GAP_S)
            raise ValueError(
                f"the recorded motion has a gap of {steps[at]:.2f} s at {t[at]:.2f} s: no more than {LONGEST_GAP_S} s"
            )
        self._t, heading = t, np.unwrap(table["heading"])
        x, y = table["x"], table["y"]
        if "speed" not in table:
            table["speed"] = np.gradient(x, t) * np.cos(heading) + np.gradient(y, t) * np.sin(heading)
        if "turn_rate" not in table:
            table["turn_rate"] = np.gradient(heading, t)
        table["heading"] = heading
        table.setdefault("z", np.full(count, height))
        table.setdefault("inclination", np.full(count, inclination))
        self._columns = np.array([table[name] for name in COLUMNS])
        late = t >= t[-1] - _LAST_S
        self._after = tuple(float(np.mean(table[name][late])) for name in ("speed", "turn_rate"))

    @property
    def span(self) -> tuple[float, float]:
        """First and last time, s."""
        return float(self._t[0]), float(self._t[-1])

    def at(self, seconds: float) -> np.ndarray:
        """Board row (8,) at `seconds`. Before the first sample the board stands there; after the last one it goes on
        with its last speed and turn rate."""
        x, y, z, heading, speed, turn_rate, inclination = (
            float(np.interp(seconds, self._t, values)) for values in self._columns
        )
        first, last = self.span
        if seconds < first:
            speed = turn_rate = 0.0
        elif seconds > last:
            speed, turn_rate = self._after
            x, y, heading = drive(x, y, heading, speed, turn_rate, seconds - last)
        row = np.zeros(board_row.DIM)
        row[: board_row.U] = x, y, z, wrap(heading), speed, turn_rate, inclination
        return row


def _first(found: np.ndarray) -> int:
    return int(np.flatnonzero(found)[0])
