import math

import numpy as np
import pytest

from groundcar.motion import board_motion as m
from groundcar.motion import motion_row
from groundcar.motion import paths as t
from groundcar.motion import speed_laws as s
from groundcar.motion.kinematics import accelerate, drive
from groundcar.motion.recorded import RecordedMotion
from groundcar.motion.splines import random_spline
from groundcar.scout.follower import CarRef, Follower, RecordedFollower, follow
from groundcar.scout.params import load_scout
from kernel.random import stream

MS = 1_000_000
GAINS = np.array([1.6, 1.6, 2.2, 0.8, 3.0, 2.5235])  # a gains row
RAMP = load_scout().follower.acceleration


def row(x=0.0, y=0.0, heading=0.0, speed=0.0, turn_rate=0.0):
    return np.array([x, y, 0.0, heading, speed, turn_rate, 0.0, 0.0])


def spline(seed, v):
    path = t.static_path()
    random_spline(stream(seed, 1), path, v)
    return path


def drive_along(aux, u, seconds, offset=(0.0, 0.0, 0.0), lag=0.08, age_ms=0, seed=0):
    """A car with a plain lag under the follower; rows (t, reference x, y, heading, speed, car x, y, heading, ask)."""
    follower = Follower(aux, u, stream(seed, 2))
    x, y, heading = (a + b for a, b in zip(follower.start_pose, offset, strict=True))
    v = w = 0.0
    past, out = [], []
    follower.start(200 * MS)
    for k in range(round(seconds * 100)):
        now = 200 * MS + 10 * k * MS
        past.append((x, y, heading, v, w, now))
        *measured, stamp = past[max(0, len(past) - 1 - age_ms // 10)]
        ref, asked = follower.step(now, *measured, stamp_ns=stamp)
        assert asked.stamp_ns == ref.stamp_ns == now
        for _ in range(5):
            v, w = v + (asked.speed - v) * 0.002 / lag, w + (asked.turn_rate - w) * 0.002 / lag
            x, y, heading = drive(x, y, heading, v, w, 0.002)
        out.append((10e-3 * k, *ref[1:5], *past[-1][:3], asked.speed))
    return np.array(out)


def errors(run, after):
    late = run[run[:, 0] >= after]
    turned = np.angle(np.exp(1j * (late[:, 3] - late[:, 7])))
    return np.hypot(late[:, 1] - late[:, 5], late[:, 2] - late[:, 6]), np.abs(turned)


CASES = {
    "spline": (m.motion_aux(t.SPLINE, spline(3, 2.0), s.CONSTANT, s.constant_speed(2.0)), 0.0),
    "racetrack": (m.motion_aux(t.RACETRACK, t.racetrack_path(), s.CONSTANT, s.constant_speed(2.0)), 0.0),
    "line": (m.motion_aux(t.LINE, t.line_path(heading=1.0), s.CONSTANT, s.constant_speed(2.5)), -math.pi / 2),
    "hard-ii": (
        m.motion_aux(
            t.SPLINE,
            spline(5, 2.2),
            s.SCHEDULED,
            s.scheduled_speed(2.2, 1.5),
            change_time=6.0,
            arc_radius=3.0,
        ),
        1.0,
    ),
}


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("age_ms", [0, 20])
def test_follower_converges_to_the_path_from_a_lateral_offset(name, age_ms):
    run = drive_along(*CASES[name], seconds=30.0, offset=(0.3, -0.2, 0.2), age_ms=age_ms)
    away, turned = errors(run, after=6.0)
    assert away.max() < 0.08
    assert turned.max() < 0.12


def test_follower_reverses_on_a_line_with_constant_heading():
    run = drive_along(*CASES["line"], seconds=30.0)
    _, turned = errors(run, after=1.0)
    assert run[:, 8].min() < -2.4
    assert turned.max() < 0.02


def test_the_car_is_held_still_until_the_start_and_start_may_lie_ahead():
    aux, u = CASES["spline"]
    follower = Follower(aux, u, stream(0))
    pose = follower.start_pose
    for now in (0, 100, 200):
        ref, asked = follower.step(now * MS, 1.0, 2.0, 3.0, 0.0, 0.0)
        assert asked[1:] == (0.0, 0.0)
        assert ref == CarRef(now * MS, *pose, 0.0, 0.0)
    follower.start(300 * MS)
    assert follower.step(290 * MS, *pose, 0.0, 0.0)[1].speed == 0.0
    follower.start(900 * MS)  # a second call does nothing
    ref, asked = follower.step(1300 * MS, *pose, 0.0, 0.0)
    assert ref.speed == pytest.approx(RAMP * 1.0)  # after one second
    assert asked.speed > 0.5


def test_the_reference_is_the_motion_whatever_the_period():
    aux, u = CASES["hard-ii"]
    coarse, fine = (Follower(aux, u, stream(0)) for _ in range(2))
    for follower, period in ((coarse, 20), (fine, 4)):
        follower.start(0)
        for now in range(0, 7001, period):
            ref, _ = follower.step(now * MS, 0.0, 0.0, 0.0, 0.0, 0.0)
        if follower is coarse:
            expected = ref
    assert ref[1:] == pytest.approx(expected[1:], abs=1e-9)
    own, rng = np.zeros(8), stream(0)
    limited = aux.copy()
    limited[motion_row.ACCEL_LIMIT] = RAMP
    m.motion_reset(own, limited, u, 0.0, 0.0, False)
    for _ in range(700):
        m.motion_step(own, limited, 0.01, rng)
    assert ref[1:] == pytest.approx([own[i] for i in (0, 1, 3, 4, 5)], abs=1e-9)


def test_preview_equals_the_later_reference():
    aux, u = CASES["hard-ii"]
    follower = Follower(aux, u, stream(0))
    foretold = follower.preview(7.0)
    follower.start(0)
    ref, _ = follower.step(7000 * MS, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert [foretold[i] for i in (0, 1, 3, 4, 5)] == pytest.approx(ref[1:], abs=1e-9)
    assert follower.start_pose == pytest.approx(ref[1:4], abs=1e-9)


def test_follower_does_not_change_its_aux_row():
    aux, u = CASES["hard-ii"]
    before = aux.copy()
    drive_along(aux, u, seconds=8.0)
    assert np.array_equal(aux, before)


def test_speed_law_noise_is_drawn_from_the_given_stream():
    aux = m.motion_aux(t.SPLINE, spline(3, 2.0), s.OU, s.ou_speed(2.0))
    a, b, c = (drive_along(aux, 0.0, 5.0, seed=seed) for seed in (1, 1, 2))
    assert np.array_equal(a, b)
    assert not np.array_equal(a, c)


def test_follower_commands_the_feed_forward_on_the_reference():
    speed, turn = follow(row(1.0, 2.0, 0.5, 1.0, 0.3), row(1.1, 2.0, 0.5, 1.2, 0.4), 1.0, 2.0, 0.5, GAINS)
    assert (speed, turn) == pytest.approx((1.2, 0.4))


@pytest.mark.parametrize("speed", [1.0, -1.0])
def test_follow_corrects_position_and_heading_errors(speed):
    here = row(speed=speed)
    assert follow(here, here, -0.1, 0.0, 0.0, GAINS)[0] > speed  # reference ahead
    assert follow(here, here, 0.1, 0.0, 0.0, GAINS)[0] < speed
    aside = follow(here, here, 0.0, -0.1, 0.0, GAINS)[1]  # reference to the left
    assert math.copysign(1.0, aside) == math.copysign(1.0, speed)  # backing, one steers the other way
    assert follow(here, here, 0.0, 0.0, -0.1, GAINS)[1] > 0.0


def test_commands_stay_within_the_car_s_limits():
    far = row(100.0, 100.0, 2.0, 2.9, 1.0)
    speed, turn = follow(far, far, 0.0, 0.0, 0.0, GAINS)
    assert abs(speed) <= 3.0
    assert abs(turn) == 2.5235
    assert follow(far, row(speed=0.0), 0.0, 0.0, 0.0, GAINS)[0] == pytest.approx(0.8)


def test_an_old_measurement_is_predicted_to_now_but_not_without_bound():
    aux, u = CASES["spline"]
    fresh, aged, ancient = (Follower(aux, u, stream(0)) for _ in range(3))
    for follower in (fresh, aged, ancient):
        follower.start(0)
    pose, speed, turn = (7.0, 0.1, 1.5), 1.5, 0.4
    _, expected = fresh.step(1000 * MS, *drive(*pose, speed, turn, 0.05), speed, turn)
    assert aged.step(1000 * MS, *pose, speed, turn, stamp_ns=950 * MS)[1] == pytest.approx(expected)
    _, bounded = fresh.step(1000 * MS, *drive(*pose, speed, turn, 0.2), speed, turn)
    assert ancient.step(1000 * MS, *pose, speed, turn, stamp_ns=0)[1] == pytest.approx(bounded)
    assert bounded != pytest.approx(expected)


def test_acceleration_helper_agrees_with_the_reference_s_ramp():
    aux, u = CASES["racetrack"]
    follower, v = Follower(aux, u, stream(0)), 0.0
    follower.start(0)
    for k in range(1, 80):
        v = accelerate(v, 2.0, RAMP, 0.01)
        ref, _ = follower.step(10 * k * MS, 0.0, 0.0, 0.0, 0.0, 0.0)
        assert ref.speed == pytest.approx(v)


def recorded():
    times = np.arange(40) * 0.1
    columns = {"t": times, "x": times, "y": 0.0 * times, "heading": 0.0 * times}
    return RecordedFollower(RecordedMotion(columns, 1.5, 0.5))


@pytest.mark.parametrize("make", [lambda: Follower(*CASES["spline"], stream(0, 2)), recorded], ids=["law", "recorded"])
def test_measurement_that_is_not_finite_or_later_than_now_is_refused(make):
    follower = make()
    follower.start(0)
    with pytest.raises(ValueError, match="drop it"):
        follower.step(1_000 * MS, math.nan, 0.0, 0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="later than now"):
        follower.step(1_000 * MS, 0.0, 0.0, 0.0, 0.0, 0.0, stamp_ns=1_006 * MS)
    follower.step(1_000 * MS, 0.0, 0.0, 0.0, 0.0, 0.0, stamp_ns=990 * MS)


@pytest.mark.parametrize("number", range(3))
def test_following_a_pose_that_is_not_a_number_gives_no_bound(number):
    pose = [0.1, 0.2, 0.3]
    pose[number] = math.nan
    assert any(map(math.isnan, follow(row(), row(speed=1.0, turn_rate=0.1), *pose, GAINS)))
