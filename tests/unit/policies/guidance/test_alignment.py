"""Rates for an aligned contact: what they lead to, what they leave alone, and that kernel and network say the same."""

import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z, from_rotation_vector, integrate
from policies.environment.config import EnvConfig
from policies.guidance.alignment import (
    BAND,
    BANK,
    BANK_FROM,
    BANK_MOST,
    BESIDE,
    FROM,
    LAG,
    MOST,
    SHORTEST,
    UNSURE,
    touch_rates,
)
from policies.network.actor_critic import Actor, NetworkConfig
from policies.network.touch import BELOW, RADIUS, aligned_action
from policies.task.observation import NEWEST, OBS_DIM, RATE_MAX, TAIL, build_observation, history_dim, push_history
from tests.unit.policies.guidance.touch_situation import situation
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

torch.set_num_threads(1)
LEAN = 0.1


def corrected(board, p, v, q, out, before=(0.0, 0.0), lean=LEAN, sigma=0.0):
    out = np.array(out, dtype=np.float64)
    touch_rates(p, v, q, board, np.array(before), sigma, lean, BELOW, RADIUS, RATE_MAX, out)
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
def test_a_drone_that_would_touch_askew_touches_within_tolerance(lean, tilt):
    assert contact_angle(lean, tilt, turn=0.0, law=False) > 0.2
    assert contact_angle(lean, tilt, turn=0.0, law=True) < 0.2


def test_a_board_that_turns_is_met_where_it_will_be():
    still, turning = (situation(1.2, LEAN * math.sin(1.2), 0.0, 0.12, turn=turn) for turn in (0.0, 1.2))
    assert corrected(*still, [0.0, 0.0, 0.0, 9.0])[:2].tolist() == [0.0, 0.0]
    board, p, v, q = turning
    out = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0])
    later, then = board.copy(), integrate(q, *out[:3], 0.08)
    later[3] += 0.12 * 1.2
    facing = np.array(board_normal(later))
    assert facing @ np.array(body_z(then)) > facing @ np.array(body_z(q))


def test_who_will_touch_aligned_is_left_alone():
    here = situation(1.0, LEAN * math.sin(1.0), 0.0, 0.1)
    asked = [0.3, -0.2, 0.4, 11.0]
    assert corrected(*here, asked).tolist() == asked


@pytest.mark.parametrize(
    "change",
    [{"left": FROM + 0.01}, {"closing": 0.05}, {"closing": -0.5}, {"beside": BESIDE + 0.02}, {"tilt": 1.3}],
    ids=str,
)
def test_nothing_is_corrected_far_from_contact(change):
    here = situation(**{"inclination": 1.0, "lean": 0.35, "tilt": 0.0, "left": 0.1} | change)
    asked = [0.3, -0.2, 0.4, 11.0]
    assert corrected(*here, asked).tolist() == asked


def test_yaw_rate_and_thrust_stay_and_rates_keep_their_limit():
    out = corrected(*situation(1.0, -1.0, 0.0, 0.05), [0.0, 0.0, 0.4, 11.0])
    assert out[2:].tolist() == [0.4, 11.0]
    assert np.abs(out[:2]).max() == RATE_MAX


def test_by_hand_on_a_flat_board():
    # Level but for 0.2 rad to the right: 0.12 rad too much, in the shortest span.
    board, p, v, q = situation(0.0, 0.0, 0.2, 0.05, heading=0.0, turn=0.0)
    q = np.array(from_rotation_vector(0.2, 0.0, 0.0))
    out = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0])
    assert out[0] == pytest.approx(-(math.sin(0.2) - BAND) / SHORTEST, rel=1e-9)
    assert out[1] == pytest.approx(0.0, abs=1e-9)
    # A rate asked before goes on for 40 ms and takes its part off.
    less = corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0], before=(-1.0, 0.0))
    assert less[0] == pytest.approx(-(math.sin(0.2) - 0.04 - BAND) / SHORTEST, rel=1e-9)


def test_a_board_that_turns_hard_is_met_banked_into_the_turn():
    # 2 m/s at -1.2 rad/s takes 0.245 rad of bank to the right: 0.4 of what exceeds 0.18 of it.
    board, p, v, _ = situation(0.0, 0.0, 0.0, 0.0, heading=0.0, turn=-1.2)
    bank = BANK * (2.0 * 1.2 / GRAVITY - BANK_FROM)
    assert 0.02 < bank < BANK_MOST

    def roll_rate(roll):
        q = np.array(from_rotation_vector(roll, 0.0, 0.0))
        return corrected(board, p, v, q, [0.0, 0.0, 0.0, 9.0])[0]

    axis = np.array([0.0, -bank, 1.0])  # not normalised, as rates are
    for roll in (0.2, -0.2):
        off = float(np.cross(body_z(from_rotation_vector(roll, 0.0, 0.0)), axis)[0])
        assert roll_rate(roll) == pytest.approx((off - math.copysign(BAND, off)) / SHORTEST, rel=1e-9)
    assert roll_rate(bank + 0.9 * BAND) == 0.0 < roll_rate(-0.9 * BAND)


def test_a_surface_that_may_be_nearer_is_answered_earlier():
    here = situation(0.0, 0.0, 0.25, FROM + 0.04, closing=0.4)
    asked = [0.0, 0.0, 0.0, 9.0]
    assert corrected(*here, asked).tolist() == asked
    assert corrected(*here, asked, sigma=0.004).tolist() == asked  # 12 mm at 0.4 m/s: 30 ms
    turned = [abs(corrected(*here, asked, sigma=sigma)[0]) for sigma in (0.007, 1.0)]
    assert 0.5 < turned[0] == turned[1] < RATE_MAX


@given(
    st.floats(0.0, 1.4), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(-0.02, 0.2), st.floats(0.0, 1.5),
    st.floats(-1.2, 1.2), st.floats(-3.0, 3.0), st.sampled_from((0.0, 0.008, 0.05)),
    st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8),
)  # fmt: skip
def test_kernel_and_network_say_the_same(inclination, lean, tilt, left, closing, turn, heading, sigma, actions):
    board, p, v, q = situation(inclination, lean, tilt, left, closing, turn=turn, heading=heading)
    asked, before = np.array(actions[:4]), np.array(actions[4:])
    history, observation = np.zeros(history_dim(1)), np.zeros(OBS_DIM, dtype=np.float32)
    push_history(board, 0.0, history)
    build_observation(history, p, v, q, 1.0, before, 1.0, 0.2, sigma, 1, 0.0, observation)
    seen = torch.from_numpy(observation).double()[None]
    got = aligned_action(seen[:, NEWEST:TAIL], seen[:, TAIL:], torch.tensor(asked)[None], torch.tensor([LEAN]))
    command = np.array([*(RATE_MAX * asked[:3]), asked[3]])
    wanted = corrected(board, p, v, q, command, RATE_MAX * before[:2], sigma=sigma)
    early = min(MOST, UNSURE * sigma) / max(0.1, closing)
    if not near_a_limit(left - early, closing, board, q):
        assert got[0].numpy() == pytest.approx([*(wanted[:3] / RATE_MAX), wanted[3]], abs=2e-4)


def near_a_limit(left, closing, board, q):
    """True where rounding to float32 may decide whether anything is corrected."""
    cosine = float(np.array(board_normal(board)) @ np.array(body_z(q)))
    return abs(left - FROM) < 1e-4 or abs(closing - 0.1) < 1e-4 or abs(cosine - 0.5) < 1e-4


def test_networks_take_the_disc_to_be_that_of_their_airframe():
    contact = load_airframe(EnvConfig.airframe).contact
    assert (contact.magnet_below, contact.footprint_radius) == (BELOW, RADIUS)


def test_an_aligned_actor_is_corrected_and_another_is_not():
    board, p, v, q = situation(1.0, -0.3, 0.0, 0.08)
    history, observation = np.zeros(history_dim(1)), np.zeros(OBS_DIM, dtype=np.float32)
    push_history(board, 0.0, history)
    build_observation(history, p, v, q, 1.0, np.zeros(4), 1.0, 0.2, 0.0, 1, 0.0, observation)
    seen = torch.from_numpy(observation)[None]
    plain, aligned = Actor(NetworkConfig()), Actor(NetworkConfig(aligned=True, lean=LEAN))
    aligned.load_state_dict(aligned.state_dict() | plain.state_dict())
    difference = (aligned(seen) - plain(seen))[0].detach()
    assert abs(difference[1]) > 0.3 and difference[2:].tolist() == [0.0, 0.0]
    aligned(seen).sum().backward()
    assert all(torch.isfinite(each.grad).all() for each in aligned.parameters() if each.grad is not None)


@pytest.mark.parametrize("sigma, share", [(0.0005, 0.0), (0.004, 0.5), (0.015, 1.0)])
@pytest.mark.parametrize("inclination", [0.3, 0.6, 1.0])
def test_an_aligned_actor_leans_more_where_the_surface_is_seen_poorly(inclination, sigma, share):
    board, p, v, q = situation(inclination, 0.3, 0.0, 0.08)
    lean = LEAN + 0.08 * share / max(0.5, math.sin(inclination))
    history, observation = np.zeros(history_dim(1)), np.zeros(OBS_DIM, dtype=np.float32)
    push_history(board, 0.0, history)
    build_observation(history, p, v, q, 1.0, np.zeros(4), 1.0, 0.2, sigma, 1, 0.0, observation)
    seen = torch.from_numpy(observation)[None]
    unsure = Actor(NetworkConfig(aligned=True, lean=LEAN, lean_unsure=0.08))
    told, untold = (Actor(NetworkConfig(aligned=True, lean=each)) for each in (lean, LEAN + 0.2))
    for other in (told, untold):
        other.load_state_dict(other.state_dict() | {k: v for k, v in unsure.state_dict().items() if "lean" not in k})
    torch.testing.assert_close(unsure(seen), told(seen))
    assert not torch.allclose(unsure(seen), untold(seen), atol=1e-2)
