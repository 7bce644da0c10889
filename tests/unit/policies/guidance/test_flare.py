"""Time-to-go flare: what it saves, and what it leaves alone."""

import math

import numpy as np
import pytest

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z, integrate
from policies.guidance.flare import flare
from tests.unit.policies.guidance.situation import PARAMS, situation
from vehicle.quadrotor.airframe import GRAVITY

LEAN, LAG, RATE_MAX, THRUST_MAX = PARAMS.lean, PARAMS.rate_lag, PARAMS.rate_max, PARAMS.thrust_max
STEEP = math.radians(70.0)
ASKED = [0.3, -0.2, 0.4, 11.0]


def flared(board, p, v, q, out, before=(0.0, 0.0), gain=1.0):
    out, asked = np.array(out, dtype=np.float64), np.array(out, dtype=np.float64)
    changed = flare(p, v, q, board, LEAN, np.array([*before, 0.0, 9.0]), gain, PARAMS.row(), out)
    assert changed == (out != asked).any()
    return out


def fly(law, rate=-2.0, gain=0.8):
    """A weak vehicle with all its thrust on, 0.75 m before a steep board, turning as gently as networks did: the angle
    between body z and normal at contact, rad."""
    board, p, v, q = situation(STEEP, 1.05, 0.0, 0.2, closing=3.2, speed=0.0, heading=0.0)
    n = np.array(board_normal(board))
    asked, rates, dt = np.array([0.0, rate, 0.0, 0.0]), np.array([0.0, rate, 0.0]), 0.002
    for k in range(500):
        z = np.array(body_z(q))
        cosine = float(n @ z)
        edge = PARAMS.below * cosine + PARAMS.radius * math.sqrt(max(0.0, 1.0 - cosine * cosine))
        if n @ (p - board[:3]) <= edge:
            return math.acos(min(1.0, cosine))
        if k % 5 == 0:
            asked = np.array([0.0, rate, 0.0, 0.0])
            asked = flared(board, p, v, q, asked, rates[:2], gain) if law else asked
        rates = rates + (asked[:3] - rates) * dt / LAG
        q = np.array(integrate(q, *rates, dt))
        v = v + dt * (gain * THRUST_MAX * z - np.array([0.0, 0.0, GRAVITY]))
        p = p + dt * v
    raise AssertionError("it never met the board")


def test_late_turn_ends_within_tolerance():
    assert fly(law=False) > 0.3
    assert fly(law=True) < 0.2


def test_turn_with_time_left_is_unchanged():
    here = situation(STEEP, 0.5, 0.0, 0.3, closing=2.0)
    assert flared(*here, ASKED).tolist() == ASKED


def test_last_moment_turn_is_at_the_rate_limit_with_yaw_and_thrust_unchanged():
    out = flared(*situation(STEEP, 1.2, 0.0, 0.15, closing=3.0), ASKED)
    assert out.min() == -RATE_MAX
    assert np.abs(out[:2]).max() == RATE_MAX
    assert out[2:].tolist() == ASKED[2:]


@pytest.mark.parametrize(
    "change",
    [{"closing": PARAMS.flare_closing - 0.1}, {"beside": PARAMS.flare_offset + 0.1}, {"lean": 1.7}, {"left": 0.6}],
    ids=str,
)
def test_flare_leaves_rates_unchanged_outside_its_condition(change):
    late = {"inclination": STEEP, "lean": 1.2, "tilt": 0.0, "left": 0.15, "closing": 3.0}
    assert flared(*situation(**late), ASKED).tolist() != ASKED
    assert flared(*situation(**late | change), ASKED).tolist() == ASKED
