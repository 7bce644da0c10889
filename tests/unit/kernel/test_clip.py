import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel.clip import LARGEST, clip, command_within, usable
from kernel.stamps import CLOCK_ERROR_NS, later_than_now


@given(st.floats(-50.0, 50.0))
def test_clip_of_a_finite_number_is_that_of_min_and_max(value):
    assert clip(value, -3.5, 3.5) == command_within(value, -3.5, 3.5) == min(3.5, max(-3.5, value))


def test_nan_is_never_clipped_to_a_bound():
    assert math.isnan(clip(math.nan, -3.5, 3.5))
    assert math.isnan(command_within(math.nan, -3.5, 3.5))


@pytest.mark.parametrize("value", [math.inf, -math.inf])
def test_an_infinite_command_is_no_command(value):
    assert abs(clip(value, -3.5, 3.5)) == 3.5
    assert math.isnan(command_within(value, -3.5, 3.5))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, LARGEST, -1e300])
def test_one_number_that_is_not_usable_makes_all_unusable(bad):
    assert usable((0.0, -5.0, 1e5))
    assert not usable((0.0, bad, 1.0))


def test_stamp_within_the_clock_error_is_not_later_than_now():
    assert not later_than_now(1_000 + CLOCK_ERROR_NS, 1_000)
    assert later_than_now(1_001 + CLOCK_ERROR_NS, 1_000)
    assert not later_than_now(-(2**63), 1_000)
