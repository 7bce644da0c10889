import math

import numpy as np
import pytest

from groundcar.motion import board_motion as motion
from groundcar.motion import board_row
from hil.assembly.board_motion import hover_start, motion_aux, start_board
from kernel.random import stream
from scenarios.draw import draw
from scenarios.spec import list_scenarios, load


@pytest.mark.parametrize("name", list_scenarios())
def test_car_starts_on_its_path_and_the_vehicle_behind_it_facing_the_board(name):
    scenario = load(name)
    for seed in range(4):
        drawn = draw(scenario, seed)
        x, y, z, yaw = hover_start(scenario, drawn, 1.6)
        assert z == pytest.approx(scenario.board.height + drawn.altitude)
        if scenario.start.anchor == "car_start":
            board = start_board(scenario, drawn)
            assert math.hypot(x - board[0], y - board[1]) == pytest.approx(drawn.distance)
            bearing = math.atan2(board[1] - y, board[0] - x)
            assert math.remainder(yaw - bearing, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_equal_seeds_draw_equal_boards_and_others_do_not():
    scenario = load("hard-i")
    rows = [motion_aux(scenario, draw(scenario, seed)) for seed in (3, 3, 4)]
    assert np.array_equal(rows[0], rows[1])
    assert not np.array_equal(rows[0], rows[2])


def test_hard_i_board_motion_has_the_published_speeds():
    scenario = load("hard-i")
    drawn = draw(scenario, 1)
    aux, row = motion_aux(scenario, drawn), start_board(scenario, drawn)
    motion.motion_reset(row, aux, row[board_row.U], row[board_row.Z], row[board_row.INCLINATION], True)
    rng, speeds = stream(1), []
    for _ in range(600):
        motion.motion_step(row, aux, 0.01, rng)
        speeds.append(row[board_row.SPEED])
    assert min(speeds) == pytest.approx(1.0, abs=0.01)
    assert max(speeds) == pytest.approx(2.5, abs=0.01)
    assert row[board_row.INCLINATION] == pytest.approx(math.radians(70.0))
