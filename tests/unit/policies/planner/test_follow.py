import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.planner import follow as pf
from policies.planner.policy import planner_params
from vehicle.camera.pinhole import Camera, board_row_visibility
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import load_airframe
from vehicle.quadrotor.dynamics import vehicle_row
from vehicle.quadrotor.rate_control import fly

PARAMS = planner_params(load_airframe("paper_quad"))
ROW = PARAMS.row()


def fly_follow(inclination, speed, turn, seconds, start=(-2.0, 1.0, 3.2)):
    airframe = load_airframe("paper_quad")
    params, camera = airframe.params_row(), Camera().row()
    row, out = vehicle_row(start, motor=airframe.hover_thrust), np.zeros(4)
    board, seen = np.array([0, 0, 1.5, 0.0, speed, turn, inclination, 0.0]), []
    for _ in range(int(seconds * 100)):
        pf.follow(
            row[state_row.P : state_row.P + 3],
            row[state_row.V : state_row.V + 3],
            row[state_row.Q : state_row.Q + 4],
            board,
            0.0,
            1.0,
            ROW,
            out,
        )
        fly(row, out, params, 0.01, 5)
        board[3] += 0.01 * turn
        board[0] += 0.01 * speed * math.cos(board[3])
        board[1] += 0.01 * speed * math.sin(board[3])
        seen.append(
            board_row_visibility(row[state_row.P : state_row.P + 3], row[state_row.Q : state_row.Q + 4], board, camera)
        )
    return row, board, np.array(seen)


@pytest.mark.parametrize(
    ("inclination", "speed", "turn"), [(0.0, 0.0, 0.0), (0.5, 1.5, 0.0), (0.7, 2.0, 0.3), (0.2, -1.0, 0.0)]
)
def test_follow_settles_behind_and_above_the_board_and_keeps_it_in_view(inclination, speed, turn):
    row, board, seen = fly_follow(inclination, speed, turn, 7.0)
    c, s = math.cos(board[3]), math.sin(board[3])
    d = row[state_row.P : state_row.P + 3] - board[:3]
    behind, aside = -(d[0] * c + d[1] * s), -s * d[0] + c * d[1]
    up = PARAMS.follow.elevation_flat + min(1.0, inclination / math.radians(60)) * (
        PARAMS.follow.elevation - PARAMS.follow.elevation_flat
    )
    assert math.hypot(behind, aside) == pytest.approx(math.hypot(d[0], d[1]))
    assert abs(aside) < 0.35 and d[2] / behind == pytest.approx(math.tan(up), rel=0.15)
    relative = row[state_row.V : state_row.V + 2] - speed * np.array([c, s]) - turn * np.array([-d[1], d[0]])
    assert np.linalg.norm(relative) < 0.3
    assert seen[300:].mean() > 0.9


@settings(max_examples=60, deadline=None)
@given(st.floats(-9, 9), st.floats(-9, 9), st.floats(0.8, 5.0), st.floats(-0.5, 2.0), st.floats(-3.0, 3.0))
def test_keep_in_view_limits_only_acceleration_along_the_bearing(ax, ay, away, above, bearing):
    board = np.array([away * math.cos(bearing), away * math.sin(bearing), 1.5, 0, 0, 0, 0, 0.0])
    p = np.array([0.0, 0.0, 1.5 + above])
    bx, by = pf.keep_in_view(ax, ay, p, board, ROW)
    c, s = math.cos(bearing), math.sin(bearing)
    assert -s * bx + c * by == pytest.approx(-s * ax + c * ay, abs=1e-9)
    before, after = c * ax + s * ay, c * bx + s * by
    assert abs(after) <= abs(before) + 1e-9 and after * before >= -1e-9
    assert abs(after) >= min(abs(before), 9.8 * math.tan(math.radians(8.9))) - 1e-9


def test_hold_stops_and_climb_away_moves_upward_and_backward():
    airframe = load_airframe("paper_quad")
    params, out = airframe.params_row(), np.zeros(4)
    row = vehicle_row((0, 0, 3), motor=airframe.hover_thrust)
    row[state_row.V : state_row.V + 3] = 2.0, -1.0, 0.5
    for _ in range(500):
        pf.hold(row[state_row.Q : state_row.Q + 4], row[state_row.V : state_row.V + 3], 0.0, 1.0, ROW, out)
        fly(row, out, params, 0.01, 5)
    assert np.linalg.norm(row[state_row.V : state_row.V + 3]) < 0.15
    board = np.array([0.1, 0, 1.5, 0, 0, 0, 1.2, 0.0])
    row = vehicle_row((-0.1, 0, 1.6), (math.cos(-0.5), 0, math.sin(-0.5), 0), airframe.hover_thrust)
    for _ in range(80):
        pf.climb_away(
            row[state_row.P : state_row.P + 3],
            row[state_row.V : state_row.V + 3],
            row[state_row.Q : state_row.Q + 4],
            board,
            1.0,
            ROW,
            out,
        )
        fly(row, out, params, 0.01, 5)
    assert row[state_row.P] < -0.5 and row[state_row.P + 2] > 0.4
