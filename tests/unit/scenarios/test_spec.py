import shutil

import numpy as np
import pytest

from groundcar.board.layout import Board
from policies.task.contact import ContactRules
from scenarios.paper import RealRow, paper, published
from scenarios.spec import BOARD_SIZE, FOLDER, list_scenarios, load

NAMES = ["simple-i", "simple-ii", "normal-i", "normal-ii", "hard-i", "hard-ii"]


def test_six_published_scenarios_are_listed_in_the_order_of_the_paper():
    assert list_scenarios() == [*NAMES, "crazyflie-moving", "crazyflie-wall"]


@pytest.mark.parametrize("name", NAMES)
def test_a_scenario_agrees_with_its_published_row(name):
    spec = load(name)
    row = published(spec.published)
    assert isinstance(row, RealRow)
    assert spec.name == name
    assert spec.board.inclination_deg == row.inclination_deg
    assert spec.camera.rate == row.perception_desired_hz
    tolerance = paper().tolerance
    assert (spec.tolerance.distance, spec.tolerance.tangential_speed, spec.tolerance.angle) == (
        tolerance.distance,
        tolerance.tangential_speed,
        tolerance.angle,
    )


@pytest.mark.parametrize("name", NAMES)
def test_starts_lie_in_the_papers_ranges(name):
    spec, ranges = load(name), paper().initialisation
    assert ranges.altitude[0] <= spec.start.altitude[0] <= spec.start.altitude[1] <= ranges.altitude[1]
    if name != "simple-i":  # published near the detection limit, outside the training range
        assert ranges.distance[0] <= spec.start.distance[0] <= spec.start.distance[1] <= ranges.distance[1]
    assert all(abs(a) <= ranges.azimuth_deg[1] for a in spec.start.azimuth_deg)


def test_speeds_agree_with_the_published_rows():
    line = load("simple-ii")
    # speed of x = A sin(u) from its turning point, u growing by v / A, v itself reached within 2 m/s^2
    v, t = line.speed.speed, np.linspace(0.0, line.car.lead + 5.0, 10_000)
    law = np.minimum(2.0 * t, v)
    speed = law * np.sin(np.cumsum(law) * (t[1] - t[0]) / line.path.amplitude)
    window = speed[t >= line.car.lead]
    assert (window[0], window[-1]) == pytest.approx(published("real.simple-ii").platform_speed, abs=0.06)
    assert load("normal-i").speed.speed == load("normal-ii").speed.speed == 2.0
    hard = load("hard-i").speed
    assert (hard.minimum, hard.maximum, hard.period) == paper().trajectory.cosine
    change = load("hard-ii").speed
    assert (change.second, change.first) == published("real.hard-ii").platform_speed


def test_normal_i_starts_behind_the_vehicle():
    spec = load("normal-i")
    assert spec.start.anchor == "attempt_start"
    # the whole way driven before the attempt is longer than the farthest hover is behind the board
    assert spec.speed.speed * spec.car.lead > max(spec.start.distance)


def test_unknown_name_names_the_nearest_and_all():
    with pytest.raises(ValueError, match=r'did you mean "hard-ii"\?.*simple-i, simple-ii') as error:
        load("hard-iii")
    assert "\n" not in str(error.value)


@pytest.fixture
def edited(tmp_path):
    def edit(name, old, new):
        text = (FOLDER / f"{name.replace('-', '_')}.toml").read_text()
        assert old in text
        path = tmp_path / "mine.toml"
        path.write_text(text.replace(old, new))
        return path

    return edit


def test_scenario_file_loads_by_path(tmp_path):
    path = shutil.copy(FOLDER / "hard_i.toml", tmp_path / "mine.toml")
    assert load(path) == load(str(path)) == load("hard-i")


@pytest.mark.parametrize(
    ("name", "old", "new", "parts"),
    [
        ("hard-i", "rate = 60.0", "rat = 60.0", ['"camera.rat"', 'did you mean "rate"', "Allowed in camera: rate"]),
        ("hard-i", "minimum = 1.0", "minimun = 1.0", ['"speed.minimun"', 'did you mean "minimum"', "maximum, minimum"]),
        ("hard-i", 'kind = "cosine"', 'kind = "cosin"', ['"speed.kind"', 'did you mean "cosine"', "constant, ou"]),
        ("hard-i", "[camera]", "[kamera]", ['"kamera"', 'did you mean "camera"', "the top level"]),
        ("hard-ii", "turn = ", "turm = ", ['"path.then.turm"', 'did you mean "turn"', "after, radius, turn"]),
        ("hard-i", "rate = 60.0", 'rate = "fast"', ['"camera.rate"', "must be", "'fast'"]),
        ("hard-i", "rate = 60.0", "rate = -1", ['"camera.rate"', "greater than or equal to 1"]),
        ("hard-i", "rate = 60.0", 'rate = "60.0"', ['"camera.rate"', "valid number"]),
        ("hard-i", "[board]", "[board]\nsize = 0.5", ['"board.size"', "is 0.42 m and cannot be 0.5 m"]),
        ("hard-i", "[board]", "[board]\nsize = 0.84", ['"board.size"', "leave the key out"]),
        ("hard-i", "azimuth_deg", "depression_max_deg = 1e-300\nazimuth_deg", ['"start.depression_max_deg"']),
        ("hard-i", "time_limit = 15.0", "time_limit = 1e300", ['"time_limit"', "less than or equal to"]),
        ("hard-i", "period = 3.0", "period = 1e-300", ['"speed.period"', "greater than or equal to"]),
        ("hard-i", 'kind = "spline"', 'kind = "spline"\ncontrol_points = 1000000000', ['"path.control_points"']),
        ("hard-i", "rate = 60.0", "rate = nan", ['"camera.rate"', "finite"]),
        ("hard-i", "distance = [1.2, 3.5]", "distance = [3.5, 1.2]", ['"start.distance"', "in order"]),
        ("hard-i", "distance = [1.2, 3.5]", "distance = [1.2, 2.0]", ['"start"', "at least 3.08 m"]),
        ("hard-i", "minimum = 1.0", "minimum = 4.0", ['"speed"', "above maximum"]),
        ("hard-i", 'published = "real.hard-i"', 'published = "real.hard-1"', ["real.hard-i", "did you mean"]),
        ("hard-ii", '[path.then]\nafter = [3.0, 4.0]\nradius = 3.0\nturn = "left"', "", ["[path.then]"]),
        ("simple-i", "speed = 0.0", "speed = 1.0", ["static"]),
        ("simple-i", 'name = "simple-i"', 'name = "Simple I"', ['"name"']),
        ("hard-i", "[camera]", "[camera", ["not valid TOML"]),
    ],
)
def test_scenario_fault_names_file_key_and_allowed_values(edited, name, old, new, parts):
    path = edited(name, old, new)
    with pytest.raises(ValueError) as error:
        load(path)
    for part in [str(path), *parts]:
        assert part in str(error.value)


def test_all_faults_are_reported_together(edited):
    path = edited("hard-i", "rate = 60.0", "rat = 60.0")
    with pytest.raises(ValueError) as error:
        load(path)
    assert '"camera.rat"' in str(error.value)
    assert '"camera.rate" is missing' in str(error.value)


def test_missing_and_binary_files_are_refused(tmp_path):
    with pytest.raises(ValueError, match="cannot be read"):
        load(tmp_path / "nothing.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ValueError, match="UTF-8"):
        load(tmp_path / "binary.toml")


def test_the_only_size_of_the_board_is_the_printed_board_s(edited):
    assert Board().size == BOARD_SIZE
    assert load(edited("hard-i", "[board]", f"[board]\nsize = {BOARD_SIZE}")).board.size == BOARD_SIZE


def test_wall_has_velcro_s_limits_and_the_others_the_magnet_s():
    assert load("crazyflie-wall").attachment.impact_speed == (0.2, 2.0)
    assert load("crazyflie-moving").attachment == load("crazyflie-wall").attachment
    magnet = ContactRules()
    for name in NAMES:
        holds = load(name).attachment
        assert holds.impact_speed == (magnet.magnet_normal_min, magnet.magnet_normal_max)
        assert (holds.normal_error, holds.tangential_speed) == (magnet.magnet_normal_error, magnet.magnet_tangential)
