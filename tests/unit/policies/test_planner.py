import math

import numpy as np
import pytest

from policies import contact as ct
from policies import planner as pl
from policies import planner_trials as tt
from policies.belief_motion import BeliefParams
from policies.planner_cases import CASES, board_motion, board_motions
from policies.planner_params import PlannerParams
from policies.prediction import HORIZON, STEP

BELIEF, PLANNER = BeliefParams().row(), PlannerParams().row()


def fly(case, count, setup, traced=False):
    setup = tt.TrialSetup(**{"time_limit": CASES[case].time_limit, **setup})
    return tt.run_trials(board_motions(case, count, 3), setup, BELIEF, PLANNER, 3, traced=traced)


def rate(logs):
    return (logs[:, ct.OUTCOME] == ct.SUCCESS).mean()


@pytest.mark.parametrize("case", ["static65", "line45", "t1", "t2", "t3"])
def test_with_perfect_foresight_it_perches_every_time(case):
    logs, _ = fly(case, 24, {"mode": tt.FORESIGHT, "thrust": 0.0})
    assert rate(logs) == 1.0 and logs[:, ct.ATTACHED].mean() == 1.0
    assert logs[:, ct.PLANAR].mean() < 0.05 and logs[:, ct.NORMAL_ERROR].mean() < 0.08


@pytest.mark.parametrize(("case", "floor"), [("spline2_70", 0.85), ("hard1", 0.85), ("hard2", 0.85)])
def test_with_foresight_and_an_unknown_thrust_gain_it_still_perches_on_steep_boards(case, floor):
    logs, _ = fly(case, 24, {"mode": tt.FORESIGHT})
    assert rate(logs) >= floor


@pytest.mark.parametrize(("case", "floor"), [("static65", 0.95), ("line45", 0.8), ("t2", 0.85)])
def test_on_the_camera_model_with_a_tenth_of_the_paper_s_noise(case, floor):
    logs, _ = fly(case, 32, {"noise_scale": 0.1})
    assert rate(logs) >= floor, [ct.REASONS[int(reason)] for reason in logs[:, ct.REASON]]
    won = logs[logs[:, ct.OUTCOME] == ct.SUCCESS]
    assert -1.2 < won[:, ct.NORMAL_SPEED].mean() < -0.4


def test_phases_come_in_order_and_commands_stay_within_the_limits():
    logs, traces = fly("static65", 3, {"noise_scale": 0.1}, traced=True)
    for log, trace in zip(logs, traces, strict=True):
        flown = trace[: round(log[tt.L_TIME] / tt.DT)]
        phases = [int(p) for i, p in enumerate(flown[:, 31]) if i == 0 or p != flown[i - 1, 31]]
        assert phases[0] == pl.HOLD and pl.FOLLOW in phases and pl.RUN_UP in phases
        assert phases[-2:] == [pl.COMMIT, pl.TERMINAL]
        commands = flown[:, 10:14]
        assert np.isfinite(commands).all() and abs(commands[:, :3]).max() <= 3.5
        assert commands[:, 3].min() >= 4.8 and commands[:, 3].max() <= 14.8


def test_trials_repeat_exactly():
    first, _ = fly("t2", 4, {"noise_scale": 1.0})
    second, _ = fly("t2", 4, {"noise_scale": 1.0})
    assert np.array_equal(first, second)


def test_without_a_valid_belief_it_hovers_and_is_not_engaged():
    state, estimate, future, out = (
        np.zeros(pl.PLANNER_DIM),
        np.zeros(pl.ESTIMATE_DIM),
        np.zeros((HORIZON, 8)),
        np.zeros(4),
    )
    pl.planner_reset(state, 0.0, PLANNER)
    for k in range(50):
        phase = pl.planner_step(
            state, 0.01 * k, np.array([0, 0, 3.0]), np.zeros(3), np.array([1.0, 0, 0, 0]), np.zeros(8), estimate,
            future, STEP, PLANNER, out,
        )  # fmt: skip
        assert phase == pl.HOLD
    assert out == pytest.approx([0, 0, 0, 9.80665], abs=0.2)


def test_a_belief_that_is_lost_gives_a_plan_up_before_it_is_too_late():
    state, estimate, future, out = (
        np.zeros(pl.PLANNER_DIM),
        np.zeros(pl.ESTIMATE_DIM),
        np.zeros((HORIZON, 8)),
        np.zeros(4),
    )
    pl.planner_reset(state, 0.0, PLANNER)
    pl.certain(estimate)
    platform = np.array([2.0, 0, 1.5, 0, 0, 0, 0.6, 0.0])
    future[:] = platform
    phases = []
    for k in range(60):
        estimate[pl.E_AGE] = 0.0 if k < 20 else 2.0
        phases.append(
            pl.planner_step(
                state, 0.01 * k, np.array([0, 0, 2.3]), np.zeros(3), np.array([1.0, 0, 0, 0]), platform, estimate,
                future, STEP, PLANNER, out,
            )
        )  # fmt: skip
    assert pl.COMMIT in phases[:20] and phases[-1] == pl.FOLLOW


def test_board_motions_are_what_their_names_say():
    line = board_motion(CASES["line45"], 0, 0, 600)
    assert line[0, 4] == pytest.approx(0.52, abs=0.03) and line[500, 4] == pytest.approx(2.37, abs=0.05)
    hard = board_motion(CASES["hard1"], 0, 1, 900)
    assert hard[:, 4].min() < 1.15 and hard[:, 4].max() > 2.35 and math.degrees(hard[0, 6]) == pytest.approx(70)
    with pytest.raises(KeyError):
        board_motions("nowhere", 1)


def test_motions_too_short_for_the_time_limit_are_refused():
    with pytest.raises(ValueError, match="long"):
        tt.run_trials(np.zeros((1, 10, 8)), tt.TrialSetup(), BELIEF, PLANNER)
