import math
import random

import pytest

from vehicle.mocap.continuity import JUMP, Continuity, Repetition

MS = 1_000_000


def run(continuity, *positions, begin_ns=0, every_ns=10 * MS):
    return [continuity.add(begin_ns + k * every_ns, position) for k, position in enumerate(positions)]


def test_motion_within_the_speed_never_counts_as_a_jump():
    draws, continuity = random.Random(1), Continuity(3.5)
    x = y = 0.0
    for k in range(5_000):
        way, angle = draws.uniform(0.0, 3.5) * 0.02, draws.uniform(0.0, math.tau)
        x, y = x + way * math.cos(angle), y + way * math.sin(angle)
        assert continuity.add(k * 20 * MS, (x + draws.gauss(0.0, 0.01), y, 1.5)) == 0.0


def test_pose_that_has_jumped_is_off_until_it_has_jumped_back():
    continuity = Continuity(3.5)
    way = [0.035 * k for k in range(60)]
    positions = [(x + (1.0 if 10 <= k < 40 else 0.0), 0.0, 1.5) for k, x in enumerate(way)]
    off = run(continuity, *positions)
    assert off[:10] == [0.0] * 10 and off[40:] == [0.0] * 20
    assert off[10:40] == pytest.approx([1.035] * 30), "however long it lasts and however the body moves meanwhile"


def test_jump_to_a_third_place_and_back_in_two_jumps_ends_where_the_body_is():
    off = run(Continuity(1.0), (0.0,) * 3, (1.0, 0.0, 0.0), (1.0, 2.0, 0.0), (0.0, 2.0, 0.0), (0.0,) * 3)
    assert off == pytest.approx([0.0, 1.0, math.sqrt(5.0), 2.0, 0.0])


def test_body_that_was_hidden_may_reappear_as_far_off_as_it_can_have_moved():
    continuity = Continuity(2.0)
    assert continuity.add(0, (0.0,) * 3) == 0.0
    assert continuity.add(500 * MS, (1.2, 0.0, 0.0)) == 0.0
    assert continuity.add(1_000 * MS, (1.2 + 1.0 + JUMP + 0.1, 0.0, 0.0)) > 0.0


def test_stamp_that_is_not_later_leaves_no_time_to_move():
    continuity = Continuity(8.0)
    assert run(continuity, (0.0,) * 3, begin_ns=500 * MS) == [0.0]
    assert continuity.add(0, (1.0, 0.0, 0.0)) == pytest.approx(1.0)


def test_pose_after_a_reset_is_taken_as_it_is():
    continuity = Continuity(1.0)
    assert run(continuity, (0.0,) * 3, (5.0, 0.0, 0.0))[-1] == 5.0
    continuity.reset()
    assert run(continuity, (5.0, 0.0, 0.0), (5.0, 0.0, 0.0), begin_ns=20 * MS) == [0.0, 0.0]


def test_body_may_have_moved_while_its_pose_repeated():
    off = run(Continuity(3.5), *[(0.0, 0.0, 1.5)] * 50, (1.0, 0.0, 1.5), (1.02, 0.0, 1.5), (4.0, 0.0, 1.5))
    assert off == pytest.approx([0.0] * 52 + [2.98])


def repeats(*poses, every_ns=10 * MS):
    """For each pose (position, whether the body moves), given twice, whether it is found to repeat."""
    watch, found = Repetition(), []
    for k, (x, moves) in enumerate(poses):
        first, again = (watch.add(k * every_ns, (x, 0.0, 1.5), moves) for _ in range(2))
        assert first == again, "the newest pose may be looked at more often than it comes"
        found.append(first)
    return found


def test_pose_that_repeats_for_a_fifth_of_a_second_on_a_moving_body_is_found_until_it_changes():
    assert repeats(*[(0.0, True)] * 30, (0.1, True), (0.2, True)) == [False] * 20 + [True] * 10 + [False] * 2


def test_pose_of_a_body_at_rest_may_repeat_and_counts_from_when_it_sets_off():
    assert repeats(*[(0.0, False)] * 100, *[(0.0, True)] * 21) == [False] * 119 + [True] * 2


def test_measured_poses_never_repeat():
    draws = random.Random(2)
    assert not any(repeats(*[(draws.gauss(0.0, 1e-5), True) for _ in range(500)]))


def test_pose_that_comes_no_more_does_not_repeat():
    watch = Repetition()
    watch.add(0, (0.0,) * 3, True)
    assert not any(watch.add(10 * MS, (0.0,) * 3, True) for _ in range(1_000))
