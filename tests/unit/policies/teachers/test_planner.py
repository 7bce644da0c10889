"""The planner in the training environment: what it answers is what the flying planner answers."""

from types import SimpleNamespace

import numpy as np
import pytest

from groundcar.motion import board_row
from policies.environment import episode_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.environment.observe import shown_odometry
from policies.estimation import belief_row, belief_state, thrust_row
from policies.estimation.board_ekf import belief_covariance, belief_predict, belief_valid, surface_sigma
from policies.estimation.thrust_drag import gain_reset
from policies.planner import state_row
from policies.planner.learned_policy import LearnedPlannerPolicy
from policies.planner.policy import PlannerPolicy, planner_params
from policies.task.observation import action_from_command
from policies.teachers.planner import ANALYTIC, LEARNED, PlannerInEnv, PlannerTeacher
from vehicle.quadrotor.airframe import GRAVITY

NS = 1e9


def views(env):
    """The inputs of a policy in flight, for row 0 now."""
    rows = env.rows
    now = rows.state[0, episode_row.STEP] * TICK
    x, p = np.zeros(8), np.zeros(belief_state.DIM * belief_state.DIM)
    position, velocity, orientation = (tuple(view) for view in shown_odometry(rows.scratch[0]))
    belief_covariance(rows.belief[0], now, env.shared.belief, x, p)
    rho = belief_predict(rows.belief[0], now, env.shared.belief, np.zeros(board_row.DIM))
    now_ns = round(now * NS)
    vehicle = SimpleNamespace(
        stamp_ns=now_ns, position=position, velocity=velocity, orientation=orientation, body_rate=(0.0, 0.0, 0.0),
    )  # fmt: skip
    board = SimpleNamespace(
        stamp_ns=now_ns, valid=bool(belief_valid(rows.belief[0], now, env.shared.belief)), position=tuple(x[:3]),
        heading=x[3], speed=x[4], turn_rate=x[5], inclination=x[6], acceleration=x[7],
        variance=tuple(p[:: belief_state.DIM + 1]),
        last_exposure_ns=round(rows.belief[0, belief_row.TIME] * NS), streak=int(rows.belief[0, belief_row.STREAK]),
        surface_sigma=surface_sigma(rows.belief[0]), rho=rho,
    )  # fmt: skip
    return now_ns, vehicle, board


@pytest.mark.parametrize(("source", "flying"), [(LEARNED, LearnedPlannerPolicy), (ANALYTIC, PlannerPolicy)])
def test_planner_commands_are_equal_in_environment_and_flight(source, flying):
    env = Env(EnvConfig(stage="vision", count=1, seed=3, inclination_deg=(20.0, 40.0), speed=(1.0, 1.5)))
    env.reset()
    gain_reset(env.rows.gain[0], GRAVITY)  # a flight's planner begins without having hovered
    assert env.rows.gain.shape == (1, thrust_row.DIM)
    planner, pilot, wanted = PlannerInEnv(source), flying(env.airframe), np.zeros(4)
    pilot.reset(0)
    flown = 0
    while flown < 150:
        command = pilot.step(*views(env))
        action_from_command(np.array([*command.body_rate, command.thrust]), env.shared.limits, wanted)
        action = planner(env)
        assert action[0] == pytest.approx(wanted, abs=1e-5)
        env.step(action)
        flown += 1
        if env.rows.done[0]:
            break
    assert flown > 60


@pytest.mark.parametrize("stage", ["state", "vision"])
def test_planner_of_a_stage_has_the_parameters_of_such_a_flight(stage):
    env = Env(EnvConfig(stage=stage, count=1, airframe="crazyflie"))
    planner = PlannerInEnv()
    planner.begin(env)
    assert np.array_equal(planner.params, planner_params(env.airframe, by_state=stage == "state").row())


def test_end_of_an_episode_and_a_new_environment_reset_the_planner():
    config = EnvConfig(stage="vision", count=4, seed=5, limit=40)
    planner, first, second = PlannerInEnv(), Env(config), Env(config)
    ran = []
    for env in (first, second):
        env.reset()
        ran.append([planner(env).copy()])
        for _ in range(60):
            env.step(planner(env))
            ran[-1].append(planner(env).copy())
    assert np.array_equal(ran[0], ran[1])


def test_teacher_flies_as_the_planner_with_its_values():
    def flown(policy):
        env = Env(EnvConfig(stage="vision", count=4, seed=5))
        env.reset()
        act = policy(env)
        for _ in range(150):
            env.step(act())
        return env.rows.vehicle.copy()

    def planner(env):
        made = PlannerInEnv(changes={"commit.cost": 4.0, "contact.lean": 0.0})
        return lambda: made(env)

    np.testing.assert_allclose(flown(lambda env: PlannerTeacher(env).act), flown(planner), atol=1e-6)


def test_teacher_finds_the_thrust_gain_from_the_commands_that_were_flown():
    env = Env(EnvConfig(stage="vision", count=16, seed=5, warm=0.0))
    env.reset()
    teacher = PlannerTeacher(env)
    for _ in range(60):
        teacher.act()
        env.step(np.tile([0.0, 0.0, 0.0, 0.2], (16, 1)))  # not what the teacher asks for
    gains = teacher._planner.states[:, state_row.GAIN + thrust_row.GAIN]
    assert np.abs(gains - env.rows.gain[:, thrust_row.GAIN]).max() < 0.02


def test_teacher_continues_from_its_checkpoint():
    env = Env(EnvConfig(stage="vision", count=4, seed=5))
    env.reset()
    first, second = PlannerTeacher(env), PlannerTeacher(env)
    for _ in range(60):
        env.step(first.act())
    second.load(first.state())
    assert np.array_equal(first.act().copy(), second.act())
    assert np.array_equal(first.remaining, second.remaining)
