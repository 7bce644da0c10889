import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.motion.kinematics import accelerate, drive, wheel_speeds, wrap

SPEED, RATE = st.floats(-3, 3), st.floats(-2.5, 2.5)


@settings(max_examples=200)
@given(speed=SPEED, rate=RATE, heading=st.floats(-3, 3), dt=st.floats(1e-3, 3.0))
def test_drive_follows_the_circle(speed, rate, heading, dt):
    x, y, after = drive(1.0, 2.0, heading, speed, rate, dt)
    if abs(rate) < 1e-3:
        expected = (1.0 + speed * dt * math.cos(heading), 2.0 + speed * dt * math.sin(heading))
        assert (x, y) == pytest.approx(expected, abs=2e-2)
    else:
        radius = speed / rate
        expected = (
            1.0 + radius * (math.sin(heading + rate * dt) - math.sin(heading)),
            2.0 - radius * (math.cos(heading + rate * dt) - math.cos(heading)),
        )
        assert (x, y) == pytest.approx(expected, abs=1e-9)
    assert after == pytest.approx(heading + rate * dt)


@settings(max_examples=100)
@given(speed=SPEED, rate=RATE, parts=st.integers(2, 9))
def test_many_small_steps_equal_a_large_one(speed, rate, parts):
    pose = (0.0, 0.0, 0.5)
    for _ in range(parts):
        pose = drive(*pose, speed, rate, 1.2 / parts)
    assert pose == pytest.approx(drive(0.0, 0.0, 0.5, speed, rate, 1.2), abs=1e-9)


@given(speed=SPEED, rate=RATE)
def test_mean_and_difference_of_wheel_speeds_are_speed_and_turn_rate(speed, rate):
    left, right = wheel_speeds(speed, rate, 0.4165)
    assert (0.5 * (left + right), (right - left) / 0.4165) == pytest.approx((speed, rate), abs=1e-12)


def test_positive_turn_rate_is_counter_clockwise():
    left, right = wheel_speeds(1.0, 0.5, 0.4)
    assert left < right
    _, y, _ = drive(0.0, 0.0, 0.0, 1.0, 0.5, 0.5)
    assert y > 0.0


def test_accelerate_is_bounded_and_arrives():
    assert accelerate(0.0, 1.0, 2.0, 0.1) == pytest.approx(0.2)
    assert accelerate(0.0, -1.0, 2.0, 0.1) == pytest.approx(-0.2)
    assert accelerate(0.95, 1.0, 2.0, 0.1) == 1.0


@given(angle=st.floats(-50, 50))
def test_wrapped_angle_is_within_half_open_range(angle):
    wrapped = wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.cos(wrapped - angle) == pytest.approx(1.0)
