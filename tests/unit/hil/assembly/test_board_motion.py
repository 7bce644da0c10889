import math

import numpy as np
import pytest

from groundcar.motion import board_motion as motion
from groundcar.motion import board_row
from hil.assembly.board_motion import Ride, hover_start, motion_aux, start_board
from hil.assembly.recorded_motion import identified
from kernel.random import stream
from kernel.toml_errors import ConfigError
from scenarios.draw import draw
from scenarios.spec import Scenario, list_scenarios, load


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


def boat(**laws):
    scenario = load("simple-i")
    return Scenario.model_validate(
        scenario.model_dump(mode="json") | {"board": {**scenario.board.model_dump(), **laws}}
    )


def test_board_rides_on_its_laws():
    heave = {"kind": "sine", "amplitude": 0.2, "period": 4.0}
    ride = Ride(boat(height_law=heave, inclination_law={"kind": "sines", "terms_deg": [(5.0, 8.0, 90.0)]}))
    height, rate, inclination = ride.at(1.0, None)
    set_angle = math.radians(load("simple-i").board.inclination_deg)
    assert (height, rate) == pytest.approx((load("simple-i").board.height + 0.2, 0.0), abs=1e-9)
    assert inclination == pytest.approx(set_angle + math.radians(5.0) * math.cos(math.pi / 4))
    assert ride.steepest == pytest.approx(set_angle + math.radians(5.0))


def test_board_without_laws_stands_as_it_is_set():
    scenario = load("hard-i")
    assert Ride(scenario).at(3.0, None) == (scenario.board.height, 0.0, math.radians(70.0))
    assert not scenario.tilts


def table(tmp_path, **changes):
    """A motion to the east at 2 m/s as a CSV, and the scenario that flies on it."""
    rows = [(0.05 * k, 0.1 * k, 1.0, 0.0) for k in range(100)]
    text = "t,x,y,heading\n" + "\n".join(",".join(map(str, row)) for row in rows) + "\n"
    (tmp_path / "motion.csv").write_text(changes.pop("text", text))
    path = {"kind": "recorded", "file": str(tmp_path / "motion.csv"), **changes}
    tables = load("simple-i").model_dump(mode="json") | {"path": path, "speed": {"kind": "recorded"}}
    return Scenario.model_validate(tables)


def test_recorded_motion_of_a_table_is_the_boards(tmp_path):
    scenario = identified(table(tmp_path))
    row = start_board(scenario, draw(scenario, 0))
    assert row[board_row.X] == 0.0 and row[board_row.SPEED] == pytest.approx(2.0)
    assert scenario.path.sha256 and identified(scenario) == scenario


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"text": "t,x,y,heading\n0,0,0,0\n"}, "1 samples"),
        ({"text": "t,x,y\n0,0,0\n"}, "no column heading"),
        ({"text": "t,x,y,heading\n0,0,0,east\n"}, "is no number"),
        ({"sha256": "0" * 64}, "its sha256 differs"),
        ({"file": "nowhere.csv"}, "nowhere.csv"),
        ({"file": "nowhere.mcap"}, "cannot be read"),
    ],
)
def test_recorded_motion_that_cannot_be_flown_is_refused(tmp_path, changes, message):
    with pytest.raises(ConfigError, match=message):
        identified(table(tmp_path, **changes))


def test_recorded_path_and_speed_need_each_other():
    tables = load("simple-i").model_dump(mode="json") | {"speed": {"kind": "recorded"}}
    with pytest.raises(ValueError, match="need each other"):
        Scenario.model_validate(tables)
    with pytest.raises(ValueError, match=r"needs path\.kind"):
        boat(height_law={"kind": "recorded"})
