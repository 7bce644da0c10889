"""The expert: it perches each airframe, from which it takes lags, limits and disc; it predicts the vehicle."""

import numpy as np
import pytest

from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.environment.observe import true_gain
from policies.evaluation.evaluate import point, run_episodes
from policies.task import result_row
from policies.task.contact import REASONS, SUCCESS
from policies.teachers import expert_row
from policies.teachers.lag import predict_vehicle
from policies.teachers.params import ExpertParams
from policies.teachers.teacher import Teacher
from vehicle.quadrotor import airframe_row, state_row

DRAG = {"sih_quad": (0.8, 1.2)}  # of the airframe's: its 1 1/s is much, and twice that holds it back from many boards


def fly(airframe, **settings):
    """The ended episodes under the expert."""
    teachers = {}

    def act(env):
        if id(env) not in teachers:
            teachers[id(env)] = Teacher(env)
        return teachers[id(env)].act()

    return run_episodes(act, EnvConfig(airframe=airframe, drag=DRAG.get(airframe, (0.0, 2.0)), **settings))


@pytest.mark.parametrize("airframe", ["paper_quad", "sih_quad", "crazyflie"])
def test_expert_perches_with_each_airframe_within_tolerance(airframe):
    rows = fly(airframe, count=96, seed=12, speed=(0.5, 2.0), inclination_deg=(10.0, 45.0))
    good = rows[:, result_row.OUTCOME] == SUCCESS
    assert good.mean() >= 0.95, [REASONS[int(k)] for k in rows[~good, result_row.REASON]]


@pytest.mark.parametrize("airframe", ["paper_quad", "sih_quad"])
def test_expert_perches_on_a_board_of_60_degrees(airframe):
    rows = fly(airframe, count=96, seed=13, **point(1.0, 60.0))
    assert (rows[:, result_row.OUTCOME] == SUCCESS).mean() >= 0.85


@pytest.mark.parametrize("airframe", ["paper_quad", "sih_quad", "crazyflie"])
def test_predicted_vehicle_is_nearer_to_the_later_one_than_the_present_one_is(airframe):
    """Under a command that is kept, over the time that the expert predicts, while the vehicle turns."""
    env = Env(EnvConfig(count=64, seed=3, airframe=airframe, motor_lag=(1.0, 1.0), rate_gain=(1.0, 1.0), wind=0.0))
    env.reset()
    e, rng = ExpertParams.of(env.airframe), np.random.default_rng(0)
    ticks = round(e.predicted / TICK)
    left, still = np.zeros((2, 64, 3)), np.zeros((2, 64, 3))
    for _ in range(10):  # a new command each time: the vehicle is always on its way to another body rate
        action = rng.uniform((-0.4, -0.4, -0.2, -0.3), (0.4, 0.4, 0.2, 0.6), (64, 4))
        env.step(action)
        rows, plan = env.rows, np.zeros((64, expert_row.DIM))
        before = rows.vehicle.copy()
        for i in range(64):
            drag = rows.params[i, airframe_row.DRAG] / rows.params[i, airframe_row.MASS]
            predict_vehicle(rows, i, plan[i], e.predicted, true_gain(rows, i, env.shared), drag, e.row())
        for _ in range(ticks):
            env.step(action)
        for k, (start, at, state) in enumerate(
            ((expert_row.START + 3, state_row.V, 3), (expert_row.ATTITUDE + 1, state_row.Q + 1, 3))
        ):
            left[k] += np.abs(plan[:, start : start + state] - rows.vehicle[:, at : at + state])
            still[k] += np.abs(before[:, at : at + state] - rows.vehicle[:, at : at + state])
    assert left[0].mean() < 0.3 * still[0].mean()
    assert left[1].mean() < 0.5 * still[1].mean()
