"""Recorded motion: interpolated as it was, refused where it is damaged."""

import math

import numpy as np
import pytest

from groundcar.motion import board_row as b
from groundcar.motion.recorded import RecordedMotion
from groundcar.motion.sines import Sines

T = np.arange(0.0, 5.0, 0.05)


def circle(**changes):
    """Two metres a second on a circle of 4 m, to the left."""
    angle = 0.5 * T
    columns = {"t": T, "x": 4 * np.cos(angle), "y": 4 * np.sin(angle), "heading": angle + math.pi / 2}
    return {**columns, **changes}


def test_motion_is_interpolated_and_its_speed_found():
    motion = RecordedMotion(circle(), 1.5, 0.3)
    row = motion.at(2.025)
    assert row[[b.X, b.Y]] == pytest.approx([4 * math.cos(1.0125), 4 * math.sin(1.0125)], abs=2e-3)
    assert row[b.SPEED] == pytest.approx(2.0, abs=0.01) and row[b.TURN_RATE] == pytest.approx(0.5, abs=1e-6)
    assert (row[b.Z], row[b.INCLINATION]) == (1.5, 0.3)


def test_heading_is_continuous_over_half_a_turn():
    wrapped = (0.5 * T + math.pi / 2 + math.pi) % (2 * math.pi) - math.pi
    motion = RecordedMotion(circle(heading=wrapped), 1.5, 0.3)
    assert max(abs(motion.at(t)[b.TURN_RATE] - 0.5) for t in T) < 1e-6


def test_board_stands_before_and_goes_on_after():
    motion = RecordedMotion(circle(), 1.5, 0.3)
    before, after = motion.at(-1.0), motion.at(T[-1] + 1.0)
    assert before[b.SPEED] == 0.0 and before[b.X] == 4.0
    angle = 0.5 * (T[-1] + 1.0)
    assert after[[b.X, b.Y]] == pytest.approx([4 * math.cos(angle), 4 * math.sin(angle)], abs=0.02)


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        ({"t": T[:5]}, "5 samples"),
        ({"t": np.where(T[40] == T, T[38], T)}, "runs backwards"),
        ({"t": np.where(T[40] <= T, T + 1.0, T)}, "a gap of 1.05 s"),
        ({"x": np.where(T[3] == T, np.nan, T)}, "not finite: x of sample 3"),
        ({"speed": T[:7]}, "as many in each column"),
    ],
)
def test_damaged_motion_is_refused(columns, message):
    with pytest.raises(ValueError, match=message):
        RecordedMotion(circle(**columns), 1.5, 0.3)


def test_missing_column_is_named():
    with pytest.raises(ValueError, match="no column heading"):
        RecordedMotion({"t": T, "x": T, "y": T}, 1.5, 0.3)


def test_sum_of_sines_and_its_rate():
    sea = Sines([(0.1, 4.0, 0.0), (0.05, 2.5, 1.0)])
    for t in np.linspace(0, 9, 37):
        value, rate = sea.at(t)
        assert abs(value) <= sea.most
        assert rate == pytest.approx((sea.at(t + 1e-5)[0] - sea.at(t - 1e-5)[0]) / 2e-5, abs=1e-6)
    assert Sines().at(3.0) == (0.0, 0.0)
    with pytest.raises(ValueError, match="is none"):
        Sines([(0.1, 0.0, 0.0)])
