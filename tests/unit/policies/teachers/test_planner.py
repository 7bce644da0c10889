"""The planner in the training environment: what it answers is what the flying planner answers."""

from types import SimpleNamespace

import numpy as np
import pytest

from policies.environment import episode_row
from policies.environment.config import TICK, EnvConfig
from policies.environment.env import Env
from policies.environment.observe import shown_odometry
from policies.estimation.board_ekf import B_STREAK, B_T, belief_covariance, belief_valid, surface_sigma
from policies.estimation.ctrv import N
from policies.estimation.thrust_drag import G_GAIN, GAIN_DIM, gain_reset
from policies.planner.learned_policy import LearnedPlannerPolicy
from policies.planner.planner import S_GAIN
from policies.planner.policy import PlannerPolicy
from policies.task.contact import OUTCOME, SUCCESS
from policies.task.observation import action_from_command
from policies.teachers.planner import ANALYTIC, BELIEF, FORESIGHT, LEARNED, PlannerInEnv, PlannerTeacher
from vehicle.quadrotor.airframe import GRAVITY

NS = 1e9


def views(env):
    """What a flight would tell its policy about row 0 now."""
    rows = env.rows
    now = rows.state[0, episode_row.STEP] * TICK
    x, p = np.zeros(8), np.zeros(N * N)
    position, velocity, orientation = (tuple(view) for view in shown_odometry(rows.scratch[0]))
    belief_covariance(rows.belief[0], now, env.shared.belief, x, p)
    now_ns = round(now * NS)
    vehicle = SimpleNamespace(
        stamp_ns=now_ns, position=position, velocity=velocity, orientation=orientation, body_rate=(0.0, 0.0, 0.0),
    )  # fmt: skip
    board = SimpleNamespace(
        valid=bool(belief_valid(rows.belief[0], now, env.shared.belief)), position=tuple(x[:3]), heading=x[3],
        speed=x[4], turn_rate=x[5], inclination=x[6], acceleration=x[7], variance=tuple(p[:: N + 1]),
        last_exposure_ns=round(rows.belief[0, B_T] * NS), streak=int(rows.belief[0, B_STREAK]),
        surface_sigma=surface_sigma(rows.belief[0]),
    )  # fmt: skip
    return now_ns, vehicle, board


@pytest.mark.parametrize(("source", "flying"), [(LEARNED, LearnedPlannerPolicy), (ANALYTIC, PlannerPolicy)])
def test_one_episode_gets_the_flight_s_commands(source, flying):
    env = Env(EnvConfig(stage="vision", count=1, seed=3, inclination_deg=(20.0, 40.0), speed=(1.0, 1.5)))
    env.reset()
    gain_reset(env.rows.gain[0], GRAVITY)  # a flight's planner begins without having hovered
    assert env.rows.gain.shape == (1, GAIN_DIM)
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


def test_an_episode_s_end_and_a_new_environment_start_it_anew():
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


def test_as_a_teacher_it_waits_for_the_camera_and_then_knows_the_future():
    def ended(teach):
        env = Env(EnvConfig(stage="vision", count=48, seed=9, inclination_deg=(20.0, 30.0), speed=(2.6, 3.0)))
        env.reset()
        teacher, planner = PlannerTeacher(env), PlannerInEnv()
        while len(env.tally.rows) < 48:
            env.step(teacher.act() if teach else planner(env))
        return (env.tally.rows[:, OUTCOME] == SUCCESS).mean()

    assert ended(teach=True) > 0.97 > 0.9 > ended(teach=False)


def test_a_teacher_on_the_belief_would_fly_as_the_planner_does():
    def flown(policy):
        env = Env(EnvConfig(stage="vision", count=4, seed=5))
        env.reset()
        act = policy(env)
        for _ in range(150):
            env.step(act())
        return env.rows.vehicle.copy()

    def planner(env):
        made = PlannerInEnv(commit_cost=4.0, lean=0.0)
        return lambda: made(env)

    np.testing.assert_allclose(flown(lambda env: PlannerTeacher(env, BELIEF).act), flown(planner), atol=1e-6)


def test_a_teacher_learns_the_thrust_gain_from_whoever_flies():
    env = Env(EnvConfig(stage="vision", count=16, seed=5, warm=0.0))
    env.reset()
    teacher = PlannerTeacher(env, BELIEF)
    for _ in range(60):
        teacher.act()
        env.step(np.tile([0.0, 0.0, 0.0, 0.2], (16, 1)))  # not what the teacher asks for
    gains = teacher._planner.states[:, S_GAIN + G_GAIN]
    assert np.abs(gains - env.rows.gain[:, G_GAIN]).max() < 0.02


@pytest.mark.parametrize("knows", [FORESIGHT, BELIEF])
def test_a_teacher_goes_on_from_its_checkpoint(knows):
    env = Env(EnvConfig(stage="vision", count=4, seed=5))
    env.reset()
    first, second = PlannerTeacher(env, knows), PlannerTeacher(env, knows)
    for _ in range(60):
        env.step(first.act())
    second.load(first.state())
    assert np.array_equal(first.act().copy(), second.act())
    assert np.array_equal(first.remaining, second.remaining)
