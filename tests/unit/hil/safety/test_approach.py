"""A vehicle that flies fast to where the board is not, as motion capture sees it."""

import math
from dataclasses import replace

import pytest

from hil.contract.messages import Belief, BoardState, VehicleState
from hil.safety.approach import wrong_board

MS = 1_000_000
NOW = 1_000 * MS
LEVEL, ZERO = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)


def found(distance=0.8, closing=3.6, off=0.3, age_ms=10, **changes):
    """What is found of a vehicle at `distance` m behind a board that drives along x at 1.5 m/s and is believed to be
    `off` m ahead of where it is."""
    stamp = NOW - age_ms * MS
    board = BoardState(stamp, (0.0, 0.0, 1.5), (1.5, 0.0, 0.0), LEVEL, 0.0, 1.5, 0.0)
    vehicle = VehicleState(stamp, (-distance, 0.0, 1.5), (1.5 + closing, 0.0, 0.0), LEVEL, ZERO)
    belief = replace(BELIEF, stamp_ns=stamp - 20 * MS, position=(off - 0.02 * BELIEF.speed, 0.0, 1.5))
    seen = {"vehicle": vehicle, "board": board, "believed": belief} | changes
    return wrong_board(NOW, **seen)


BELIEF = Belief(
    NOW, True, ZERO, 0.0, 2.5, 0.0, 1.2, rho=0.0, last_exposure_ns=NOW - 500 * MS, accepted=9, rejected=0,
    variance=(0.01,) * 9, acceleration=0.0, streak=9, surface_sigma=0.01,
)  # fmt: skip


def test_board_that_has_braked_unseen_is_found():
    assert found(age_ms=-4), "clocks of two computers differ by some milliseconds"
    assert found() == "the board is 0.30 m off where it is believed to be, 0.8 m ahead at 3.6 m/s"


def test_it_is_found_from_where_braking_to_two_metres_a_second_takes_the_whole_way():
    for closing in (2.2, 3.0, 4.0):
        needed = 0.15 * closing + (closing**2 - 4.0) / 20.0
        assert found(needed - 0.01, closing)
        assert not found(needed + 0.01, closing)


@pytest.mark.parametrize(
    "case",
    [
        pytest.param({"off": 0.14}, id="the belief is right"),
        pytest.param({"closing": 1.9, "distance": 0.2}, id="slow"),
        pytest.param({"closing": -3.6}, id="it flies away"),
        pytest.param({"distance": 0.0}, id="no direction"),
        pytest.param({"age_ms": 210}, id="motion capture is late"),
        pytest.param({"age_ms": -10}, id="stamped later than now"),
        pytest.param({"vehicle": None}, id="vehicle not seen"),
        pytest.param({"board": None}, id="board not seen"),
        pytest.param({"believed": None}, id="no belief"),
        pytest.param({"believed": replace(BELIEF, valid=False)}, id="belief not valid"),
    ],
)
def test_nothing_is_found(case):
    assert found(**case) == ""


@pytest.mark.parametrize("number", [math.nan, math.inf, 1e300])
def test_numbers_that_mean_nothing_find_nothing(number):
    board = BoardState(NOW, (number, 0.0, 1.5), ZERO, LEVEL, 0.0, 0.0, 0.0)
    assert found(board=board) == ""
