import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.planner import polynomial as poly
from policies.planner import search as ps
from policies.planner.policy import planner_params
from policies.prediction.future import HORIZON, STEP, board_at, predict_future
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

PARAMS = planner_params(load_airframe("paper_quad"))
ROW = PARAMS.row()


def scene(inclination, speed, turn, behind=1.8, above=0.8):
    future = np.zeros((HORIZON, 8))
    predict_future(np.array([0, 0, 1.5, 0.4, speed, turn, inclination, 0.0]), 1.0, STEP, future)
    c, s = math.cos(0.4), math.sin(0.4)
    start = np.array([-behind * c, -behind * s, 1.5 + above, speed * c, speed * s, 0, 0, 0, 0.0])
    return future, start


def find(future, start, params=ROW, low=0.6, high=2.6, remaining=0.0, gain=1.0):
    best = np.zeros(ps.MOTION_DIM)
    scratch, target, board = np.zeros(ps.MOTION_DIM), np.zeros(8), np.zeros(8)
    found = ps.search(start, future, STEP, 0.0, gain, low, high, 15, remaining, params, best, scratch, target, board)
    return found, best


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 1.0), st.floats(0.0, 2.5), st.floats(-0.5, 0.5))
def test_a_plan_ends_on_the_board_at_the_impact_speed_with_thrust_leaning_up_the_slope(inclination, speed, turn):
    future, start = scene(inclination, speed, turn)
    (cost, duration, thrust), motion = find(future, start)
    assert math.isfinite(cost)
    board, n = np.zeros(8), np.zeros(3)
    board_at(future, STEP, duration, board)
    n[:] = ps.board_normal(board)
    end = [
        np.array([f(motion, 7 * i, duration) for i in range(3)])
        for f in (poly.position, poly.velocity, poly.acceleration)
    ]
    offset = PARAMS.vehicle.contact_below - PARAMS.contact.overshoot
    assert end[0] == pytest.approx(board[:3] + offset * n, abs=1e-6)
    relative = end[1] - board[4] * np.array([math.cos(board[3]), math.sin(board[3]), 0.0])
    assert relative @ n == pytest.approx(-PARAMS.contact.speed, abs=1e-6)
    assert np.linalg.norm(relative - (relative @ n) * n) <= PARAMS.contact.skid + 1e-6
    force = end[2] + PARAMS.vehicle.drag * end[1] + np.array([0, 0, GRAVITY])
    lean = PARAMS.contact.lean * min(1.0, 2.0 * math.sin(inclination))
    up = np.array([n[2] * math.cos(board[3]), n[2] * math.sin(board[3]), math.sin(inclination)])
    assert force == pytest.approx(thrust * (math.cos(lean) * n + math.sin(lean) * up), abs=1e-5)


def test_a_cheap_plan_stays_over_the_board_s_plane_and_within_the_thrust():
    future, start = scene(0.6, 1.0, 0.0)
    (cost, duration, _), motion = find(future, start)
    assert cost < 3.0
    board = np.zeros(8)
    for t in np.linspace(0.0, duration - 0.05, 60):
        board_at(future, STEP, t, board)
        p = np.array([poly.position(motion, 7 * i, t) for i in range(3)])
        assert np.dot(ps.board_normal(board), p - board[:3]) > 0.0 and p[2] > 0.3
        a = np.array([poly.acceleration(motion, 7 * i, t) for i in range(3)])
        v = np.array([poly.velocity(motion, 7 * i, t) for i in range(3)])
        force = np.linalg.norm(a + PARAMS.vehicle.drag * v + np.array([0, 0, GRAVITY]))
        assert 4.0 < force < 15.5


def test_postponing_contact_costs_and_the_impossible_is_expensive():
    future, start = scene(0.5, 1.0, 0.0)
    (free, duration, _), _ = find(future, start)
    (held, _, _), _ = find(future, start, remaining=duration - 0.4, low=duration, high=duration + 0.2)
    assert held - free == pytest.approx(0.4 * PARAMS.weights.postpone, abs=0.4)
    (rushed, _, _), _ = find(future, start, low=0.25, high=0.3)
    assert rushed > 20.0


def test_motion_that_loses_the_board_from_view_costs_more():
    future, start = scene(0.0, 2.0, 0.0, behind=2.5, above=0.1)
    blind = PARAMS.changed({"weights.visibility": 0.0}).row()
    (with_view, _, _), _ = find(future, start)
    (without, _, _), _ = find(future, start, params=blind)
    assert with_view > without + 0.2
