import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from kernel.rotations import body_z, from_euler, integrate
from policies.planner.policy import planner_params
from policies.planner.tracking import track_force, yaw_error
from vehicle.quadrotor.airframe import load_airframe

PARAMS = planner_params(load_airframe("paper_quad")).row()


@settings(max_examples=40, deadline=None)
@given(st.floats(-1.2, 1.2), st.floats(-1.2, 1.2), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0), st.floats(0.0, 6.28))
def test_following_the_rates_turns_body_z_onto_the_force(roll, pitch, yaw, tilt, azimuth):
    q = np.array(from_euler(roll, pitch, yaw))
    f = 10.0 * np.array([math.sin(tilt) * math.cos(azimuth), math.sin(tilt) * math.sin(azimuth), math.cos(tilt)])
    out = np.zeros(4)
    for _ in range(120):
        track_force(q, *f, *f, 0.0, 0.0, 0.0, 0.0, 10.0, 1.0, PARAMS, out)
        assert abs(out[:3]).max() <= 3.5
        q = np.array(integrate(q, out[0], out[1], out[2], 0.01))
    assert np.dot(body_z(q), f / 10.0) > math.cos(0.01)


def test_rotation_of_the_force_is_fed_forward():
    out = np.zeros(4)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    track_force(level, 0.0, 0.0, 10.0, 0.0, 0.0, 10.0, 5.0, 0.0, 0.0, 0.3, 10.0, 1.0, PARAMS, out)
    assert out == pytest.approx([0.0, 0.5, 0.3, 10.0])


def test_thrust_is_divided_by_the_gain_and_clipped():
    out = np.zeros(4)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    for wanted, gain, asked in ((9.0, 0.9, 10.0), (30.0, 1.0, 14.8), (1.0, 1.0, 4.8)):
        track_force(level, 0.0, 0.0, 9.8, 0.0, 0.0, 9.8, 0.0, 0.0, 0.0, 0.0, wanted, gain, PARAMS, out)
        assert out[3] == pytest.approx(asked)


@settings(max_examples=40, deadline=None)
@given(st.floats(-0.5, 0.5), st.floats(-1.3, 1.3), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_yaw_error_is_the_bearing_seen_from_the_heading_even_in_a_flare(roll, pitch, yaw, bearing):
    q = np.array(from_euler(0.0, pitch, yaw))
    expected = (bearing - yaw + math.pi) % (2 * math.pi) - math.pi
    got = yaw_error(q, math.cos(bearing), math.sin(bearing))
    assert abs((got - expected + math.pi) % (2 * math.pi) - math.pi) < 1e-6


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("number", range(3))
def test_force_that_is_not_finite_gives_no_bound(bad, number):
    out = np.zeros(4)
    force = [0.5, 0.2, 9.8]
    force[number] = bad
    track_force(np.array([1.0, 0.0, 0.0, 0.0]), *force, *force, 0.0, 0.0, 0.0, 0.0, force[2], 1.0, PARAMS, out)
    assert not np.isfinite(out[:2]).all()


def test_thrust_and_yaw_rate_that_are_not_finite_stay_so():
    out = np.zeros(4)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    track_force(level, 0.0, 0.0, 9.8, 0.0, 0.0, 9.8, 0.0, 0.0, 0.0, math.nan, math.inf, 1.0, PARAMS, out)
    assert np.isnan(out[2:]).all()
