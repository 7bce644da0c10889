import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.board.layout import Board
from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.evaluation.evaluate import point, run_episodes, summarise
from policies.planner import phases, state_row
from policies.planner import planner as pl
from policies.planner.glide import _AHEAD, _BRAKE, glide, glide_reference, glide_sink
from policies.planner.policy import GUIDANCE, planner_params
from policies.prediction.future import HORIZON, STEP
from policies.teachers.planner import ANALYTIC, PlannerInEnv
from vehicle.camera.pinhole import Camera
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

PARAMS = planner_params(load_airframe("paper_quad"))
PLANNER = PARAMS.row()
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
SINK = glide_sink(PARAMS.vehicle.drag, 0.0, 0.0)  # over a board that goes straight on, with a fresh detection
T1 = {"stage": "vision", "seed": 3, "noise_scale": (1.0, 1.0), **point(3.0, 0.0)}


def flown(changes=None):
    planner = PlannerInEnv(ANALYTIC, changes)
    config = EnvConfig(guidance=True, guidance_changes=GUIDANCE, count=100, **T1)
    return summarise("T1", run_episodes(planner, config, noise="paper"))


@settings(max_examples=60, deadline=None)
@given(st.floats(0.0, 3.0))
def test_height_and_sink_rate_of_the_reference_are_consistent(away):
    step = 1e-5
    closing, sink, height, left = glide_reference(away, SINK)
    _, _, higher, longer = glide_reference(away + step, SINK)
    assert (higher - height) / step == pytest.approx(sink, abs=0.01)
    assert (longer - left) * closing == pytest.approx(step, rel=0.01)


@given(st.floats(0.0, 1.0), st.floats(-2.0, 2.0), st.floats(0.0, 10.0))
def test_sink_rate_falls_without_drag_and_in_turns_and_rises_with_the_age_of_the_belief(drag, turn, age):
    sink = glide_sink(drag, turn, age)
    assert 0.25 < sink < 0.55
    assert glide_sink(0.0, turn, age) <= sink <= glide_sink(1.0, turn, age)
    assert glide_sink(drag, 2.0, age) <= sink <= glide_sink(drag, 0.0, age)
    assert glide_sink(drag, turn, 0.0) <= sink <= glide_sink(drag, turn, 10.0)
    assert sink == glide_sink(drag, -turn, age)


@pytest.mark.parametrize("away", [0.12, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5])
def test_front_tag_stays_in_the_camera_s_view_along_the_reference(away):
    """At 3 m/s drag takes the nose down, braking takes it up: the angle below body x at which the tag appears."""
    _, _, height, _ = glide_reference(away, SINK)
    front = max(Board().tags, key=lambda tag: tag.x)
    tag, camera = front.x - front.width / 2, Camera().offset[0]  # m ahead of the board's centre, ahead of the drone's
    depression = math.atan2(height + PARAMS.vehicle.contact_below, away + tag - camera)
    nose_up = math.atan2(_BRAKE - 3.0 * PARAMS.vehicle.drag, GRAVITY)
    assert depression + nose_up < math.radians(15.0 + 26.45)


def test_commands_are_small_on_the_reference():
    out, board = np.zeros(4), np.array([0.0, 0, 1.5, 0, 3.0, 0, 0, 0])
    away = 0.6
    closing, sink, height, _ = glide_reference(away, SINK)
    p = np.array([-away, 0.0, 1.5 + PARAMS.vehicle.contact_below + height])
    v = np.array([3.0 + closing, 0.0, -sink * closing])
    assert not glide(p, v, LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out)
    assert np.abs(out[:3]).max() < 0.7
    assert out[3] == pytest.approx(9.8, abs=0.5)


@pytest.mark.parametrize(("away", "sinks"), [(0.15, True), (0.3, False)])
def test_glide_below_its_reference_climbs_behind_the_board_and_sinks_over_it(away, sinks):
    out, board = np.zeros(4), np.array([0.0, 0, 1.5, 0, 3.0, 0, 0, 0])
    p = np.array([-away, 0.0, 1.5 + PARAMS.vehicle.contact_below + 0.02])
    glide(p, np.array([3.0, 0.0, 0.0]), LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out)
    assert out[3] < 8.5 if sinks else out[3] > 9.8


def asked(height, sinking=0.4, side=0.0, turn=0.0):
    """Roll and pitch rate commanded by a level drone just behind a board at 3 m/s, `side` m beside the reference."""
    out, board = np.zeros(4), np.array([0.0, 0, 1.5, 0, 3.0, turn, 0, 0])
    p = np.array([-0.1, side, 1.5 + PARAMS.vehicle.contact_below + height])
    glide(p, np.array([3.3, 0.0, -sinking]), LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out)
    assert out[3] == pytest.approx(9.8, abs=1.0)  # leaning adds lateral thrust and keeps the vertical part
    return out[:2]


def test_glide_leans_towards_the_predicted_acceleration_of_a_turning_board():
    roll, pitch = asked(0.05, turn=0.5) - asked(0.05)
    assert roll < -0.5  # to the left and backward, as the board's heading goes on turning
    assert -pitch / -roll == pytest.approx(math.tan(0.5 * _AHEAD), abs=0.03)


def test_lateral_gain_is_higher_near_the_board():
    low, high = (asked(*where, side=0.05)[0] - asked(*where)[0] for where in ((0.02, 0.4), (0.5, 1.8)))
    assert low > 1.5 * high > 0.0


@pytest.mark.parametrize(("x", "z", "missed"), [(0.5, 1.8, True), (-0.1, 1.4, True), (-0.5, 1.4, False)])
def test_board_behind_or_above_the_vehicle_counts_as_missed(x, z, missed):
    board, out = np.array([0.0, 0, 1.5, 0, 0, 0, 0, 0]), np.zeros(4)
    assert glide(np.array([x, 0.0, z]), np.zeros(3), LEVEL, board, 0.0, 0.0, 1.0, PLANNER, out) is missed
    assert np.isfinite(out).all()


def test_glide_climbs_away_after_a_miss():
    state, out, board = np.zeros(state_row.DIM), np.zeros(4), np.array([0.0, 0, 1.5, 0, 0, 0, 0, 0])
    pl.planner_reset(state, 0.0)
    estimate, future = np.array([1.0, 0.01, 0.1, 0.0, 20.0, 0.0]), np.tile(board, (HORIZON, 1))
    arguments = (LEVEL, board, estimate, future, STEP, PLANNER, out)
    flown = [
        pl.planner_step(state, 0.01 * k, np.array([x, 0.0, 1.8]), np.zeros(3), *arguments)
        for k, x in enumerate((-0.5, 0.5, 0.5))
    ]
    assert flown[0] == phases.GLIDE and state[state_row.PHASE] == phases.AROUND and state[state_row.MISSES] == 1.0
    assert flown[2] == phases.AROUND and out[3] > 10.0


def test_glide_perches_more_often_than_a_plan_on_a_fast_flat_board():
    """The published noise, 3 m/s, flat: the belief of a board out of view is soon too old."""
    gliding, planned = flown(), flown({"glide.inclination": 0.0})
    assert gliding.success > planned.success + 10.0
    assert gliding.seen > planned.seen + 10.0
    assert gliding.normal_speed < 0.65


def test_planner_commits_to_a_plan_on_a_board_known_exactly():
    env, planner = Env(EnvConfig(count=8, seed=3, **point(3.0, 0.0))), PlannerInEnv(ANALYTIC)
    env.reset()
    seen = set()
    for _ in range(150):
        env.step(planner(env))
        seen |= set(planner.states[:, state_row.PHASE])
    assert phases.COMMIT in seen and phases.GLIDE not in seen
