import dataclasses
import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.draw import MAX_SEED, draw, hover_pose
from scenarios.spec import list_scenarios, load


def test_equal_seeds_give_equal_numbers_and_others_do_not():
    spec = load("hard-ii")
    assert draw(spec, 7) == draw(spec, 7)
    a, b = draw(spec, 7), draw(spec, 8)
    differing = [f.name for f in dataclasses.fields(a) if getattr(a, f.name) != getattr(b, f.name)]
    assert set(differing) == {f.name for f in dataclasses.fields(a)} - {"scenario", "thrust_gain", "speed_phase"}


def test_equal_seeds_of_two_scenarios_give_different_splines():
    seeds = {draw(load(name), 0).spline_seed for name in list_scenarios()}
    assert len(seeds) == len(list_scenarios())


def test_seeds_of_one_run_are_all_different():
    drawn = draw(load("hard-i"), 0)
    seeds = [getattr(drawn, f.name) for f in dataclasses.fields(drawn) if f.name.endswith("_seed")]
    assert len(set(seeds)) == len(seeds) == 8
    assert all(0 <= s < 2**63 for s in seeds)


def test_changing_one_range_leaves_other_draws_unchanged():
    spec = load("hard-i")
    wider = spec.model_copy(update={"start": spec.start.model_copy(update={"distance": (2.0, 2.5)})})
    a, b = draw(spec, 3), draw(wider, 3)
    assert a.distance != b.distance
    assert dataclasses.replace(b, distance=a.distance) == a


@given(st.integers(0, MAX_SEED))
@settings(max_examples=100)
def test_draws_stay_in_their_ranges(seed):
    spec = load("hard-ii")
    d, r = draw(spec, seed), spec.randomisation
    assert spec.start.distance[0] <= d.distance <= spec.start.distance[1]
    assert spec.start.altitude[0] <= d.altitude <= spec.start.altitude[1]
    assert abs(d.azimuth) <= math.radians(60) + 1e-12
    assert math.degrees(math.atan2(d.altitude, d.distance)) <= spec.start.depression_max_deg + 1e-9
    assert 0.0 <= d.lap_start <= 1.0
    assert 3.0 <= d.switch_time <= 4.0
    assert abs(d.mass_factor - 1) <= r.mass + 1e-12
    assert abs(d.thrust_to_weight_factor - 1) <= r.thrust_to_weight + 1e-12
    assert abs(d.drag_factor - 1) <= r.drag <= 1
    assert abs(d.camera_tilt_offset) <= math.radians(5) + 1e-12


def test_spread_of_the_draws_is_that_of_their_distribution():
    spec = load("hard-i")
    runs = [draw(spec, seed) for seed in range(2000)]
    mass = np.array([d.mass_factor for d in runs])
    assert mass.mean() == pytest.approx(1.0, abs=0.02)
    assert mass.std() == pytest.approx(0.3 / math.sqrt(3), rel=0.05)
    angle = np.array([np.linalg.norm(d.vision_orientation_bias) for d in runs])
    assert np.sqrt((angle**2).mean()) == pytest.approx(math.radians(2.0), rel=0.06)
    assert np.array([d.vision_position_bias for d in runs]).std() == pytest.approx(0.02, rel=0.05)
    independent = np.corrcoef(mass, [d.thrust_to_weight_factor for d in runs])[0, 1]
    assert abs(independent) < 0.08


def test_draw_table_for_the_manifest_is_json():
    table = json.loads(json.dumps(draw(load("hard-i"), 0).table(), allow_nan=False))
    assert table["switch_time"] is None
    assert table["seed"] == 0
    assert draw(load("hard-ii"), 0).table()["switch_time"] > 0


def test_only_a_changing_path_has_a_switch():
    assert math.isinf(draw(load("hard-i"), 0).switch_time)
    assert draw(load("simple-i"), 0).lap_start == 0.0


@pytest.mark.parametrize("seed", [-1, MAX_SEED + 1, 1.5, True, "3"])
def test_seed_out_of_range_is_refused(seed):
    with pytest.raises(ValueError, match=f"whole number from 0 to {MAX_SEED}"):
        draw(load("hard-i"), seed)


@given(st.integers(0, 1000), st.floats(-5, 5), st.floats(-5, 5), st.floats(-10, 10))
@settings(max_examples=50)
def test_hover_is_behind_and_above_and_faces_the_board(seed, x, y, heading):
    spec = load("hard-i")
    drawn = draw(spec, seed)
    hx, hy, hz, yaw = hover_pose(spec, drawn, x, y, heading)
    assert math.hypot(hx - x, hy - y) == pytest.approx(drawn.distance)
    assert hz == pytest.approx(1.5 + drawn.altitude)
    # at least half the distance behind: the azimuth is within 60 degrees
    behind = -((hx - x) * math.cos(heading) + (hy - y) * math.sin(heading))
    assert behind >= 0.5 * drawn.distance - 1e-9
    to_board = math.atan2(y - hy, x - hx)
    assert abs(math.remainder(yaw - to_board, 2 * math.pi)) < 1e-9


def test_hover_may_face_the_cars_heading():
    spec = load("hard-i")
    facing = spec.model_copy(update={"start": spec.start.model_copy(update={"yaw": "heading"})})
    assert hover_pose(facing, draw(facing, 1), 0.0, 0.0, 0.7)[3] == pytest.approx(0.7)
