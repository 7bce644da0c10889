import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.planner import polynomial as poly

number = st.floats(-5.0, 5.0)


@settings(max_examples=60, deadline=None)
@given(number, number, number, number, number, number, st.floats(0.3, 3.0), st.floats(0.0, 1.0))
def test_motion_meets_both_ends_and_flatten_reduces_the_terminal_jerk(p0, v0, a0, p1, v1, a1, duration, flatten):
    c, plain = np.zeros(21), np.zeros(21)
    poly.fit_axis(p0, v0, a0, p1, v1, a1, duration, flatten, c, 7)
    poly.fit_axis(p0, v0, a0, p1, v1, a1, duration, 0.0, plain, 7)
    scale = 1e-6 * (1 + 100 / duration**3)
    for t, expected in ((0.0, (p0, v0, a0)), (duration, (p1, v1, a1))):
        got = (poly.position(c, 7, t), poly.velocity(c, 7, t), poly.acceleration(c, 7, t))
        assert got == pytest.approx(expected, abs=scale)
    before, after = poly.jerk(plain, 7, duration), poly.jerk(c, 7, duration)
    assert after == pytest.approx((1 - flatten) * before, abs=scale * 10 + 1e-9 * abs(before))
    assert np.all(c[:7] == 0) and np.all(c[14:] == 0)


def test_derivatives_agree_with_differences():
    c, h = np.zeros(7), 1e-5
    poly.fit_axis(0.0, 1.0, 2.0, 3.0, -1.0, 0.5, 1.4, 0.3, c, 0)
    for t in (0.2, 0.7, 1.1):
        for low, high in (
            (poly.position, poly.velocity),
            (poly.velocity, poly.acceleration),
            (poly.acceleration, poly.jerk),
        ):
            assert high(c, 0, t) == pytest.approx((low(c, 0, t + h) - low(c, 0, t - h)) / (2 * h), abs=1e-5)
