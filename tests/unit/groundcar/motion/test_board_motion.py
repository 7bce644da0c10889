import math

import numpy as np
import pytest

from groundcar.motion import board_row, motion_row
from groundcar.motion import paths as t
from groundcar.motion import speed_laws as s
from groundcar.motion.board_motion import motion_aux, motion_future, motion_reset, motion_step
from groundcar.motion.splines import random_spline
from kernel.jit import njit, prange
from kernel.random import stream

DT = 0.01


def spline(seed, v):
    row = t.static_path()
    random_spline(stream(seed, 1), row, v)
    return row


def rollout(aux, u=0.0, seconds=10.0, dt=DT, moving=True, seed=0):
    row, rng = np.zeros(8), stream(seed, 2)
    motion_reset(row, aux, u, 1.5, 0.6, moving)
    rows = [row.copy()]
    for _ in range(round(seconds / dt)):
        motion_step(row, aux, dt, rng)
        rows.append(row.copy())
    return np.array(rows)


CONSTANT = s.constant_speed(2.0)
LOOPS = {
    "racetrack": (t.RACETRACK, t.racetrack_path(x=1.0, heading=0.4)),
    "figure8": (t.FIGURE8, t.figure8_path()),
    "spline": (t.SPLINE, spline(4, 2.0)),
    "arc": (t.ARC, t.arc_path(3.0, -1)),
}


@pytest.mark.parametrize("name", LOOPS)
def test_loops_are_driven_at_constant_speed_along_the_heading(name):
    rows = rollout(motion_aux(*LOOPS[name], s.CONSTANT, CONSTANT))
    steps = np.diff(rows[:, :2], axis=0) / DT
    heading = np.unwrap(rows[:, board_row.HEADING])
    middle = 0.5 * (heading[1:] + heading[:-1])
    assert np.hypot(*steps.T) == pytest.approx(2.0, abs=2e-3)
    assert steps[:, 0] == pytest.approx(2.0 * np.cos(middle), abs=5e-3)
    assert steps[:, 1] == pytest.approx(2.0 * np.sin(middle), abs=5e-3)
    turn = 0.5 * (rows[1:, board_row.TURN_RATE] + rows[:-1, board_row.TURN_RATE])
    jumps = 0.006 if name == "racetrack" else 2e-4  # the racetrack's curvature jumps four times a lap
    assert np.cumsum(turn) * DT == pytest.approx(heading[1:] - heading[0], abs=8 * jumps)
    assert (rows[:, board_row.Z] == 1.5).all()
    assert (rows[:, board_row.INCLINATION] == 0.6).all()


def test_circle_against_its_closed_form():
    rows = rollout(motion_aux(t.ARC, t.arc_path(3.0), s.CONSTANT, CONSTANT))
    angle = 2.0 / 3.0 * DT * np.arange(len(rows))
    assert rows[:, 0] == pytest.approx(3 * np.cos(angle), abs=1e-9)
    assert rows[:, 1] == pytest.approx(3 * np.sin(angle), abs=1e-9)
    assert rows[:, board_row.TURN_RATE] == pytest.approx(2.0 / 3.0)


def test_reciprocating_line_against_its_closed_form():
    aux = motion_aux(t.LINE, t.line_path(12.0), s.CONSTANT, s.constant_speed(2.5))
    rows = rollout(aux, u=-math.pi / 2, seconds=40.0)
    time = DT * np.arange(len(rows))
    phase = 2.5 / 12 * time - math.pi / 2
    assert rows[:, 0] == pytest.approx(12 * np.sin(phase), abs=1e-6)
    assert rows[:, board_row.SPEED] == pytest.approx(2.5 * np.cos(phase), abs=1e-6)
    assert (rows[:, board_row.HEADING] == 0.0).all()
    assert (rows[:, board_row.TURN_RATE] == 0.0).all()
    assert rows[:, board_row.SPEED].min() < -2.4  # it reverses
    assert (rows[100, board_row.SPEED], rows[600, board_row.SPEED]) == pytest.approx(
        (0.516, 2.37), abs=0.01
    )  # Simple-II: 0.50-2.35


def test_hard_i_speed_follows_its_speed_law():
    rows = rollout(motion_aux(t.SPLINE, spline(2, 2.5), s.COSINE, s.cosine_speed()))
    time = DT * np.arange(len(rows))
    assert rows[:, board_row.SPEED] == pytest.approx(1.0 + 0.75 * (1 + np.cos(2 * math.pi * time / 3)))
    assert np.abs(rows[:, board_row.TURN_RATE]).max() <= 1.2 * 1.001


@pytest.mark.parametrize("radius", [3.0, -3.0])
def test_hard_ii_turns_onto_its_tangent_arc_and_slows_down(radius):
    law = s.scheduled_speed(2.2, 1.5, 0.5)
    aux = motion_aux(t.SPLINE, spline(6, 2.2), s.SCHEDULED, law, change_time=3.0, arc_radius=radius)
    for _ in range(2):  # the second time shows that reset undoes the change
        rows = rollout(aux, u=2.0, seconds=8.0)
        steps = np.hypot(*np.diff(rows[:, :2], axis=0).T) / DT
        turned = np.abs(np.diff(np.unwrap(rows[:, board_row.HEADING])))
        assert turned.max() < 1.3 * DT  # no kink
        assert np.abs(steps - 0.5 * (rows[1:, board_row.SPEED] + rows[:-1, board_row.SPEED])).max() < 5e-3
        assert rows[:299, board_row.SPEED] == pytest.approx(2.2)
        assert rows[351:, board_row.SPEED] == pytest.approx(1.5)
        assert rows[302:, board_row.TURN_RATE] == pytest.approx(rows[302:, board_row.SPEED] / radius)
        centre = aux[[motion_row.ARC_X, motion_row.ARC_Y]]
        assert np.hypot(*(rows[302:, :2] - centre).T) == pytest.approx(3.0)


def test_change_of_path_can_be_set_by_length():
    aux = motion_aux(t.SPLINE, spline(6, 2.0), s.CONSTANT, CONSTANT, change_length=4.0, arc_radius=2.0)
    rows = rollout(aux, seconds=4.0)
    assert rows[195, board_row.TURN_RATE] != pytest.approx(1.0, abs=1e-3)
    assert rows[205:, board_row.TURN_RATE] == pytest.approx(1.0)


def test_future_equals_later_steps_and_leaves_the_motion_unchanged():
    law = s.scheduled_speed(2.2, 1.5, 0.5)
    aux = motion_aux(t.SPLINE, spline(6, 2.2), s.SCHEDULED, law, change_time=1.0, arc_radius=3.0)
    row, rng = np.zeros(8), stream(1)
    motion_reset(row, aux, 1.0, 1.5, 0.3, True)
    for _ in range(50):
        motion_step(row, aux, DT, rng)
    before, aux_before, out = row.copy(), aux.copy(), np.zeros((120, 8))
    motion_future(row, aux, DT, 120, out)
    assert np.array_equal(row, before)
    assert np.array_equal(aux, aux_before)
    for k in range(120):
        motion_step(row, aux, DT, rng)
        assert out[k] == pytest.approx(row, abs=1e-12)
    assert rng == stream(1)


def test_the_future_of_a_random_speed_freezes_the_noise():
    aux = motion_aux(t.SPLINE, spline(3, 2.0), s.OU, s.ou_speed(2.0))
    row, rng, out = np.zeros(8), stream(8), np.zeros((30, 8))
    motion_reset(row, aux, 0.0, 1.5, 0.0, True)
    for _ in range(300):
        motion_step(row, aux, DT, rng)
    state = rng.copy()
    motion_future(row, aux, DT, 30, out)
    assert np.array_equal(rng, state)
    assert out[:, board_row.SPEED] == pytest.approx(row[board_row.SPEED])
    assert row[board_row.SPEED] != 2.0


def test_from_rest_with_an_acceleration_limit():
    rows = rollout(motion_aux(*LOOPS["arc"], s.CONSTANT, CONSTANT, accel_limit=1.0), moving=False, seconds=4.0)
    time = DT * np.arange(len(rows))
    assert rows[:, board_row.SPEED] == pytest.approx(np.minimum(time, 2.0), abs=1e-9)


def test_response_overshoots_as_a_second_order_system():
    aux = motion_aux(*LOOPS["arc"], s.COSINE, s.cosine_speed(), response=4.0, damping=0.45)
    speed = rollout(aux, seconds=15.0, dt=0.002)[3000:, board_row.SPEED]
    r = 2 * math.pi / 3 / 4.0
    gain = 1 / math.hypot(1 - r * r, 2 * 0.45 * r)
    assert speed.max() == pytest.approx(1.75 + 0.75 * gain, abs=0.01)
    assert speed.min() == pytest.approx(1.75 - 0.75 * gain, abs=0.01)


def test_static_board_does_not_move():
    rows = rollout(motion_aux(t.STATIC, t.static_path(2.0, 3.0, -1.0), s.CONSTANT, s.constant_speed(0.0)), seconds=1.0)
    assert (rows == rows[0]).all()
    assert list(rows[0, :6]) == [2.0, 3.0, 1.5, -1.0, 0.0, 0.0]


@njit(parallel=True, cache=False)  # a cache beside a test would not notice changed kernels
def _batch(rows, auxes, streams, steps, dt):
    for i in prange(rows.shape[0]):
        for _ in range(steps):
            motion_step(rows[i], auxes[i], dt, streams[i])


def test_rows_of_a_batch_move_as_single_ones():
    n = 6
    auxes = np.array([motion_aux(t.SPLINE, spline(i, 2.0), s.OU, s.ou_speed(2.0)) for i in range(n)])
    rows, streams = np.zeros((n, 8)), np.array([stream(i, 2) for i in range(n)])
    for i in range(n):
        motion_reset(rows[i], auxes[i], 0.0, 1.5, 0.6, True)
    _batch(rows, auxes, streams, 200, DT)
    for i in range(n):
        aux = motion_aux(t.SPLINE, spline(i, 2.0), s.OU, s.ou_speed(2.0))
        assert np.array_equal(rows[i], rollout(aux, seconds=2.0, seed=i)[-1])


def test_invalid_arguments_are_refused():
    path, speed = t.arc_path(3.0), CONSTANT
    with pytest.raises(ValueError, match="path row"):
        motion_aux(t.ARC, path[:5], s.CONSTANT, speed)
    with pytest.raises(ValueError, match="arc radius"):
        motion_aux(t.ARC, path, s.CONSTANT, speed, change_time=3.0)
    with pytest.raises(ValueError, match="accel_limit"):
        motion_aux(t.ARC, path, s.CONSTANT, speed, accel_limit=0.0)
