import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.task import contact as c
from policies.task import result_row
from vehicle.quadrotor.airframe import load_airframe

RULES = c.ContactRules()
DISC = load_airframe("paper_quad").contact


def board(inclination=0.0, heading=0.0, speed=0.0, turn_rate=0.0, at=(0.0, 0.0, 1.5)):
    return np.array([*at, heading, speed, turn_rate, inclination, 0.0])


def axes(board):
    h, i = board[3], board[6]
    up = np.array([math.cos(i) * math.cos(h), math.cos(i) * math.sin(h), math.sin(i)])
    left = np.array([-math.sin(h), math.cos(h), 0.0])
    return up, left, np.cross(up, left)


def aligned(board):
    """Quaternion of a body whose axes are the board's: Rz(heading) Ry(-inclination)."""
    h, i = board[3] / 2, -board[6] / 2
    return np.array(
        [math.cos(h) * math.cos(i), -math.sin(h) * math.sin(i), math.cos(h) * math.sin(i), math.sin(h) * math.cos(i)]
    )


def contact_result(board, x=0.0, y=0.0, depth=0.002, normal=-0.5, along=0.0, q=None, elapsed=1.0, rules=RULES):
    up, left, n = axes(board)
    car = board[4] * np.array([math.cos(board[3]), math.sin(board[3]), 0.0])
    p = board[:3] + x * up + y * left + (DISC.magnet_below - depth) * n
    v = car + normal * n + along * up
    out = np.zeros(result_row.DIM)
    code = c.evaluate(p, v, aligned(board) if q is None else q, np.zeros(3), board, elapsed, rules.row(DISC), out)
    return code, c.view(out)


@settings(max_examples=60)
@given(
    st.floats(0.0, 1.4), st.floats(-3.1, 3.1), st.floats(-3.0, 3.0),
    st.floats(-0.13, 0.13), st.floats(-0.13, 0.13), st.floats(-1.2, -0.2), st.floats(-0.5, 0.5),
)  # fmt: skip
def test_aligned_contact_is_a_success_measured_in_the_board_frame(th, psi, speed, x, y, normal, along):
    code, seen = contact_result(board(th, psi, speed), x, y, normal=normal, along=along)
    assert code == c.SUCCESS and seen.within_tolerance and seen.attached and seen.outcome == "success"
    assert (seen.x, seen.y, seen.normal_speed) == pytest.approx((x, y, normal), abs=1e-9)
    assert seen.planar == pytest.approx(math.hypot(x, y), abs=1e-9)
    assert seen.tangential_speed == pytest.approx(abs(along), abs=1e-9)
    assert seen.normal_error == pytest.approx(0.0, abs=1e-6)
    assert seen.height == pytest.approx(-0.002, abs=1e-6)


def test_contact_begins_at_the_lowest_point_of_a_tilted_disc():
    flat = board()
    assert contact_result(flat, depth=-0.01)[0] == c.ONGOING
    tilt = 0.3
    q = np.array([math.cos(tilt / 2), 0.0, math.sin(tilt / 2), 0.0])
    lowest = DISC.magnet_below * math.cos(tilt) + DISC.footprint_radius * math.sin(tilt)
    out = np.zeros(result_row.DIM)
    for gap, expected in ((0.001, c.ONGOING), (-0.001, c.FAIL)):
        p = flat[:3] + np.array([0.0, 0.0, lowest + gap])
        assert c.evaluate(p, np.array([0, 0, -0.5]), q, np.zeros(3), flat, 0.5, RULES.row(DISC), out) == expected
    assert c.view(out).reason == "alignment" and c.view(out).normal_error == pytest.approx(tilt)


@pytest.mark.parametrize(
    ("kwargs", "reason", "attached"),
    [
        ({"x": 0.205}, "distance", True),
        ({"y": 0.25}, "distance", False),
        ({"along": 0.65}, "tangential_speed", True),
        ({"along": 0.9}, "tangential_speed", False),
        ({"depth": DISC.magnet_below + 0.1}, "behind", False),
        ({"elapsed": 5.01}, "time", False),
    ],
)
def test_each_violated_rule_has_its_reason(kwargs, reason, attached):
    code, seen = contact_result(board(1.0, 0.4, 2.0), **kwargs)
    assert code == c.FAIL and seen.reason == reason and seen.attached is attached and not seen.within_tolerance


def test_hard_contact_is_within_tolerance_but_not_attached():
    code, seen = contact_result(board(0.5), normal=-2.0)
    assert code == c.SUCCESS and seen.within_tolerance and not seen.attached


def test_violations_precede_contact_and_non_finite_state_is_a_failure():
    out = np.zeros(result_row.DIM)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    for p, reason in (
        ((0.0, 0.0, 0.1), "ground"), ((61.0, 0.0, 2.0), "workspace"), ((0.0, 0.0, 9.0), "workspace"),
        ((math.nan, 0.0, 2.0), "not_finite"),
    ):  # fmt: skip
        assert c.evaluate(np.array(p), np.zeros(3), level, np.zeros(3), board(), 0.0, RULES.row(DISC), out) == c.FAIL
        assert c.view(out).reason == reason


def test_far_below_the_plane_but_out_of_reach_is_not_contact():
    out = np.zeros(result_row.DIM)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    p = np.array([0.0, 0.0, 0.9])
    assert c.evaluate(p, np.zeros(3), level, np.zeros(3), board(), 0.0, RULES.row(DISC), out) == c.ONGOING
    p[2] = 1.15
    assert c.evaluate(p, np.zeros(3), level, np.zeros(3), board(), 0.0, RULES.row(DISC), out) == c.FAIL
    assert c.view(out).reason == "behind"


def test_contact_speed_includes_both_turn_rates():
    board_row = board(speed=1.0, turn_rate=1.0)
    x = 0.1
    p = board_row[:3] + np.array([x, 0.0, DISC.magnet_below - 0.001])
    level = np.array([1.0, 0.0, 0.0, 0.0])
    out = np.zeros(result_row.DIM)
    c.evaluate(p, np.array([1.0, x, -0.4]), level, np.array([0.0, 0.0, 1.0]), board_row, 0.0, RULES.row(DISC), out)
    assert c.view(out).tangential_speed == pytest.approx(0.0, abs=1e-12)
    c.evaluate(p, np.array([1.0, x, -0.4]), level, np.array([0.0, 2.0, 0.0]), board_row, 0.0, RULES.row(DISC), out)
    assert c.view(out).tangential_speed == pytest.approx(2.0 * DISC.magnet_below)


def test_contact_bonus_is_one_at_zero_error_and_zero_at_the_tolerances():
    rules, out = RULES.row(DISC), np.zeros(result_row.DIM)
    assert c.accuracy_bonus(out, rules) == pytest.approx(1.0)
    out[result_row.PLANAR], out[result_row.TANGENTIAL_SPEED], out[result_row.NORMAL_ERROR] = (
        RULES.delta_d,
        RULES.delta_v,
        RULES.delta_theta,
    )
    assert c.accuracy_bonus(out, rules) == pytest.approx(0.0)


@pytest.mark.parametrize("bad", [{"delta_d": 0.0}, {"board_r": math.nan}, {"magnet_normal_min": 2.0}])
def test_bad_rules_are_refused_by_name(bad):
    with pytest.raises(ValueError, match=next(iter(bad))):
        c.ContactRules(**bad)
