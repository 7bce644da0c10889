"""The networks that come with the project perch whatever drag the vehicle has."""

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
