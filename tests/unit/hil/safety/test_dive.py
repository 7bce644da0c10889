import math
from dataclasses import replace

import pytest

from hil.contract.messages import Action, Belief, VehicleState
from hil.safety.dive import diving, unseen
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
    assert unseen(NOW, vehicle, board and replace(board, last_exposure_ns=NOW - 500 * MS)) == ""


def test_distance_is_that_to_where_the_board_is_now():
    assert diving(NOW, VEHICLE, replace(BOARD, stamp_ns=NOW - 100 * MS)) == pytest.approx(1.2)


def flown(unseen_ms, **board):
    """Why the gate has tripped, for a board that was last seen so long ago."""
    belief = replace(BOARD, last_exposure_ns=NOW - round(unseen_ms * MS), **board)
    gate = VehicleGate(GateLimits())
    gate.check(NOW, Action(NOW, True, (0.1, 0.2, 0.3), 9.0, "network", NOW, 1.0), VEHICLE, belief)
    return gate.tripped


def test_gate_trips_on_a_moving_board_that_is_not_seen_in_the_dive():
    assert flown(160) == "board not seen for 0.16 s, 1.0 m in front of it"
    assert flown(160, speed=-0.6, position=(3.0, 0.0, 1.5)) != ""


@pytest.mark.parametrize(
    ("unseen_ms", "board"),
    [(140, {}), (1000, {"speed": 0.3}), (1000, {"position": (3.5, 0.0, 1.5)}), (1000, {"position": (2.2, 0.0, 1.5)})],
)
def test_gate_lets_a_vehicle_fly_on_that_sees_the_board_or_knows_where_it_is(unseen_ms, board):
    assert flown(unseen_ms, **board) == ""


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
