import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from policies.planner.contact_thrust import contact_thrust
from policies.planner.policy import planner_params
from policies.planner.search import board_normal
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

PARAMS = planner_params(load_airframe("paper_quad")).changed(
    {"vehicle.drag": 0.0, "terminal.keep": 0.0, "terminal.lag": 0.0}
)
ROW, VEHICLE = PARAMS.row(), PARAMS.vehicle


def board(inclination, speed=0.0):
    return np.array([0.0, 0.0, 1.5, 0.0, speed, 0.0, inclination, 0.0])


def land(
    inclination, height, closing, along, left, planned=9.0, lean=0.0, speed=0.0, acceleration=0.0, sigma=0.0, off=0.0
):
    """Fly the last moment with body z `lean` rad from the normal; returns (into, along) the board in m/s at contact.

    The board is `off` m farther along its normal than it is believed to be."""
    board_row, h, t, dt = board(inclination, speed), height, 0.0, 0.0025
    n = np.array(board_normal(board_row))
    u = np.array([math.cos(inclination), 0.0, math.sin(inclination)])
    v = -closing * n + along * u + np.array([speed, 0.0, 0.0])
    z = math.cos(lean) * n + math.sin(lean) * u
    edge = VEHICLE.contact_below * math.cos(lean) + VEHICLE.contact_radius * abs(math.sin(lean))
    for _ in range(400):
        p = board_row[:3] + (h - off + edge) * n
        f = contact_thrust(p, v, *z, board_row, acceleration, left - t, planned, planned, 1.0, sigma, ROW)
        assert VEHICLE.thrust_min - 1e-9 <= f <= VEHICLE.thrust_max + 1e-9
        v = v + dt * (f * z - np.array([0.0, 0.0, GRAVITY]))
        board_row[4] += acceleration * dt
        relative = v - np.array([board_row[4], 0.0, 0.0])
        h += dt * float(relative @ n)
        t += dt
        if h <= 0.0:
            return -float(relative @ n), float(relative @ u)
    return None


def test_contact_with_a_flat_board_has_the_wanted_speed():
    into, along = land(0.0, height=0.25, closing=1.0, along=0.0, left=0.32)
    assert into == pytest.approx(PARAMS.terminal.speed, abs=0.12)
    assert along == pytest.approx(0.0, abs=1e-6)


def test_thrust_brakes_a_fast_approach_and_speeds_up_a_slow_one():
    fast, _ = land(0.3, height=0.2, closing=1.8, along=0.3, left=0.2)
    slow = land(0.3, height=0.1, closing=0.2, along=0.3, left=0.2)
    assert fast < 1.1  # full thrust could not do better than 1.04
    assert slow is not None and slow[0] > 0.2


def test_contact_speed_holds_on_a_braking_board():
    plain = land(1.2, height=0.15, closing=1.2, along=1.2, left=0.15)
    braking = land(1.2, height=0.15, closing=1.2, along=1.2, left=0.15, speed=2.0, acceleration=-2.0)
    assert plain is not None and braking is not None
    assert abs(braking[0] - plain[0]) < 0.35


@pytest.mark.parametrize(("inclination", "speed", "left"), [(0.52, 0.65, 0.14), (1.05, 0.9, 0.12)])
def test_skid_is_smaller_when_the_uncertainty_of_the_surface_is_known(inclination, speed, left):
    worst = {}
    for sigma in (0.0, 0.015):
        met = [land(inclination, 0.1 + off, speed, speed, left, sigma=sigma, off=off) for off in (-0.04, 0.04)]
        worst[sigma] = max(abs(along) for _, along in met)
    assert worst[0.015] < 0.85 * worst[0.0]


@given(
    st.floats(0.0, 1.3), st.floats(0.05, 0.3), st.floats(0.4, 1.6), st.floats(-0.5, 1.5), st.floats(0.02, 0.3),
    st.floats(0.0, 0.1),
)  # fmt: skip
def test_thrust_stays_within_its_limits(inclination, height, closing, along, left, sigma):
    board_row = board(inclination)
    n = np.array(board_normal(board_row))
    u = np.array([math.cos(inclination), 0.0, math.sin(inclination)])
    p = board_row[:3] + (height + VEHICLE.contact_below) * n
    f = contact_thrust(p, along * u - closing * n, *n, board_row, 0.0, left, 9.0, 9.0, 1.0, sigma, ROW)
    assert VEHICLE.thrust_min <= f <= VEHICLE.thrust_max


def test_planned_thrust_is_kept_while_body_z_is_far_from_the_normal():
    p, v, board_row = np.array([-1.0, 0.0, 1.6]), np.zeros(3), board(1.2)
    assert contact_thrust(p, v, 0.0, 0.0, 1.0, board_row, 0.0, 0.2, 9.3, 9.3, 1.0, 0.02, ROW) == 9.3
