import math

import pytest

from kernel.rotations import from_euler, from_matrix, multiply, to_matrix
from vehicle.mocap.agreement import (
    BoardSetting,
    Lasting,
    board_disagreement,
    motion_disagreement,
    vehicle_disagreement,
)

OWN = from_euler(0.03, -0.02, 0.4)
PLACE, REACH = (1.2, -0.8, 0.1), 25.0
SETTING = BoardSetting(math.radians(60.0), 1.5, REACH)
BOARD = from_euler(0.0, -SETTING.inclination, 0.7)
HALF = math.sqrt(0.5)


def world_turned(q, turn):
    return multiply(turn, q)


def mirrored(q, axis):
    """The attitude as a world shows it in which one axis points the other way."""
    R = to_matrix(q)
    R[axis, :] *= -1.0
    R[:, 1] *= -1.0  # a rotation again: what a solver makes of the mirrored markers
    return from_matrix(R)


def swapped_xy(q):
    R = to_matrix(q)[[1, 0, 2]]
    R[:, 1] *= -1.0
    return from_matrix(R)


def test_a_body_that_is_slightly_off_agrees():
    assert vehicle_disagreement(PLACE, multiply(OWN, from_euler(0.05, 0.05, 0.2)), OWN, REACH) == ""
    assert board_disagreement((3.0, 1.0, 1.6), multiply(BOARD, from_euler(0.05, 0.05, 1.0)), SETTING) != ""
    assert board_disagreement((3.0, 1.0, 1.6), multiply(BOARD, from_euler(0.05, 0.05, 0.0)), SETTING) == ""


@pytest.mark.parametrize(
    ("seen", "reason"),
    [
        (world_turned(OWN, (HALF, HALF, 0.0, 0.0)), "tilted by"),  # y up
        (world_turned(OWN, (HALF, 0.0, HALF, 0.0)), "tilted by"),  # x up
        (world_turned(OWN, (0.0, 1.0, 0.0, 0.0)), "tilted by"),  # z down
        (BOARD, "tilted by"),  # the other body
        (swapped_xy(OWN), "heading"),
        (mirrored(OWN, 0), "heading"),
        (mirrored(OWN, 1), "heading"),
        (multiply(OWN, (0.0, 0.0, 0.0, 1.0)), "heading is 180 deg off"),  # defined back to front
    ],
)
def test_swapped_or_mirrored_axes_and_another_body_contradict_the_autopilot(seen, reason):
    assert reason in vehicle_disagreement(PLACE, seen, OWN, REACH)


def test_heading_is_not_compared_where_the_autopilot_has_none():
    assert vehicle_disagreement(PLACE, multiply(OWN, (0.0, 0.0, 0.0, 1.0)), OWN, REACH, False) == ""


def test_millimetres_contradict_the_fence():
    place = tuple(1000.0 * v for v in PLACE)
    assert "millimetres" in vehicle_disagreement(place, OWN, OWN, REACH)
    assert "millimetres" in board_disagreement(place, BOARD, SETTING)


@pytest.mark.parametrize(
    ("place", "seen", "reason"),
    [
        ((3.0, 1.0, 1.5), OWN, "inclined by"),  # the vehicle
        ((3.0, 1.0, 1.5), world_turned(BOARD, (HALF, HALF, 0.0, 0.0)), "inclined by"),
        ((3.0, 1.0, 1.5), from_euler(0.0, SETTING.inclination, 0.7), "inclined by -60"),
        ((3.0, 1.0, 0.1), BOARD, "0.10 m high"),
        ((1.5, 1.0, 3.0), BOARD, "3.00 m high"),
    ],
)
def test_another_body_or_axes_contradict_the_board_as_it_is_set(place, seen, reason):
    assert reason in board_disagreement(place, seen, SETTING)


@pytest.mark.parametrize(
    ("speed", "turn_rate", "reason"),
    [
        (1.1, 0.9, ""), (0.8, 0.5, ""), (-1.0, 0.8, "moves at -1.00"), (1000.0, 0.8, "moves at 1000.00"),
        (0.0, 0.8, "moves at 0.00"), (1.0, -0.8, "an axis mirrored"), (1.0, -0.1, ""),
    ],
)  # fmt: skip
def test_motion_is_compared_with_the_wheels(speed, turn_rate, reason):
    found = motion_disagreement(speed, turn_rate, 1.0, 0.8)
    assert reason in found
    assert bool(found) == bool(reason)


def test_finding_counts_once_it_has_lasted():
    lasting = Lasting(100)
    assert [lasting.add(t, True) for t in (0, 50, 99, 100)] == [False, False, False, True]
    assert not lasting.add(110, False)
    assert [lasting.add(t, True) for t in (120, 219, 220)] == [False, False, True]
