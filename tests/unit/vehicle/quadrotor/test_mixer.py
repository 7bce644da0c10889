"""Control allocation: the asked torques within the motor limits, the priorities of PX4 beyond them."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vehicle.quadrotor import airframe as af
from vehicle.quadrotor import airframe_row
from vehicle.quadrotor.mixer import mix, mix_freely

PAPER = af.load_airframe("paper_quad").params_row()
A, B = PAPER[airframe_row.MIXER_ROLL_PITCH], PAPER[airframe_row.MIXER_YAW]
torque = st.floats(-1.0, 1.0)


@given(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(-0.1, 0.1), st.floats(0.4, 0.6))
def test_unsaturated_mix_gives_the_asked_torques(roll, pitch, yaw, thrust):
    u = np.array(mix(roll, pitch, yaw, thrust, A, B))
    assert u.mean() == pytest.approx(thrust)
    assert mix_freely(roll, pitch, yaw, thrust, A, B) == (tuple(u), 0.0)
    assert (-u[0] + u[1] + u[2] - u[3]) / (4 * A) == pytest.approx(roll, abs=1e-12)
    assert (-u[0] + u[1] - u[2] + u[3]) / (4 * A) == pytest.approx(pitch, abs=1e-12)
    assert (-u[0] - u[1] + u[2] + u[3]) / (4 * B) == pytest.approx(yaw, abs=1e-12)


@given(torque, torque, torque, st.floats(0.0, 1.0))
def test_a_saturated_mix_stays_in_range_and_never_adds_thrust(roll, pitch, yaw, thrust):
    u = np.array(mix(roll, pitch, yaw, thrust, A, B))
    assert u.min() >= 0.0 and u.max() <= 1.0
    # Motors that the last clip raises from below zero may add a little, as they do in PX4.
    assert u.mean() <= thrust + 0.08


def test_mixer_prefers_roll_over_thrust_and_yaw():
    full = np.array(mix(0.3, 0.0, 0.0, 1.0, A, B))
    assert (-full[0] + full[1] + full[2] - full[3]) / (4 * A) == pytest.approx(0.3)
    assert full.mean() < 0.85
    both = np.array(mix(0.3, 0.0, 1.0, 0.3, A, B))
    assert (-both[0] + both[1] + both[2] - both[3]) / (4 * A) == pytest.approx(0.3)
    assert 0.0 < (-both[0] - both[1] + both[2] + both[3]) / 4 < 0.5


def test_without_thrust_there_is_no_torque():
    assert mix(0.5, -0.5, 0.5, 0.0, A, B) == pytest.approx((0.0,) * 4, abs=1e-12)


@given(torque, torque, torque, st.floats(0.0, 1.0))
def test_free_mix_equals_the_mix_without_saturation(roll, pitch, yaw, thrust):
    freely, saturated = mix_freely(roll, pitch, yaw, thrust, A, B)
    assert saturated == 1.0 or freely == mix(roll, pitch, yaw, thrust, A, B)


def test_numbers_that_are_not_finite_count_as_saturated():
    assert mix_freely(np.nan, 0.0, 0.0, 0.5, A, B)[1] == 1.0
