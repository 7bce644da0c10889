"""The way to the start, the hover, and its thrust."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel.rotations import from_euler
from tests.unit.vehicle.px4.driver.driver_bench import START
from vehicle.px4.driver.goto import Approach, HoverThrust
from vehicle.px4.driver.types import LinkConfig, Odometry

CONFIG = LinkConfig(start=START, hover_thrust=0.44)


@given(
    st.tuples(*[st.floats(-20, 20)] * 3),
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.lists(st.floats(0.0, 0.2), min_size=300, max_size=300),
)
def test_the_set_point_arrives_within_its_limits(position, velocity, steps):
    approach = Approach(CONFIG)
    approach.begin(position, velocity)
    here, speed = position, None
    for seconds in [*steps, *[0.05] * 2000]:
        there, ahead = approach.advance(seconds)
        assert math.dist(here, there) <= CONFIG.goto_speed * seconds + 0.0021
        assert math.hypot(*ahead) <= CONFIG.goto_speed
        assert math.dist(there, START[:3]) <= math.dist(here, START[:3]) + 1e-9
        here, speed = there, math.hypot(*ahead)
    assert (here, speed) == (START[:3], 0.0)


def at_start(stamp_ns, turning):
    yaw = from_euler(0.0, 0.0, START[3])
    return Odometry(stamp_ns, START[:3], (0.0, 0.0, 0.0), yaw, turning)


def settles(turning):
    """Whether the hover is reached within 3 s of body rates `turning(i)`, 10 ms apart."""
    approach = Approach(CONFIG)
    approach.begin(START[:3], (0.0, 0.0, 0.0))
    return any(approach.settled(i * 10_000_000, at_start(i * 10_000_000, turning(i))) for i in range(1, 300))


def test_hover_is_reached_in_spite_of_a_frames_vibrations_but_not_while_it_turns():
    noise = np.random.default_rng(1).normal(0.0, (0.08, 0.04, 0.016), (300, 3))
    assert settles(lambda i: tuple(noise[i]))
    assert not settles(lambda i: (0.2, 0.0, 0.0))
    assert not settles(lambda i: (0.5 * math.sin(0.01 * i * 2 * math.pi), 0.0, 0.0))


def test_hover_thrust_is_an_average_that_follows():
    learned = HoverThrust(0.44, 0.35)
    learned.add([0.4, 0.5])
    assert not learned.known
    learned.add([0.4, 0.5] * 20)
    assert learned.known
    assert learned.value == pytest.approx(0.45)
    assert learned.complaint() == ""
    learned.add([0.9] * 500)
    assert learned.value == pytest.approx(0.9, abs=0.01)
    assert "0.440" in learned.complaint()
