from types import SimpleNamespace

import numpy as np
import pytest

from policies.planner_policy import PlannerPolicy
from policies.predictor import load_predictor
from policies.predictor_cases import scout_motion
from policies.predictor_policy import LearnedPlannerPolicy
from policies.predictor_trials import with_error_bars
from vehicle.airframe import load_airframe

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
        )  # fmt: skip
        out.append(policy.step(now, vehicle, board))
    return out


@pytest.fixture(scope="module")
def airframe():
    return load_airframe("paper_quad")


def test_without_a_network_it_is_the_analytic_planner(airframe):
    assert fly(LearnedPlannerPolicy(airframe, net=np.zeros(0, np.float32))) == fly(PlannerPolicy(airframe))


def test_network_changes_the_flight_only_once_it_is_trusted(airframe):
    learned, analytic = fly(LearnedPlannerPolicy(airframe)), fly(PlannerPolicy(airframe))
    assert learned[:30] == analytic[:30]
    assert learned != analytic
    assert learned == fly(LearnedPlannerPolicy(airframe, net=load_predictor()))


def test_reset_forgets_the_board(airframe):
    policy = LearnedPlannerPolicy(airframe)
    first = fly(policy)
    assert policy._memory.any()
    assert fly(policy) == first
    policy.reset(0)
    assert not policy._memory.any()


def test_simulated_car_overshoots_the_law_and_repeats():
    drive = scout_motion("scout_hard1", 3, 0, 400)
    np.testing.assert_array_equal(drive, scout_motion("scout_hard1", 3, 0, 400))
    assert np.ptp(drive[:, 4]) > 1.2 and drive[:, 4].max() > 2.4
    moved = np.hypot(*np.diff(drive[:, :2], axis=0).T) / 0.01
    np.testing.assert_allclose(moved, np.abs(drive[1:, 4]), atol=0.12)
    with pytest.raises(KeyError):
        scout_motion("boat", 0, 0, 10)


def test_interval_holds_the_share():
    share, low, high = with_error_bars(90, 100)
    assert share == 90.0 and low == pytest.approx(82.6, abs=0.1) and high == pytest.approx(94.5, abs=0.1)
