import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion import board_row
from groundcar.scout.dead_reckoning import DeadReckoning

MS = 1_000_000
START = (1.0, -2.0, 0.5)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.sampled_from([10, 20, 50]))
def test_dead_reckoning_is_exact_on_a_circle_at_any_report_rate(speed, turn_rate, step_ms):
    found = DeadReckoning(START, 1.5, 0.7)
    for k in range(0, 1001, step_ms):
        found.add(k * MS, speed, turn_rate)
    row = found.board_row(1000 * MS)
    heading = START[2] + turn_rate
    if abs(turn_rate) < 1e-6:
        x, y = START[0] + speed * math.cos(START[2]), START[1] + speed * math.sin(START[2])
    else:
        radius = speed / turn_rate
        x = START[0] + radius * (math.sin(heading) - math.sin(START[2]))
        y = START[1] - radius * (math.cos(heading) - math.cos(START[2]))
    assert (row[board_row.X], row[board_row.Y], row[board_row.HEADING]) == pytest.approx((x, y, heading), abs=1e-6)
    assert (row[board_row.Z], row[board_row.INCLINATION], row[board_row.SPEED], row[board_row.TURN_RATE]) == (
        1.5,
        0.7,
        speed,
        turn_rate,
    )


def test_pose_is_constant_before_the_first_report():
    row = DeadReckoning(START, 1.5, 0.7).board_row(5000 * MS)
    assert (row[board_row.X], row[board_row.Y], row[board_row.HEADING], row[board_row.SPEED]) == (*START, 0.0)


def test_prediction_between_reports_is_limited_to_half_a_second():
    found = DeadReckoning((0.0, 0.0, 0.0), 1.5, 0.7)
    found.add(0, 2.0, 0.0)
    assert found.board_row(100 * MS)[board_row.X] == pytest.approx(0.2)
    assert found.board_row(9000 * MS)[board_row.X] == pytest.approx(1.0), "half a second's worth"


@pytest.mark.parametrize(("stamp", "speed"), [(10 * MS, 5.0), (20 * MS, 5.0), (30 * MS, math.nan)])
def test_old_and_non_finite_reports_are_ignored(stamp, speed):
    found = DeadReckoning((0.0, 0.0, 0.0), 1.5, 0.7)
    found.add(0, 1.0, 0.0)
    found.add(20 * MS, 1.0, 0.0)
    found.add(stamp, speed, 0.0)
    assert found.board_row(40 * MS)[board_row.X] == pytest.approx(0.04)


def test_report_stamped_later_than_now_is_ignored_and_does_not_block_later_ones():
    found = DeadReckoning((0.0, 0.0, 0.0), 1.5, 0.7)
    found.add(0, 1.0, 0.0, 0)
    found.add(3_600_000 * MS, 5.0, 0.0, 10 * MS)
    found.add(20 * MS, 1.0, 0.0, 20 * MS)
    assert found.board_row(40 * MS)[board_row.X] == pytest.approx(0.04)
