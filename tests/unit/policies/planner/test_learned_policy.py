from types import SimpleNamespace

import numpy as np
import pytest

from policies.planner.learned_policy import LearnedPlannerPolicy
from policies.planner.policy import PlannerPolicy
from policies.prediction.learned import load_predictor
from vehicle.quadrotor.airframe import load_airframe

TICK = 10_000_000


def fly(policy, ticks=120, speed=1.5):
    """Commands of a drone that hovers behind a board that drives away."""
    policy.reset(5_000_000_000)
    out = []
    for k in range(ticks):
        now = 5_000_000_000 + k * TICK
        vehicle = SimpleNamespace(
            stamp_ns=now, position=(-2.5 + speed * 0.01 * k, 0.0, 2.6), velocity=(speed, 0.0, 0.0),
            orientation=(1.0, 0.0, 0.0, 0.0), body_rate=(0.0, 0.0, 0.0),
        )  # fmt: skip
        board = SimpleNamespace(
            stamp_ns=now, valid=True, position=(speed * 0.01 * k, 0.0, 1.5), heading=0.0,
            speed=speed + 0.3 * np.sin(0.02 * k), turn_rate=0.1, inclination=0.5, acceleration=0.6 * np.cos(0.02 * k),
            rho=1.0, last_exposure_ns=now - 40_000_000, streak=10 + k, variance=(1e-4,) * 8,
            surface_sigma=0.005,
        )  # fmt: skip
        out.append(policy.step(now, vehicle, board))
    return out


@pytest.fixture(scope="module")
def airframe():
    return load_airframe("paper_quad")


def test_learned_planner_without_a_network_is_the_analytic_planner(airframe):
    assert fly(LearnedPlannerPolicy(airframe, net=np.zeros(0, np.float32))) == fly(PlannerPolicy(airframe))


def test_network_changes_the_flight_only_when_trusted(airframe):
    learned, analytic = fly(LearnedPlannerPolicy(airframe)), fly(PlannerPolicy(airframe))
    assert learned[:30] == analytic[:30]
    assert learned != analytic
    assert learned == fly(LearnedPlannerPolicy(airframe, net=load_predictor()))


def test_reset_clears_the_memory_of_the_board(airframe):
    policy = LearnedPlannerPolicy(airframe)
    first = fly(policy)
    assert policy._memory.any()
    assert fly(policy) == first
    policy.reset(0)
    assert not policy._memory.any()
