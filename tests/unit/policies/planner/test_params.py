import numpy as np
import pytest

from policies.planner import params as pp
from policies.planner.params import PlannerParams


def test_the_row_is_in_the_order_of_the_indices_with_the_steep_values_after_it():
    row = PlannerParams(gravity=9.5, run_commit=0.77, yaw_near=0.33, steep={"yaw_near": 0.44}).row()
    assert row.shape == (2 * pp.COUNT,)
    assert (row[pp.GRAVITY], row[pp.RUN_COMMIT], row[pp.YAW_NEAR]) == (9.5, 0.77, 0.33)
    assert (row[pp.COUNT + pp.GRAVITY], row[pp.COUNT + pp.YAW_NEAR]) == (9.5, 0.44)
    names = PlannerParams._names()
    assert all(getattr(pp, name.upper()) == i for i, name in enumerate(names))
    assert np.isfinite(PlannerParams().row()).all()


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"impact_speed": float("nan")}, "impact_speed"),
        ({"w_view": -1.0}, "w_view"),
        ({"t_min": 3.0}, "t_min"),
        ({"steep": {"wiew": 1.0}}, "wiew"),
        ({"steep": {"freeze": -1.0}}, "freeze"),
        ({"thrust_min": 20.0}, "thrust_min"),
    ],
)
def test_bad_values_are_refused_by_name(bad, words):
    with pytest.raises(ValueError, match=words):
        PlannerParams(**bad)
