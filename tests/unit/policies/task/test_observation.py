"""The observation: layout, frame, ring, and the same numbers from the flight's builder and the training's kernel."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.task import entry_row, tail_row
from policies.task.observation import (
    HISTORY,
    NEWEST,
    OBS_DIM,
    TAIL,
    ObservationBuilder,
    action_from_command,
    build_observation,
    command_from_action,
    history_dim,
    push_history,
    yaw_axes,
)
from vehicle.quadrotor.airframe import load_airframe

LIMITS = load_airframe("paper_quad").limits_row()

AHEAD = np.eye(8)[0]
BOARD = np.array([3.0, 4.0, 1.5, 0.5, 2.0, 0.3, 0.7, 0.0])


def quaternion(roll, pitch, yaw):
    cr, sr, cp, sp = math.cos(roll / 2), math.sin(roll / 2), math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def observe(boards, p, v, q, stride=1, rho=1.0, action=(0, 0, 0, 0), gain=1.0, drag=0.2, sigma=0.0):
    row, out = np.zeros(history_dim(stride)), np.zeros(OBS_DIM, dtype=np.float32)
    for i, board in enumerate(boards):
        push_history(board, 0.01 * i, row)
    now = 0.01 * (len(boards) - 1)
    build_observation(row, p, v, q, rho, np.array(action, dtype=float), gain, drag, sigma, stride, now, out)
    return out


def test_newest_entry_agrees_with_hand_calculation():
    p = np.array([1.0, 4.0, 2.5])
    inputs = {"rho": 0.4, "action": (0.1, 0.2, 0.3, 0.4), "gain": 1.1, "drag": 0.3, "sigma": 0.02}
    out = observe([BOARD], p, np.zeros(3), quaternion(0, 0, math.pi / 2), **inputs)
    # drone faces +y: its x is the world's y, its y is the world's -x
    n = np.array([-math.sin(0.7) * math.cos(0.5), -math.sin(0.7) * math.sin(0.5), math.cos(0.7)])
    v = 2.0 * np.array([math.cos(0.5), math.sin(0.5)])
    expected = [0.0, -2.0, -1.0, n[1], -n[0], n[2], v[1], -v[0], 0.3, 0.0]
    assert out[NEWEST:TAIL] == pytest.approx(expected, abs=1e-6)
    assert out[TAIL + tail_row.RHO] == pytest.approx(0.4)
    assert out[TAIL + tail_row.ACTION : TAIL + tail_row.GAIN] == pytest.approx([0.1, 0.2, 0.3, 0.4])
    assert out[TAIL + tail_row.GAIN :] == pytest.approx([1.1, 0.3, 0.02])
    assert out[TAIL + tail_row.R : TAIL + tail_row.R + 9] == pytest.approx(np.eye(3).ravel(), abs=1e-6)


def test_oldest_entry_repeats_until_the_ring_is_full():
    boards = [BOARD + 0.02 * i * AHEAD for i in range(4)]
    out = observe(boards, np.zeros(3), np.zeros(3), quaternion(0, 0, 0)).astype(float)
    entries = out[:TAIL].reshape(HISTORY, entry_row.DIM)
    assert entries[0] == pytest.approx(entries[26])
    assert entries[26:, 0] == pytest.approx([3.0, 3.02, 3.04, 3.06], abs=1e-6)
    assert entries[:, 9] == pytest.approx([-0.03] * 27 + [-0.02, -0.01, 0.0], abs=1e-6)


@pytest.mark.parametrize("stride", [1, 3, 10])
def test_stride_spaces_the_entries(stride):
    boards = [BOARD + 0.001 * i * AHEAD for i in range(700)]
    out = observe(boards, np.zeros(3), np.zeros(3), quaternion(0, 0, 0), stride=stride)
    times = out[:TAIL].reshape(HISTORY, entry_row.DIM)[:, 9]
    assert times == pytest.approx(-0.01 * stride * np.arange(HISTORY - 1, -1, -1), abs=1e-5)
    x = out[:TAIL].reshape(HISTORY, entry_row.DIM)[:, 0]
    assert x == pytest.approx(3.0 + 0.001 * (699 - stride * np.arange(HISTORY - 1, -1, -1)), abs=1e-5)


@pytest.mark.parametrize("stride", [1, 3, 8])
def test_history_is_that_of_a_plain_list_while_the_ring_fills_and_after_it_has_gone_round(stride):
    boards = np.random.default_rng(stride).normal(0.0, 1.0, (75 * stride, 8))
    for count in (1, 2, stride + 1, 29 * stride, 29 * stride + 1, 30 * stride, 30 * stride + 1, 75 * stride):
        out = observe(boards[:count], np.zeros(3), np.zeros(3), quaternion(0, 0, 0), stride=stride)
        numbers = count - 1 - np.minimum(stride * np.arange(HISTORY - 1, -1, -1), count - 1)
        entries = out[:TAIL].reshape(HISTORY, entry_row.DIM)
        assert entries[:, :3] == pytest.approx(boards[numbers, :3], abs=1e-6), count
        assert entries[:, entry_row.TIME] == pytest.approx(0.01 * (numbers - (count - 1)), abs=1e-6), count


@given(
    turn=st.floats(-3.1, 3.1),
    shift=st.tuples(st.floats(-20, 20), st.floats(-20, 20)),
    attitude=st.tuples(st.floats(-1.0, 1.0), st.floats(-1.4, 1.4), st.floats(-3.1, 3.1)),
)
@settings(max_examples=60)
def test_observation_is_invariant_to_yaw_and_origin(turn, shift, attitude):
    """Turning and moving the whole world leaves the observation as it is."""
    p, v = np.array([1.0, 2.0, 3.0]), np.array([0.5, -1.0, 0.2])
    q = quaternion(*attitude)
    c, s = math.cos(turn), math.sin(turn)
    spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    moved = BOARD.copy()
    moved[:3] = spin @ BOARD[:3] + [*shift, 0]
    moved[3] += turn
    half = np.array([math.cos(turn / 2), 0, 0, math.sin(turn / 2)])
    w1, z1 = half[0], half[3]
    turned = np.array([w1 * q[0] - z1 * q[3], w1 * q[1] - z1 * q[2], w1 * q[2] + z1 * q[1], w1 * q[3] + z1 * q[0]])
    before = observe([BOARD], p, v, q)
    after = observe([moved], spin @ p + [*shift, 0], spin @ v, turned)
    assert after == pytest.approx(before, abs=2e-5)


def test_yaw_is_continuous_in_a_steep_flare():
    for pitch in np.linspace(-1.55, 1.55, 21):
        c, s = yaw_axes(quaternion(0.0, pitch, 0.8))
        assert math.atan2(s, c) == pytest.approx(0.8, abs=1e-6)
    assert yaw_axes(quaternion(math.pi / 2, 0.0, 0.0)) == (1.0, 0.0)


def test_builder_equals_the_kernel():
    rng = np.random.default_rng(1)
    builder, start_ns = ObservationBuilder(stride=3), 987_654_321_000_000_000
    row, out = np.zeros(history_dim(3)), np.zeros(OBS_DIM, dtype=np.float32)
    for i in range(150):
        board = BOARD + rng.normal(0, 0.1, 8)
        p, v, q = rng.normal(0, 1, 3), rng.normal(0, 1, 3), quaternion(*rng.normal(0, 0.3, 3))
        action = rng.uniform(-1, 1, 4)
        push_history(board, 0.01 * i, row)
        build_observation(row, p, v, q, 0.8, action, 1.05, 0.3, 0.02, 3, 0.01 * i, out)
        assert builder.push(start_ns + 10_000_000 * i, board)
        assert np.array_equal(builder.build(start_ns + 10_000_000 * i, p, v, q, 0.8, action, 1.05, 0.3, 0.02), out)


def test_newest_entry_is_replaced_between_two_steps():
    """A picture 6 ms after a step replaces the entry of that step; the next step adds an entry."""
    start_ns, builder = 5_000_000_000, ObservationBuilder(stride=1)
    p, q, action = np.zeros(3), quaternion(0.0, 0.0, 0.0), np.zeros(4)
    times = []
    for ms, between in ((0, True), (10, False), (16, True), (20, False)):  # the first of all has nothing to renew
        now_ns = start_ns + ms * 1_000_000
        assert builder.push(now_ns, BOARD + ms, between)
        out = builder.build(now_ns, p, p, q, 1.0, action)
        history = out[:TAIL].reshape(HISTORY, entry_row.DIM)
        assert history[-1, 0] == pytest.approx(BOARD[0] + ms)
        times.append(sorted({round(float(1000 * t)) for t in history[:, 9]}))
    assert times == [[0], [-10, 0], [-16, 0], [-20, -4, 0]]


def test_invalid_input_is_refused():
    builder = ObservationBuilder(stride=1)
    p, q, a = np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(4)
    with pytest.raises(ValueError, match="push"):
        builder.build(0, p, p, q, 1.0, a)
    assert not builder.push(0, BOARD * np.nan)
    assert builder.rejected == 1
    assert builder.push(0, BOARD)
    with pytest.raises(ValueError, match="not finite"):
        builder.build(0, p * np.nan, p, q, 1.0, a)
    with pytest.raises(ValueError, match="stride is 0"):
        history_dim(0)


@given(st.lists(st.floats(-1, 1), min_size=4, max_size=4))
def test_action_scaling_round_trip(action):
    command, back = np.zeros(4), np.zeros(4)
    command_from_action(np.array(action), LIMITS, command)
    assert 4.8 - 1e-9 <= command[3] <= 14.8 + 1e-9
    action_from_command(command, LIMITS, back)
    assert back == pytest.approx(action, abs=1e-9)


def test_action_is_clipped():
    command = np.zeros(4)
    command_from_action(np.array([2.0, -2.0, 0.5, 7.0]), LIMITS, command)
    assert command == pytest.approx([3.5, -3.5, 1.75, 14.8])
