import numpy as np
import pytest

from policies.planner import params_row
from policies.planner.params import STEEP, PlannerParams
from policies.planner.policy import planner_params
from vehicle.quadrotor.airframe import list_airframes, load_airframe

PARAMS = planner_params(load_airframe("paper_quad"))


def place(path):
    group, _, name = path.partition(".")
    return getattr(getattr(params_row, group), name)


def test_planner_row_columns_agree_with_their_names():
    changed = PARAMS.changed({"vehicle.drag": 0.3, "run_up.commit": 0.77, "glide.inclination": 0.11})
    row = changed.row()
    assert row.shape == (2 * params_row.COUNT,)
    assert [place(path) for path in changed.values()] == list(range(params_row.COUNT))
    assert all(row[place(path)] == value for path, value in changed.values().items())
    assert (changed.vehicle.drag, changed.run_up.commit, changed.glide.inclination) == (0.3, 0.77, 0.11)
    assert np.isfinite(row).all()


def test_second_half_of_the_row_has_the_values_for_steep_boards():
    changed = PARAMS.changed({"follow.yaw_near": 0.33}, {"follow.yaw_near": 0.44})
    row, steep = changed.row()[: params_row.COUNT], changed.row()[params_row.COUNT :]
    assert (row[place("follow.yaw_near")], steep[place("follow.yaw_near")]) == (0.33, 0.44)
    assert all(steep[place(path)] == value for path, value in STEEP.items())
    same = [place(path) for path in changed.values() if path not in changed.steep]
    assert np.array_equal(row[same], steep[same])


@pytest.mark.parametrize("name", list_airframes())
def test_planner_uses_dynamics_and_limits_of_the_airframe(name):
    airframe, vehicle = load_airframe(name), planner_params(load_airframe(name)).vehicle
    assert (vehicle.contact_below, vehicle.contact_radius) == (
        airframe.contact.magnet_below,
        airframe.contact.footprint_radius,
    )
    assert vehicle.thrust_lag == airframe.motors.lag
    assert [vehicle.thrust_min, vehicle.thrust_max, vehicle.rate_max] == airframe.limits_row().tolist()


@pytest.mark.parametrize(
    ("values", "steep", "words"),
    [
        ({"contact.speed": float("nan")}, {}, "contact.speed"),
        ({"weights.visibility": -1.0}, {}, "weights.visibility"),
        ({"search.duration_min": 3.0}, {}, "duration_min"),
        ({"weights.wiew": 1.0}, {}, "weights.wiew"),
        ({}, {"wiew": 1.0}, "wiew"),
        ({}, {"search.freeze": -1.0}, "search.freeze"),
        ({"vehicle.thrust_min": 20.0}, {}, "thrust_min"),
    ],
)
def test_bad_values_and_unknown_paths_are_refused_by_name(values, steep, words):
    with pytest.raises(ValueError, match=words):
        PARAMS.changed(values, steep)


def test_steep_values_of_a_new_set_are_checked_too():
    with pytest.raises(ValueError, match="do not exist: contact"):
        PlannerParams(PARAMS.vehicle, steep={"contact.wiew": 1.0})
