"""The last moment to flare: what it saves, what it leaves alone, and that kernel and network say the same."""

import itertools
import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from kernel.rotations import body_z, integrate
from policies.guidance.alignment import LAG
from policies.guidance.flare import ASIDE, CLOSING, late_flare
from policies.network.touch import BELOW, RADIUS, flared_action
from policies.task.observation import (
    NEWEST,
    OBS_DIM,
    RATE_MAX,
    TAIL,
    THRUST_MAX,
    build_observation,
    history_dim,
    push_history,
)
from tests.unit.policies.guidance.touch_situation import situation
from vehicle.quadrotor.airframe import GRAVITY

LEAN = 0.1
STEEP = math.radians(70.0)
ASKED = [0.3, -0.2, 0.4, 11.0]


def flared(board, p, v, q, out, before=(0.0, 0.0), gain=1.0):
    out = np.array(out, dtype=np.float64)
    late_flare(p, v, q, board, np.array(before), gain * THRUST_MAX, LEAN, BELOW, RADIUS, RATE_MAX, out)
    return out


def fly(law, rate=-2.0, gain=0.8):
    """A weak drone with all its thrust on, 0.75 m before a steep board, turning as gently as networks did: the angle
    between body z and normal at contact, rad."""
    board, p, v, q = situation(STEEP, 1.05, 0.0, 0.2, closing=3.2, speed=0.0, heading=0.0)
    n = np.array(board_normal(board))
    asked, rates, dt = np.array([0.0, rate, 0.0, 0.0]), np.array([0.0, rate, 0.0]), 0.002
    for k in range(500):
        z = np.array(body_z(q))
        cosine = float(n @ z)
        edge = BELOW * cosine + RADIUS * math.sqrt(max(0.0, 1.0 - cosine * cosine))
        if n @ (p - board[:3]) <= edge:
            return math.acos(min(1.0, cosine))
        if k % 5 == 0:
            asked = np.array([0.0, rate, 0.0, 0.0])
            asked = flared(board, p, v, q, asked, rates[:2], gain) if law else asked
        rates = rates + (asked[:3] - rates) * dt / LAG
        q = np.array(integrate(q, *rates, dt))
        v = v + dt * (gain * THRUST_MAX * z - np.array([0.0, 0.0, GRAVITY]))
        p = p + dt * v
    raise AssertionError("it never touched")


def test_who_turns_too_late_touches_within_tolerance():
    assert fly(law=False) > 0.3
    assert fly(law=True) < 0.2


def test_who_has_time_is_left_alone():
    here = situation(STEEP, 0.5, 0.0, 0.3, closing=2.0)
    assert flared(*here, ASKED).tolist() == ASKED


def test_at_the_last_moment_it_turns_as_fast_as_it_may_and_yaw_and_thrust_stay():
    out = flared(*situation(STEEP, 1.2, 0.0, 0.15, closing=3.0), ASKED)
    assert out.min() == -RATE_MAX
    assert np.abs(out[:2]).max() == RATE_MAX
    assert out[2:].tolist() == ASKED[2:]


@pytest.mark.parametrize(
    "change",
    [{"closing": CLOSING - 0.1}, {"beside": ASIDE + 0.1}, {"lean": 1.7}, {"left": 0.6}],
    ids=str,
)
def test_nothing_changes_for_who_is_slow_aside_turned_away_or_stops_before_it(change):
    late = {"inclination": STEEP, "lean": 1.2, "tilt": 0.0, "left": 0.15, "closing": 3.0}
    assert flared(*situation(**late), ASKED).tolist() != ASKED
    assert flared(*situation(**late | change), ASKED).tolist() == ASKED


@given(
    st.floats(0.0, 1.4), st.floats(-0.2, 1.6), st.floats(-0.5, 0.5), st.floats(-0.02, 0.6), st.floats(0.0, 4.0),
    st.floats(-1.2, 1.2), st.floats(-3.0, 3.0), st.floats(0.7, 1.4),
    st.lists(st.floats(-1.0, 1.0), min_size=8, max_size=8),
)  # fmt: skip
def test_kernel_and_network_say_the_same(inclination, lean, tilt, left, closing, turn, heading, gain, actions):
    board, p, v, q = situation(inclination, lean, tilt, left, closing, turn=turn, heading=heading)
    asked, before = np.array(actions[:4]), np.array(actions[4:])
    history, observation = np.zeros(history_dim(1)), np.zeros(OBS_DIM, dtype=np.float32)
    push_history(board, 0.0, history)
    build_observation(history, p, v, q, 1.0, before, gain, 0.2, 0.0, 1, 0.0, observation)
    seen = torch.from_numpy(observation).double()[None]
    tail = seen[:, TAIL:]
    got = flared_action(seen[:, NEWEST:TAIL], tail, torch.tensor(asked)[None], torch.tensor([LEAN]))[0].numpy()
    command = [*(RATE_MAX * asked[:3]), asked[3]]
    # Rounding to float32 may decide whether it is the last moment: then both answers stand for the same
    n, answers = np.array(board_normal(board)), []
    for e, f in itertools.product((-1e-5, 0.0, 1e-5), repeat=2):
        answers.append(flared(board, p + e * n, v - f * n, q, command, RATE_MAX * before[:2], gain))
    scaled = [np.array([*(answer[:3] / RATE_MAX), answer[3]]) for answer in answers]
    assert min(np.abs(got - each).max() for each in scaled) < 2e-3
