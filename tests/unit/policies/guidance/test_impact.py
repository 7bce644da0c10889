"""Impact-speed limit: how fast the contact then is, that thrust is only raised, and when it is left alone."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z
from policies.guidance.impact import limit_impact
from tests.unit.policies.guidance.situation import PARAMS, situation
from vehicle.quadrotor.airframe import GRAVITY

INTO, WITHIN, LOW, HIGH = PARAMS.impact_speed, PARAMS.impact_within, PARAMS.thrust_min, PARAMS.thrust_max
DRAG = 0.2


def braked(here, thrust=8.8, previous=8.8, gain=1.0, sigma=0.001):
    board, p, v, q = here
    out = np.array([0.1, -0.4, 0.2, thrust])
    before = np.array([0.0, 0.0, 0.0, previous])
    changed = limit_impact(p, v, q, board, sigma, before, gain, DRAG, PARAMS.row(), out)
    assert out[:3].tolist() == [0.1, -0.4, 0.2]
    assert changed == (out[3] != thrust)
    return float(out[3])


def climbing(inclination, closing, left):
    """On its way to a contact without sliding: gravity takes the speed that it has up the slope."""
    board, p, v, q = situation(inclination, 0.0, 0.0, left, closing=closing)
    c, s = math.cos(board[3]), math.sin(board[3])
    up = np.array([math.cos(inclination) * c, math.cos(inclination) * s, math.sin(inclination)])
    return board, p, v + left * GRAVITY * math.sin(inclination) * up, q


def impact(inclination, closing, thrust, gain, law):
    """Speed into the board (m/s) after WITHIN s of thrust alone, motors following with their lag."""
    board, p, v, q = climbing(inclination, closing, WITHIN)
    n, z = np.array(board_normal(board)), np.array(body_z(q))
    dt, asked, given = 0.001, thrust, thrust
    ahead = board[4] * np.array([math.cos(board[3]), math.sin(board[3]), 0.0])
    for k in range(400):
        if law and k % 10 == 0:
            asked = braked((board, p, v, q), thrust, asked, gain)
        given += (asked - given) * dt / PARAMS.thrust_lag
        v = v + dt * (gain * given * z - np.array([0.0, 0.0, GRAVITY]) - DRAG * v)
        p, board[:3] = p + dt * v, board[:3] + dt * ahead
        if (p - board[:3]) @ n < PARAMS.below + 0.1 * PARAMS.radius:
            return float(-(v - ahead) @ n)
    raise AssertionError("it never met the board")


@pytest.mark.parametrize("gain", [0.85, 1.0, 1.15])
@pytest.mark.parametrize(("inclination", "closing"), [(0.0, 0.9), (0.8, 0.8), (1.2, 1.2), (1.2, 1.3)])
def test_fast_approach_ends_near_the_impact_speed(inclination, closing, gain):
    thrust = max(LOW, GRAVITY * math.cos(inclination) / gain)
    free, limited = (impact(inclination, closing, thrust, gain, law) for law in (False, True))
    assert free > 0.7
    assert INTO - 0.1 < limited < max(INTO + 0.1, free - 0.1)


@given(
    st.floats(0.0, 1.4), st.floats(-0.5, 0.5), st.floats(-0.05, 0.3), st.floats(0.0, 2.0), st.floats(0.6, 1.3),
    st.floats(LOW, HIGH), st.floats(LOW, HIGH),
)  # fmt: skip
def test_thrust_is_only_raised_and_within_its_limit(inclination, lean, left, closing, gain, thrust, previous):
    here = situation(inclination, lean, 0.1, left, closing=closing)
    assert thrust <= braked(here, thrust, previous, gain) <= HIGH


def test_previous_higher_braking_thrust_is_kept():
    assert braked(situation(0.0, 0.0, 0.0, 0.1, closing=0.6), 14.3, previous=14.3) == 14.3


def test_impact_thrust_on_a_flat_board_agrees_with_hand_calculation():
    height, closing, lag = 0.1 * 0.8 - 0.1 * PARAMS.radius, 0.8, PARAMS.thrust_lag
    work = 0.5 * (closing**2 - INTO**2) + (GRAVITY - DRAG * closing) * (height + 0.01) - 8.8 * lag * closing
    thrust = work / (height + 0.01 - lag * closing)
    assert 8.8 < thrust < HIGH
    assert braked(situation(0.0, 0.0, 0.0, 0.1, closing=closing)) == pytest.approx(thrust, abs=1e-9)


def tilted():
    """Body z farther off the normal than the law allows, on its way to a contact without sliding."""
    board, p, v, q = situation(0.0, 0.66, 0.0, 0.02, closing=0.9)
    zx, zy, _ = body_z(q)
    return board, p, v - 0.45 * np.array([zx, zy, 0.0]), q


@pytest.mark.parametrize(
    "here",
    [situation(0.0, 0.0, 0.0, WITHIN + 0.03, closing=0.9), situation(0.0, 0.0, 0.0, 0.1, closing=0.45), tilted(),
     situation(0.0, 0.0, 0.0, 0.1, closing=0.9, beside=0.4), climbing(1.2, 0.9, -0.02)],
    ids=["far", "slow", "tilted", "beside", "through"],
)  # fmt: skip
def test_thrust_unchanged_outside_the_condition(here):
    assert braked(here, 5.3, previous=5.3) == 5.3


def test_braking_is_scaled_down_with_the_uncertainty_of_the_surface():
    full, half, none = (
        braked(climbing(1.2, 0.9, 0.1), 5.3, previous=5.3, sigma=sigma) - 5.3 for sigma in (0.002, 0.004, 0.006)
    )
    assert full > 1.0
    assert none == 0.0
    assert half == pytest.approx(0.5 * full, abs=1e-9)


def test_sliding_vehicle_is_not_braked():
    board, p, v, q = situation(0.0, 0.0, 0.0, 0.1, closing=0.9)
    aside = np.array([-math.sin(0.4), math.cos(0.4), 0.0])
    raised = [braked((board, p, v + speed * aside, q)) - 8.8 for speed in (0.0, 0.225, PARAMS.sliding_high + 0.05)]
    assert raised[0] > raised[1] > 0.25
    assert raised[2] == 0.0
