"""The networks that come with the project perch whatever drag the vehicle has, and on the vehicle that they are for."""

from dataclasses import replace

import pytest

from policies.evaluation.contenders import open_contender
from policies.evaluation.evaluate import POINTS, changed, fly_cases


@pytest.mark.parametrize("name", ["state", "vision", "planner"])
def test_shipped_policy_perches_without_drag_and_with_double_drag(name):
    contender = open_contender(name)
    stage = "state" if name == "state" else "vision"
    config = replace(contender.config(stage, 5), count=100)
    cases = {str(factor): {**POINTS["T2"], "drag": (factor, factor)} for factor in (0.0, 2.0)}
    for row in fly_cases(contender.policy, changed(config, cases), "measured"):
        assert row.success >= 90.0, row


def test_network_of_the_sih_quadrotor_perches_more_often_than_the_planner_at_3_m_s():
    """The rig px4-sitl flies it in the planner's place. The drag is the airframe's own."""
    hits = []
    for contender in (open_contender("sih_quad"), replace(open_contender("planner"), airframe="sih_quad")):
        config = replace(contender.config("vision", 6), count=150, drag=(0.8, 1.2))
        (row,) = fly_cases(contender.policy, changed(config, {"T1": POINTS["T1"]}), "measured")
        hits.append(row.hits)
    assert hits[0] > hits[1] + 15, hits
