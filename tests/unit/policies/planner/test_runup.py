import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from policies.planner import params_row as pp
from policies.planner import runup as ru
from policies.planner.policy import planner_params
from policies.prediction import speed_history as sh
from policies.prediction.future import HORIZON, STEP
from vehicle.quadrotor.airframe import GRAVITY, load_airframe

PARAMS = planner_params(load_airframe("paper_quad"))
ROW, VALUES = PARAMS.row()[pp.COUNT :], PARAMS.steep_values()


@settings(max_examples=40, deadline=None)
@given(st.floats(0.3, 1.45))
def test_flare_ends_on_the_board_at_the_contact_speed(inclination):
    x, z, vx, vz, duration = ru.flare_start(inclination, ROW)
    steps, pitch = 4000, 0.0
    dt = duration / steps
    for _ in range(steps):
        pitch += 0.5 * VALUES["run_up.rate"] * dt
        ax = -VALUES["run_up.thrust"] * math.sin(pitch)
        az = VALUES["run_up.thrust"] * math.cos(pitch) - GRAVITY
        x, z = x + dt * (vx + 0.5 * dt * ax), z + dt * (vz + 0.5 * dt * az)
        vx, vz = vx + dt * ax, vz + dt * az
        pitch += 0.5 * VALUES["run_up.rate"] * dt
    n = np.array([-math.sin(inclination), math.cos(inclination)])
    assert pitch == pytest.approx(inclination, abs=1e-6)
    assert [x, z] == pytest.approx(VALUES["vehicle.contact_below"] * n, abs=1e-3)
    assert [vx, vz] == pytest.approx(-VALUES["contact.speed"] * n, abs=1e-3)


@pytest.mark.parametrize("degrees", [62.0, 65.0, 70.0, 75.0, 80.0])
def test_camera_sees_the_board_at_the_start_of_the_run_up(degrees):
    inclination = math.radians(degrees)
    x, z, *_ = ru.runup_reference(ru.runup_time(inclination, ROW), inclination, ROW)
    lowest = VALUES["vehicle.camera_tilt"] + VALUES["search.half_view"]  # held level there
    assert 0.5 * lowest < math.atan2(z, -x) < lowest - math.radians(5.0)


def test_reference_starts_at_rest_and_reaches_the_flare_without_a_jump():
    inclination = math.radians(70.0)
    whole = ru.runup_time(inclination, ROW)
    start = ru.runup_reference(whole, inclination, ROW)
    assert start[2] == pytest.approx(0.0, abs=1e-9)
    flare = ru.flare_start(inclination, ROW)
    assert ru.runup_reference(0.0, inclination, ROW)[:4] == pytest.approx(flare[:4])
    times = np.linspace(whole, -0.1, 400)
    rows = np.array([ru.runup_reference(t, inclination, ROW) for t in times])
    dt = times[0] - times[1]
    for position, velocity in ((0, 2), (1, 3)):
        mean = 0.5 * (rows[1:, velocity] + rows[:-1, velocity])
        assert np.diff(rows[:, position]) / dt == pytest.approx(mean, abs=0.01)
    assert np.all(np.diff(rows[:, 0]) >= -1e-9)


def test_at_its_start_with_the_board_s_speed_the_run_up_holds_position():
    inclination, speed = math.radians(70.0), 1.5
    left = ru.runup_time(inclination, ROW)
    x, z, *_ = ru.runup_reference(left, inclination, ROW)
    board = np.array([3.0, 1.0, 1.5, 0.5, speed, 0.0, inclination, 0.0])
    c, s, out = math.cos(0.5), math.sin(0.5), np.zeros(4)
    p = np.array([3.0 + x * c, 1.0 + x * s, 1.5 + z])
    v = np.array([speed * c, speed * s, 0.0])
    q = np.array([math.cos(0.25), 0.0, 0.0, math.sin(0.25)])
    error, rate = ru.fly_runup(left, True, p, v, q, board, 0.0, 1.0, ROW, out)
    assert (error, rate) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert out[3] == pytest.approx(GRAVITY, abs=0.05) and abs(out[0]) < 1e-9 and out[1] > 0  # leans into the drag
    moving, _ = ru.fly_runup(left - 1.0, False, p, v, q, board, 0.0, 1.0, ROW, out)
    assert moving > 0.3 and out[1] > 0.5  # behind: nose down


@pytest.mark.parametrize(
    ("behind", "closing"),
    [(1.0, VALUES["run_up.pull"]), (2.0, 2.0 * VALUES["run_up.pull"]), (20.0, VALUES["follow.speed"])],
)
def test_speed_towards_the_start_grows_with_the_distance_up_to_a_limit(behind, closing):
    inclination = math.radians(70.0)
    drag_free = PARAMS.changed({"vehicle.drag": 0.0}).row()[pp.COUNT :]
    left = ru.runup_time(inclination, ROW)
    x, z, *_ = ru.runup_reference(left, inclination, ROW)
    board = np.array([0.0, 0.0, 1.5, 0.0, 2.0, 0.0, inclination, 0.0])
    p, level = np.array([x - behind, 0.0, 1.5 + z]), np.array([1.0, 0.0, 0.0, 0.0])
    pitch_rates = []
    for faster in (-0.2, 0.0, 0.2):
        out, v = np.zeros(4), np.array([2.0 + closing + faster, 0.0, 0.0])
        ru.fly_runup(left, True, p, v, level, board, 0.0, 1.0, drag_free, out)
        pitch_rates.append(out[1])
    assert pitch_rates[0] > 0.1 and abs(pitch_rates[1]) < 1e-6 and pitch_rates[2] < -0.1


def oscillating(phase):
    """Past and future of a board whose speed oscillates between 1.0 and 2.5 m/s every 3 s; `phase` rad is now."""

    def speed(t):
        return 1.75 + 0.75 * math.cos(phase + 2.0 * math.pi * t / 3.0)

    history, future = np.zeros(sh.HISTORY_DIM), np.zeros((HORIZON, 8))
    for k in range(400):
        sh.history_push(history, 0.01 * k, speed(0.01 * k - 4.0))
    future[:, 4] = [speed(STEP * k) for k in range(HORIZON)]
    return future, history, speed


@pytest.mark.parametrize("share", [0.1, 0.3])
def test_run_up_begins_only_for_contact_at_low_board_speed(share):
    inclination = math.radians(70.0)
    there = ru.runup_time(inclination, ROW) + ru.flare_start(inclination, ROW)[4]
    taken = 0
    for phase in np.linspace(0.0, 2.0 * math.pi, 40, endpoint=False):
        future, history, speed = oscillating(phase)
        begun = ru.met_slow(future, STEP, inclination, share, history, ROW)
        taken += begun
        if abs(speed(there) - 1.0 - 1.5 * share) > 0.1:
            assert begun == (speed(there) < 1.0 + 1.5 * share)
    assert taken > 0


def test_run_up_waits_for_an_oscillating_board_without_a_predicted_slow_phase():
    inclination = math.radians(70.0)
    future, history, _ = oscillating(0.0)
    future[:, 4] = 2.5
    assert not ru.met_slow(future, STEP, inclination, 0.2, history, ROW)
    steady = np.zeros(sh.HISTORY_DIM)
    for k in range(400):
        sh.history_push(steady, 0.01 * k, 2.5)
    assert ru.met_slow(future, STEP, inclination, 0.2, steady, ROW)


@pytest.mark.parametrize(
    ("speed", "degrees", "runs"),
    [(0.0, 67.0, False), (-0.3, 67.0, False), (0.0, 69.0, True), (1.0, 64.0, False), (1.0, 67.0, True),
     (2.0, 63.0, True), (-2.0, 63.0, True), (2.0, 61.0, False)],
)  # fmt: skip
def test_a_slow_board_has_to_be_steeper_for_a_run_up(speed, degrees, runs):
    board = np.array([0.0, 0.0, 1.5, 0.0, speed, 0.0, math.radians(degrees), 0.0])
    assert ru.runs_up(board, ROW) == runs
