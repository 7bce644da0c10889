import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.contract.messages import VehicleState
from hil.safety.descent import height_lost


def vehicle(sinks, tilt_deg=0.0, yaw=0.0):
    half, turn = math.radians(tilt_deg) / 2, yaw / 2
    tilted = (math.cos(half) * math.cos(turn), -math.sin(half) * math.sin(turn), math.sin(half) * math.cos(turn))
    q = (*tilted, math.cos(half) * math.sin(turn))
    return VehicleState(0, (0.0, 0.0, 2.0), (6.0, 0.0, -sinks), q, (0.0, 0.0, 0.0))


def test_upright_vehicle_brakes_at_2_5_m_s2():
    assert height_lost(vehicle(3.0)) == pytest.approx(9.0 / 5.0)
    assert height_lost(vehicle(3.0, tilt_deg=17.0)) == pytest.approx(9.0 / 5.0)
    assert height_lost(vehicle(-1.0)) == 0.0


def test_vehicle_that_lies_on_its_side_and_sinks_is_not_saved_from_2_m():
    # A flight behind a board that was not there: it met the ground at 2.3 m/s, braking from 0.12 s later on.
    assert height_lost(vehicle(2.16, tilt_deg=79.0)) > 1.94


@pytest.mark.parametrize(
    ("sinks", "tilt_deg", "height"), [(0.85, 63.0, 1.11), (0.99, 54.0, 1.09), (0.53, 63.0, 1.18), (0.66, 38.0, 1.22)]
)
def test_dive_at_a_board_leaves_a_quarter_of_a_metre(sinks, tilt_deg, height):
    assert height_lost(vehicle(sinks, tilt_deg)) < height - 0.25


@given(st.floats(-3, 8), st.floats(0, 179), st.floats(0.01, 1), st.floats(-3, 3))
def test_more_sink_and_more_tilt_take_more_height_whatever_the_yaw(sinks, tilt, more, yaw):
    here = height_lost(vehicle(sinks, tilt, yaw))
    assert here == pytest.approx(height_lost(vehicle(sinks, tilt)), abs=1e-6)
    assert height_lost(vehicle(sinks + more, tilt)) >= here - 1e-9
    if sinks >= 0.0:
        assert height_lost(vehicle(sinks, min(179.0, tilt + 10 * more))) >= here - 1e-6
