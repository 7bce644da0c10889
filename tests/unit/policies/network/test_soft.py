"""Thrust before contact: how hard it then is, that nothing is ever taken off, and when it is left alone."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z
from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.soft import SLIDING, WITHIN, softened_action
from policies.network.touch import BELOW, RADIUS, THRUST_MAX, THRUST_MIN
from policies.task.observation import (
    NEWEST,
    OBS_DIM,
    TAIL,
    build_observation,
    history_dim,
    push_history,
)
from tests.unit.policies.guidance.situation import situation
from vehicle.quadrotor.airframe import GRAVITY

torch.set_num_threads(1)
INTO = 0.5
DRAG = 0.2


def observed(board, p, v, q, before=0.0, gain=1.0, sigma=0.001):
    history, observation = np.zeros(history_dim(1)), np.zeros(OBS_DIM, dtype=np.float32)
    push_history(board, 0.0, history)
    build_observation(history, p, v, q, 1.0, np.array([0.0, 0.0, 0.0, before]), gain, DRAG, sigma, 1, 0.0, observation)
    return torch.from_numpy(observation)[None]


def softened(here, thrust=-0.2, rates=(0.1, -0.4, 0.2), **told):
    seen = observed(*here, **told)
    action = torch.tensor([[*rates, thrust]])
    return softened_action(seen[:, NEWEST:TAIL], seen[:, TAIL:], action, torch.tensor([INTO]))[0]


def climbing(inclination, closing, left, thrust=-0.2):
    """On its way to a contact without sliding: gravity takes what speed it has up the slope."""
    board, p, v, q = situation(inclination, 0.0, 0.0, left, closing=closing)
    c, s = math.cos(board[3]), math.sin(board[3])
    up = np.array([math.cos(inclination) * c, math.cos(inclination) * s, math.sin(inclination)])
    return board, p, v + left * GRAVITY * math.sin(inclination) * up, q


def impact(inclination, closing, thrust, gain, law):
    """Speed into the board (m/s) after WITHIN s of thrust alone, motors following with a first-order lag."""
    board, p, v, q = climbing(inclination, closing, WITHIN)
    n, z = np.array(board_normal(board)), np.array(body_z(q))
    dt, asked, given = 0.001, thrust, thrust
    ahead = board[4] * np.array([math.cos(board[3]), math.sin(board[3]), 0.0])
    for k in range(400):
        if law and k % 10 == 0:
            asked = float(softened((board, p, v, q), thrust, before=asked, gain=gain)[3])
        given += (asked - given) * dt / 0.03
        force = gain * (THRUST_MIN + 0.5 * (given + 1.0) * (THRUST_MAX - THRUST_MIN))
        v = v + dt * (force * z - np.array([0.0, 0.0, GRAVITY]) - DRAG * v)
        p, board[:3] = p + dt * v, board[:3] + dt * ahead
        if (p - board[:3]) @ n < BELOW + 0.1 * RADIUS:
            return float(-(v - ahead) @ n)
    raise AssertionError("it never touched")


@pytest.mark.parametrize("gain", [0.85, 1.0, 1.15])
@pytest.mark.parametrize(("inclination", "closing"), [(0.0, 0.9), (0.8, 0.8), (1.2, 1.2), (1.2, 1.3)])
def test_who_would_hit_hard_touches_softer(inclination, closing, gain):
    balance = (GRAVITY * math.cos(inclination) / gain - THRUST_MIN) / (THRUST_MAX - THRUST_MIN) * 2.0 - 1.0
    thrust = max(-1.0, balance)
    hard, soft = (impact(inclination, closing, thrust, gain, law) for law in (False, True))
    assert hard > 0.7
    assert INTO - 0.1 < soft < max(INTO + 0.1, hard - 0.1)


@given(
    st.floats(0.0, 1.4), st.floats(-0.5, 0.5), st.floats(-0.05, 0.3), st.floats(0.0, 2.0), st.floats(0.6, 1.3),
    st.floats(-1.5, 1.5), st.floats(-1.0, 1.0),
)  # fmt: skip
def test_thrust_is_only_ever_raised_and_rates_stay(inclination, lean, left, closing, gain, thrust, before):
    got = softened(situation(inclination, lean, 0.1, left, closing=closing), thrust, before=before, gain=gain)
    assert got[:3].tolist() == pytest.approx([0.1, -0.4, 0.2])
    assert bool(torch.isfinite(got).all())
    assert max(-1.0, min(1.0, thrust)) - 1e-6 <= float(got[3].clamp(-1.0, 1.0)) <= 1.0


def test_who_brakes_harder_already_goes_on():
    assert float(softened(situation(0.0, 0.0, 0.0, 0.1, closing=0.6), 0.9, before=0.9)[3]) == pytest.approx(0.9)


NEAR = climbing(1.2, 0.9, 0.1)


def test_by_hand_on_a_flat_board():
    height, closing, given = 0.1 * 0.8 - 0.1 * RADIUS, 0.8, 4.8 + 0.4 * 10.0
    work = 0.5 * (closing**2 - INTO**2) + (GRAVITY - DRAG * closing) * (height + 0.01) - given * 0.03 * closing
    thrust = work / (height + 0.01 - 0.03 * closing)
    got = softened(situation(0.0, 0.0, 0.0, 0.1, closing=closing), before=-0.2)
    assert 8.8 < thrust < 14.8
    assert float(got[3]) == pytest.approx((thrust - 4.8) / 5.0 - 1.0, abs=1e-4)


def askew():
    """Body z farther off the normal than it may be, on its way to a contact without sliding."""
    board, p, v, q = situation(0.0, 0.66, 0.0, 0.02, closing=0.9)
    zx, zy, _ = body_z(q)
    return board, p, v - 0.45 * np.array([zx, zy, 0.0]), q


@pytest.mark.parametrize(
    "here",
    [situation(0.0, 0.0, 0.0, WITHIN + 0.03, closing=0.9), situation(0.0, 0.0, 0.0, 0.1, closing=0.45), askew(),
     situation(0.0, 0.0, 0.0, 0.1, closing=0.9, beside=0.4), climbing(1.2, 0.9, -0.02)],
    ids=["far", "slow", "askew", "beside", "through"],
)  # fmt: skip
def test_it_leaves_alone(here):
    assert softened(here, -0.9, before=-0.9).tolist() == pytest.approx([0.1, -0.4, 0.2, -0.9])


def test_a_surface_seen_poorly_is_met_as_before_and_half_well_half_so():
    full, half, none = (
        float(softened(NEAR, -0.9, before=-0.9, sigma=sigma)[3]) + 0.9 for sigma in (0.002, 0.004, 0.006)
    )
    assert full > 0.2
    assert none == pytest.approx(0.0, abs=1e-6)
    assert half == pytest.approx(0.5 * full, abs=1e-5)


def test_who_slides_does_not_brake():
    board, p, v, q = situation(0.0, 0.0, 0.0, 0.1, closing=0.9)
    aside = np.array([-math.sin(0.4), math.cos(0.4), 0.0])
    raised = [float(softened((board, p, v + speed * aside, q))[3]) + 0.2 for speed in (0.0, 0.225, SLIDING[1] + 0.05)]
    assert raised[0] > raised[1] > 0.05
    assert raised[2] == pytest.approx(0.0, abs=1e-6)


def test_a_soft_actor_brakes_and_another_does_not():
    seen = observed(*NEAR, before=-0.9)
    plain, soft = Actor(NetworkConfig()), Actor(NetworkConfig(soft=INTO))
    with torch.no_grad():
        plain.head.bias[3] = -0.9
    soft.load_state_dict(soft.state_dict() | plain.state_dict())
    difference = (soft(seen) - plain(seen))[0].detach()
    assert float(difference[3]) > 0.2 and difference[:3].tolist() == [0.0, 0.0, 0.0]
    soft(seen).sum().backward()
    assert all(torch.isfinite(each.grad).all() for each in soft.parameters() if each.grad is not None)
