import math
from dataclasses import replace

import pytest

from hil.contract.messages import Action, Belief, VehicleState
from hil.safety.dive import Lookout, diving
from hil.safety.limits import GateLimits
from hil.safety.vehicle_gate import VehicleGate

MS = 1_000_000
NOW = 5_000 * MS
# The board drives along x at 2 m/s; the vehicle is 1 m behind it, at 5 m/s.
BOARD = Belief(NOW, True, (3.0, 0.0, 1.5), 0.0, 2.0, 0.0, 1.2, 1.0, NOW, 50, 0, (0.0,) * 9, 0.0, 50, 0.01)
VEHICLE = VehicleState(NOW, (2.0, 0.0, 1.5), (5.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_vehicle_that_closes_on_a_near_board_dives():
    assert diving(NOW, VEHICLE, BOARD) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("vehicle", "board"),
    [
        (None, BOARD),
        (VEHICLE, None),
        (VEHICLE, replace(BOARD, valid=False)),
        (replace(VEHICLE, position=(1.4, 0.0, 1.5)), BOARD),  # too far
        (replace(VEHICLE, position=(2.8, 0.0, 1.5)), BOARD),  # at contact
        (replace(VEHICLE, velocity=(3.4, 0.0, 0.0)), BOARD),  # 1.4 m/s of closing
        (VEHICLE, replace(BOARD, speed=4.0)),
        (replace(VEHICLE, velocity=(-5.0, 0.0, 0.0)), BOARD),
        (replace(VEHICLE, velocity=(math.nan, 0.0, 0.0)), BOARD),
    ],
)
def test_vehicle_that_is_far_slow_or_unknown_does_not_dive(vehicle, board):
    assert diving(NOW, vehicle, board) == 0.0


def test_distance_is_that_to_where_the_board_is_now():
    assert diving(NOW, VEHICLE, replace(BOARD, stamp_ns=NOW - 100 * MS)) == pytest.approx(1.2)


def vehicle_at(distance):
    """It flies level behind the board, at 5 m/s; its camera looks straight ahead."""
    return replace(VEHICLE, position=(3.0 - distance, 0.0, 1.5))


def looked(unseen_ms, vehicle, tilt=0.0, **board):
    """Why the vehicle must not dive on, after it has flown in one place for so long without a picture of the board."""
    lookout, belief = Lookout(tilt), replace(BOARD, **board)
    said = ""
    for t in range(0, round(unseen_ms) + 1, 10):
        now = NOW + t * MS
        said = lookout.unseen(now, vehicle, replace(belief, stamp_ns=now))
    return said


@pytest.mark.parametrize("tilt", [0.0, 1.2, None])
def test_moving_board_must_be_seen_close_to_it_wherever_the_camera_looks(tilt):
    assert looked(150, vehicle_at(0.5), tilt) == ""
    assert looked(160, vehicle_at(0.5), tilt) == "board not seen for 0.16 s, 0.5 m in front of it"


def test_moving_board_must_be_seen_further_off_where_the_camera_looks_at_it():
    assert looked(160, vehicle_at(1.8)) == "board not seen for 0.16 s, 1.8 m in front of it"
    assert looked(160, vehicle_at(1.8), tilt=0.3) != ""
    assert looked(160, vehicle_at(1.8), speed=-0.6) != ""


@pytest.mark.parametrize(
    ("distance", "tilt", "board"),
    [
        (0.65, 0.35, {}),  # a policy may turn its camera away
        (0.65, None, {}),
        (2.1, 0.0, {}),
        (0.25, 0.0, {}),  # at contact
        (0.5, 0.0, {"speed": 0.3}),
        (0.5, 0.0, {"valid": False}),
        (0.5, 0.0, {"speed": 4.0}),
    ],
)
def test_vehicle_flies_on_that_need_not_see_the_board(distance, tilt, board):
    assert looked(1000, vehicle_at(distance), tilt, **board) == ""


def test_time_that_the_camera_looks_in_vain_begins_anew_with_each_picture_and_each_look_away():
    lookout, away = Lookout(0.0), replace(vehicle_at(1.5), orientation=(math.cos(0.3), 0.0, math.sin(0.3), 0.0))
    seen = NOW
    for t in range(0, 1000, 10):
        now = NOW + t * MS
        seen = now if t == 300 else seen
        vehicle = away if t % 120 == 0 else vehicle_at(1.5)
        assert lookout.unseen(now, vehicle, replace(BOARD, stamp_ns=now, last_exposure_ns=seen)) == ""


def test_gate_trips_on_a_moving_board_that_is_not_seen_in_the_dive():
    gate = VehicleGate(GateLimits(), camera_tilt=0.0)
    belief = replace(BOARD, position=(2.5, 0.0, 1.5), last_exposure_ns=NOW - 160 * MS)
    gate.check(NOW, Action(NOW, True, (0.1, 0.2, 0.3), 9.0, "network", NOW, 1.0), VEHICLE, belief)
    assert gate.tripped == "board not seen for 0.16 s, 0.5 m in front of it"


@pytest.mark.parametrize(("board", "limit_ms"), [(BOARD, 120), (None, 200), (replace(BOARD, position=(9.0,) * 3), 200)])
def test_gate_trips_sooner_on_a_command_that_repeats_in_the_dive(board, limit_ms):
    gate = VehicleGate(GateLimits())
    for t in range(0, 400, 10):
        now = NOW + t * MS
        seen = board and replace(board, stamp_ns=now, last_exposure_ns=now)
        vehicle = replace(VEHICLE, stamp_ns=now, body_rate=(0.001 * t, 0.0, 0.0))
        gate.check(now, Action(now, True, (0.1, 0.2, 0.3), 9.0, "network", now, 1.0), vehicle, seen)
        if gate.tripped:
            break
    assert t == limit_ms and "has not changed" in gate.tripped
