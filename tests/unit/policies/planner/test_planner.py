"""The planner in closed loop on the training environment, and its rules on made-up estimates."""

import numpy as np
import pytest

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.evaluation.evaluate import point, run_episodes, summarise
from policies.guidance.params import GuidanceParams
from policies.planner import estimate_row, phases, state_row
from policies.planner import planner as pl
from policies.planner.estimate import certain
from policies.planner.policy import GUIDANCE, planner_params
from policies.prediction.future import HORIZON, STEP
from policies.teachers.planner import ANALYTIC, PlannerInEnv
from vehicle.quadrotor.airframe import load_airframe

PARAMS = planner_params(load_airframe("paper_quad"))
PLANNER = PARAMS.row()
LEAN = GuidanceParams.of(load_airframe("paper_quad")).lean
CONSTANT, COSINE = (1.0, 0, 0, 0), (0, 0, 1.0, 0)
CASES = {
    "static": {**point(0.0, 65.0), "families": (0, 0, 0, 0, 0, 1.0), "laws": CONSTANT},
    "line": {**point(2.5, 45.0), "families": (0, 1.0, 0, 0, 0, 0), "laws": CONSTANT},
    "T1": point(3.0, 0.0),
    "T2": point(2.0, 30.0),
    "T3": point(1.0, 60.0),
    "steep": point(2.0, 70.0),
    "oscillating": {**point(2.5, 70.0), "speed": (1.0, 2.5), "laws": COSINE},
}


def config(case, count, stage, **changes):
    """A case from a hovering start. The noise is one-sigma of our own detector where the stage is vision."""
    scales = {"odometry_noise": float(stage == "vision"), "noise_scale": (1.0, 1.0), "warm": 1.0, "limit": 1500}
    scales |= {"guidance": True, "guidance_changes": GUIDANCE}
    return EnvConfig(stage=stage, count=count, seed=3, **{**scales, **CASES[case], **changes})


def fly(case, count, source, stage="state", **changes):
    planner = PlannerInEnv(source)
    return summarise(case, run_episodes(planner, config(case, count, stage, **changes), noise="measured"))


@pytest.mark.parametrize("case", ["static", "T2", "T3"])
def test_planner_perches_within_tolerance_on_a_board_known_exactly(case):
    flown = fly(case, 24, ANALYTIC, thrust_to_weight=0.0)
    assert flown.success >= 90.0, flown.causes
    assert flown.position_error < 0.1
    assert flown.normal_error < LEAN + 0.05


@pytest.mark.parametrize(("case", "floor"), [("static", 95.0), ("line", 80.0), ("T2", 85.0)])
def test_planner_perches_on_the_belief_of_a_camera(case, floor):
    flown = fly(case, 32, ANALYTIC, "vision")
    assert flown.success >= floor, flown.causes
    assert 0.4 < flown.normal_speed < 1.2


def test_phases_come_in_order_and_commands_stay_within_the_limits():
    env, planner = Env(config("static", 3, "vision", inclination_deg=(72.0, 72.0))), PlannerInEnv(ANALYTIC)
    env.reset()
    flown, ended = [[] for _ in range(3)], np.zeros(3, dtype=bool)
    while not ended.all():
        actions = planner(env)
        assert np.isfinite(actions).all()
        assert np.abs(actions).max() <= 1.0
        for row in np.flatnonzero(~ended):
            phase = int(planner.states[row, state_row.PHASE])
            flown[row] += [phase] if flown[row][-1:] != [phase] else []
        env.step(actions)
        ended |= env.rows.done == 1
    for seen in flown:
        assert phases.FOLLOW in seen
        assert phases.RUN_UP in seen
        assert seen[-2:] == [phases.COMMIT, phases.TERMINAL]


def test_planner_without_a_valid_belief_hovers_and_is_not_engaged():
    state, estimate, future, out = (
        np.zeros(state_row.DIM),
        np.zeros(estimate_row.DIM),
        np.zeros((HORIZON, 8)),
        np.zeros(4),
    )
    pl.planner_reset(state, 0.0)
    for k in range(50):
        phase = pl.planner_step(
            state, 0.01 * k, np.array([0, 0, 3.0]), np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(8), estimate,
            future, STEP, PLANNER, out,
        )  # fmt: skip
        assert phase == phases.HOLD
    assert out == pytest.approx([0, 0, 0, 9.80665], abs=0.2)


def test_plan_is_given_up_when_the_belief_is_lost_early_enough():
    state, estimate, future, out = (
        np.zeros(state_row.DIM),
        np.zeros(estimate_row.DIM),
        np.zeros((HORIZON, 8)),
        np.zeros(4),
    )
    pl.planner_reset(state, 0.0)
    certain(estimate)
    board = np.array([2.0, 0, 1.5, 0, 0, 0, 0.6, 0.0])
    future[:] = board
    flown = []
    for k in range(60):
        estimate[estimate_row.AGE] = 0.0 if k < 20 else 2.0
        flown.append(
            pl.planner_step(
                state, 0.01 * k, np.array([0, 0, 2.3]), np.zeros(3), np.array([1.0, 0, 0, 0]), board, estimate,
                future, STEP, PLANNER, out,
            )
        )  # fmt: skip
    assert phases.COMMIT in flown[:20] and flown[-1] == phases.FOLLOW
