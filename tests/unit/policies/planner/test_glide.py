import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.board.layout import Board
from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.evaluation.evaluate import point, run_episodes, summarise
from policies.planner import params as pp
from policies.planner import planner as pl
from policies.planner.glide import _AHEAD, _BRAKE, glide, glide_reference, glide_sink
from policies.planner.params import PlannerParams
from policies.planner.policy import GUIDANCE
from policies.prediction.future import HORIZON, STEP
from policies.teachers.planner import ANALYTIC, PlannerInEnv
from vehicle.camera.pinhole import Camera

PLANNER = PlannerParams().row()
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
SINK = glide_sink(PLANNER[pp.DRAG], 0.0, 0.0)  # of a board that goes straight on and was seen just now
T1 = {"stage": "vision", "seed": 3, "noise_scale": (1.0, 1.0), **point(3.0, 0.0)}


def flown(**changes):
    planner = PlannerInEnv(ANALYTIC, **changes)
    return summarise(
        "T1", run_episodes(planner, EnvConfig(guidance=True, guidance_changes=GUIDANCE, count=100, **T1), noise="paper")
    )


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 3.0))
def test_heights_and_speeds_of_the_way_down_belong_together(away):
    step = 1e-5
    closing, sink, height, left = glide_reference(away, SINK)
    _, _, higher, longer = glide_reference(away + step, SINK)
    assert (higher - height) / step == pytest.approx(sink, abs=0.01)
    assert (longer - left) * closing == pytest.approx(step, rel=0.01)


@given(st.floats(0.0, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 10.0))
def test_it_comes_down_slower_without_drag_and_in_turns_and_faster_unseen(drag, turn, age):
    sink = glide_sink(drag, turn, age)
    assert 0.25 < sink < 0.55
    assert glide_sink(0.0, turn, age) <= sink <= glide_sink(1.0, turn, age)
    assert glide_sink(drag, 2.0, age) <= sink <= glide_sink(drag, 0.0, age)
    assert glide_sink(drag, turn, 0.0) <= sink <= glide_sink(drag, turn, 10.0)
    assert sink == glide_sink(drag, -turn, age)


@pytest.mark.parametrize("away", [0.12, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5])
def test_along_it_the_camera_sees_the_board_s_front_tag(away):
    """At 3 m/s drag takes the nose down, braking takes it up: the angle below body x at which the tag appears."""
    _, _, height, _ = glide_reference(away, SINK)
    front = max(Board().tags, key=lambda tag: tag.x)
    tag, camera = front.x - front.width / 2, Camera().offset[0]  # m ahead of the board's centre, ahead of the drone's
    depression = math.atan2(height + PLANNER[pp.ROBOT_L], away + tag - camera)
    nose_up = math.atan2(_BRAKE - 3.0 * PLANNER[pp.DRAG], PLANNER[pp.GRAVITY])
    assert depression + nose_up < math.radians(15.0 + 26.45)


def test_on_its_way_down_it_asks_for_little():
    out, board = np.zeros(4), np.array([0.0, 0, 1.5, 0, 3.0, 0, 0, 0])
    away = 0.6
    closing, sink, height, _ = glide_reference(away, SINK)
    p = np.array([-away, 0.0, 1.5 + PLANNER[pp.ROBOT_L] + height])
    v = np.array([3.0 + closing, 0.0, -sink * closing])
    assert not glide(p, v, LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out)
    assert np.abs(out[:3]).max() < 0.7
    assert out[3] == pytest.approx(9.8, abs=0.5)


@pytest.mark.parametrize(("away", "sinks"), [(0.15, True), (0.3, False)])
def test_too_low_it_climbs_back_but_over_the_board_it_touches(away, sinks):
    out, board = np.zeros(4), np.array([0.0, 0, 1.5, 0, 3.0, 0, 0, 0])
    p = np.array([-away, 0.0, 1.5 + PLANNER[pp.ROBOT_L] + 0.02])
    glide(p, np.array([3.0, 0.0, 0.0]), LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out)
    assert out[3] < 8.5 if sinks else out[3] > 9.8


def asked(height, sinking=0.4, side=0.0, turn=0.0):
    """Rates (roll, pitch) that a level drone asks for just behind a board at 3 m/s, in place but for `side` m."""
    out, board = np.zeros(4), np.array([0.0, 0, 1.5, 0, 3.0, turn, 0, 0])
    p = np.array([-0.1, side, 1.5 + PLANNER[pp.ROBOT_L] + height])
    glide(p, np.array([3.3, 0.0, -sinking]), LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out)
    assert out[3] == pytest.approx(9.8, abs=1.0)  # what it leans is sideways thrust, not less of it upward
    return out[:2]


def test_in_a_bend_it_leans_to_where_the_board_will_be_pulled_when_it_has_leaned():
    roll, pitch = asked(0.05, turn=0.5) - asked(0.05)
    assert roll < -0.5  # to the left, and back: the board's heading turns on
    assert -pitch / -roll == pytest.approx(math.tan(0.5 * _AHEAD), abs=0.03)


def test_what_it_is_off_to_the_side_counts_for_more_the_lower_it_is():
    low, high = (asked(*where, side=0.05)[0] - asked(*where)[0] for where in ((0.02, 0.4), (0.5, 1.8)))
    assert low > 1.5 * high > 0.0


@pytest.mark.parametrize(("x", "z", "missed"), [(0.5, 1.8, True), (-0.1, 1.4, True), (-0.5, 1.4, False)])
def test_a_board_passed_over_or_under_was_missed(x, z, missed):
    board, out = np.array([0.0, 0, 1.5, 0, 0, 0, 0, 0]), np.zeros(4)
    assert glide(np.array([x, 0.0, z]), np.zeros(3), LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out) is missed
    assert np.isfinite(out).all()


def test_after_a_miss_it_climbs_away():
    state, out, board = np.zeros(pl.PLANNER_DIM), np.zeros(4), np.array([0.0, 0, 1.5, 0, 0, 0, 0, 0])
    pl.planner_reset(state, 0.0, PLANNER)
    estimate, future = np.array([1.0, 0.01, 0.1, 0.0, 20.0, 0.0]), np.tile(board, (HORIZON, 1))
    arguments = (LEVEL, board, estimate, future, STEP, PLANNER, out)
    phases = [
        pl.planner_step(state, 0.01 * k, np.array([x, 0.0, 1.8]), np.zeros(3), *arguments)
        for k, x in enumerate((-0.5, 0.5, 0.5))
    ]
    assert phases[0] == pl.GLIDE and state[pl.S_PHASE] == pl.AROUND and state[pl.S_MISSES] == 1.0
    assert phases[2] == pl.AROUND and out[3] > 10.0


def test_in_sight_to_the_end_it_perches_where_a_plan_does_not():
    """The published noise, 3 m/s, flat: what is known of a board out of sight is soon too old."""
    gliding, planned = flown(), flown(glide_inclination=0.0)
    assert gliding.success > planned.success + 10.0
    assert gliding.seen > planned.seen + 10.0
    assert gliding.normal_speed < 0.65


def test_what_is_known_exactly_need_not_be_seen():
    env, planner = Env(EnvConfig(count=8, seed=3, **point(3.0, 0.0))), PlannerInEnv(ANALYTIC)
    env.reset()
    seen = set()
    for _ in range(150):
        env.step(planner(env))
        seen |= set(planner.states[:, pl.S_PHASE])
    assert pl.COMMIT in seen and pl.GLIDE not in seen
