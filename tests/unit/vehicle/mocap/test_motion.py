import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel.rotations import from_rotation_vector, multiply
from vehicle.mocap.motion import SAMPLES, BodyMotion

MS = 1_000_000
LEVEL = (1.0, 0.0, 0.0, 0.0)
numbers = st.floats(-3.0, 3.0)
vectors = st.tuples(numbers, numbers, numbers)


@given(vectors, vectors, st.floats(-2.0, 2.0), st.sampled_from([4, 10, 17]))
def test_constant_acceleration_and_turning_are_found_exactly(velocity, acceleration, turn, step_ms):
    motion, found = BodyMotion(), None
    for k in range(SAMPLES + 3):
        t = k * step_ms * 1e-3
        position = tuple(1.0 + v * t + 0.5 * a * t * t for v, a in zip(velocity, acceleration, strict=True))
        turned = multiply(from_rotation_vector(0.3, -0.2, 0.9), from_rotation_vector(0.0, 0.0, turn * t))
        found = motion.add(k * step_ms * MS, position, turned)
    now = (SAMPLES + 2) * step_ms * 1e-3
    assert found is not None
    assert found[0] == pytest.approx([v + a * now for v, a in zip(velocity, acceleration, strict=True)], abs=1e-6)
    assert found[1] == pytest.approx((0.0, 0.0, turn), abs=1e-6), "about the body's own axis"


def test_motion_is_independent_of_the_quaternion_s_sign():
    motion, found = BodyMotion(), None
    for k in range(8):
        q = from_rotation_vector(0.0, 0.01 * k, 0.0)
        found = motion.add(k * 10 * MS, (0.0, 0.0, 0.0), tuple(-c for c in q) if k % 2 else q)
    assert found[1] == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)


def test_motion_is_zero_before_three_poses():
    motion = BodyMotion()
    assert motion.add(0, (0.0, 0.0, 0.0), LEVEL) == ((0.0,) * 3, (0.0,) * 3)
    assert motion.add(10 * MS, (1.0, 0.0, 0.0), LEVEL) == ((0.0,) * 3, (0.0,) * 3)
    assert motion.add(20 * MS, (2.0, 0.0, 0.0), LEVEL)[0] == pytest.approx((100.0, 0.0, 0.0))


def test_poses_before_a_gap_are_dropped():
    motion = BodyMotion()
    for k in range(8):
        motion.add(k * 10 * MS, (0.01 * k, 0.0, 0.0), LEVEL)
    assert motion.add(400 * MS, (9.0, 0.0, 0.0), LEVEL) == ((0.0,) * 3, (0.0,) * 3)


@pytest.mark.parametrize(
    ("stamp", "position", "orientation"),
    [
        (50 * MS, (math.nan, 0.0, 0.0), LEVEL),
        (50 * MS, (0.0, math.inf, 0.0), LEVEL),
        (50 * MS, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0)),
        (20 * MS, (0.0, 0.0, 0.0), LEVEL),  # no newer than the last
    ],
)
def test_invalid_and_old_poses_are_refused_without_effect(stamp, position, orientation):
    motion = BodyMotion()
    for k in range(3):
        motion.add(k * 10 * MS, (0.01 * k, 0.0, 0.0), LEVEL)
    assert motion.add(stamp, position, orientation) is None
    assert motion.add(60 * MS, (0.06, 0.0, 0.0), LEVEL)[0] == pytest.approx((1.0, 0.0, 0.0))


def test_pose_stamped_later_than_now_is_refused_and_does_not_block_later_ones():
    motion = BodyMotion()
    assert motion.add(0, (0.0, 0.0, 0.0), LEVEL, 5 * MS) is not None
    assert motion.add(3_600_000 * MS, (9.0, 0.0, 0.0), LEVEL, 10 * MS) is None
    assert motion.add(10 * MS, (0.0, 0.0, 0.0), LEVEL, 15 * MS) is not None
