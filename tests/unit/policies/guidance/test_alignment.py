"""Terminal attitude alignment: what the corrected body rates lead to, and what they leave alone."""

import math

import numpy as np
import pytest

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z, from_rotation_vector, integrate
from policies.guidance.alignment import align, lean_now
from tests.unit.policies.guidance.situation import PARAMS, situation
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

AIRFRAME = load_airframe("paper_quad")
LEAN, LAG, BAND, FROM = PARAMS.lean, PARAMS.rate_lag, PARAMS.align_band, PARAMS.align_within
SHORTEST, RATE_MAX = PARAMS.align_shortest, PARAMS.rate_max


def corrected(board, p, v, q, out, before=(0.0, 0.0), lean=LEAN, sigma=0.0):
    out, asked = np.array(out, dtype=np.float64), np.array(out, dtype=np.float64)
    changed = align(p, v, q, board, sigma, lean, np.array([*before, 0.0, 9.0]), PARAMS.row(), out)
    assert changed == (out != asked).any()
    return out


def contact_angle(lean, tilt, turn, law):
    """Fly on to contact, rates following with a first-order lag; the angle there between body z and normal."""
    board, p, v, q = situation(1.0, lean, tilt, FROM, turn=turn)
    dt, asked, rate = 0.002, np.zeros(4), np.zeros(3)
    for k in range(round(FROM / dt)):
        if law and k % 5 == 0:
            asked = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0], asked[:2])
        rate += (asked[:3] - rate) * dt / LAG
        q = np.array(integrate(q, *rate, dt))
        p, board[:2] = p + v * dt, board[:2] + dt * board[4] * np.array([math.cos(0.4), math.sin(0.4)])
        board[3] += turn * dt
    return math.acos(min(1.0, float(np.array(board_normal(board)) @ np.array(body_z(q)))))


@pytest.mark.parametrize("lean, tilt", [(0.23, 0.0), (-0.3, 0.0), (0.0, 0.22), (0.1, -0.2), (-0.2, 0.15)])
def test_alignment_brings_a_misaligned_approach_within_tolerance(lean, tilt):
    assert contact_angle(lean, tilt, turn=0.0, law=False) > 0.2
    assert contact_angle(lean, tilt, turn=0.0, law=True) < 0.2


def test_alignment_aims_at_the_attitude_of_a_turning_board_at_contact():
    still, turning = (situation(1.2, LEAN * math.sin(1.2), 0.0, 0.12, turn=turn) for turn in (0.0, 1.2))
    assert corrected(*still, [0.0, 0.0, 0.0, 9.0])[:2].tolist() == [0.0, 0.0]
    board, p, v, q = turning
    out = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0])
    later, then = board.copy(), integrate(q, *out[:3], 0.08)
    later[3] += 0.12 * 1.2
    facing = np.array(board_normal(later))
    assert facing @ np.array(body_z(then)) > facing @ np.array(body_z(q))


def test_aligned_approach_is_unchanged():
    here = situation(1.0, LEAN * math.sin(1.0), 0.0, 0.1)
    asked = [0.3, -0.2, 0.4, 11.0]
    assert corrected(*here, asked).tolist() == asked


@pytest.mark.parametrize(
    "change",
    [
        {"left": FROM + 0.01},
        {"closing": 0.05},
        {"closing": -0.5},
        {"beside": PARAMS.align_offset + 0.02},
        {"tilt": 1.3},
    ],
    ids=str,
)
def test_alignment_leaves_rates_unchanged_outside_its_condition(change):
    here = situation(**{"inclination": 1.0, "lean": 0.35, "tilt": 0.0, "left": 0.1} | change)
    asked = [0.3, -0.2, 0.4, 11.0]
    assert corrected(*here, asked).tolist() == asked


def test_yaw_rate_and_thrust_unchanged_and_rates_within_limit():
    out = corrected(*situation(1.0, -1.0, 0.0, 0.05), [0.0, 0.0, 0.4, 11.0])
    assert out[2:].tolist() == [0.4, 11.0]
    assert np.abs(out[:2]).max() == RATE_MAX


def test_alignment_rate_on_a_flat_board_agrees_with_hand_calculation():
    # Level but for 0.2 rad to the right: 0.12 rad too much, in the shortest span.
    board, p, v, q = situation(0.0, 0.0, 0.2, 0.05, heading=0.0, turn=0.0)
    q = np.array(from_rotation_vector(0.2, 0.0, 0.0))
    out = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0])
    assert out[0] == pytest.approx(-(math.sin(0.2) - BAND) / SHORTEST, rel=1e-9)
    assert out[1] == pytest.approx(0.0, abs=1e-9)
    # A rate asked before goes on for 40 ms and takes its part off.
    less = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0], before=(-1.0, 0.0))
    assert less[0] == pytest.approx(-(math.sin(0.2) - 0.04 - BAND) / SHORTEST, rel=1e-9)


def test_alignment_banks_into_the_turn_of_a_fast_turning_board():
    # 2 m/s at -1.2 rad/s takes 0.245 rad of bank to the right: 0.4 of what exceeds 0.18 of it.
    board, p, v, _ = situation(0.0, 0.0, 0.0, 0.0, heading=0.0, turn=-1.2)
    bank = PARAMS.bank_share * (2.0 * 1.2 / GRAVITY - PARAMS.bank_from)
    assert 0.02 < bank < PARAMS.bank_most

    def roll_rate(roll):
        q = np.array(from_rotation_vector(roll, 0.0, 0.0))
        return corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0])[0]

    axis = np.array([0.0, -bank, 1.0])  # not normalised, as rates are
    for roll in (0.2, -0.2):
        off = float(np.cross(body_z(from_rotation_vector(roll, 0.0, 0.0)), axis)[0])
        assert roll_rate(roll) == pytest.approx((off - math.copysign(BAND, off)) / SHORTEST, rel=1e-9)
    assert roll_rate(bank + 0.9 * BAND) == 0.0 < roll_rate(-0.9 * BAND)


def test_alignment_starts_earlier_with_an_uncertain_surface():
    here = situation(0.0, 0.0, 0.25, FROM + 0.04, closing=0.4)
    asked = [0.0, 0.0, 0.0, 9.0]
    assert corrected(*here, asked).tolist() == asked
    assert corrected(*here, asked, sigma=0.004).tolist() == asked  # 12 mm at 0.4 m/s: 30 ms
    turned = [abs(corrected(*here, asked, sigma=sigma)[0]) for sigma in (0.007, 1.0)]
    assert 0.5 < turned[0] == turned[1] < RATE_MAX


@pytest.mark.parametrize("sigma, share", [(0.0005, 0.0), (0.004, 0.5), (0.015, 1.0)])
@pytest.mark.parametrize("inclination", [0.3, 0.6, 1.0])
def test_lean_grows_where_the_surface_is_poorly_known(inclination, sigma, share):
    board, g = np.array([0.0, 0.0, 1.5, 0.4, 1.0, 0.0, inclination, 0.0]), PARAMS.of(AIRFRAME).row()
    more = 0.07 * share / max(0.5, math.sin(inclination))
    assert lean_now(board, sigma, g) == pytest.approx(LEAN + more, abs=1e-12)
