import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal
from kernel.random import normal, stream
from policies.estimation import belief_row, belief_state
from policies.estimation import board_ekf as b
from policies.estimation.board_filter import BoardFilter
from policies.estimation.ctrv import BeliefParams, advance_covariance, advance_state

PARAMS = BeliefParams()
MS = 1_000_000


def quaternion(heading, inclination, roll=0.0):
    """World from board: Rz(heading) Ry(-inclination) Rx(roll)."""
    (ch, sh), (ci, si), (cr, sr) = ((math.cos(a / 2), math.sin(a / 2)) for a in (heading, -inclination, roll))
    w, x, y, z = ch * ci, -sh * si, ch * si, sh * ci
    return (w * cr - x * sr, w * sr + x * cr, y * cr + z * sr, z * cr - y * sr)


def motion(kind, t, rng, state):
    """Advance a true board by 5 ms: `state` [x, y, heading, eta, curvature]; returns (speed, turn rate)."""
    dt, speed = 0.005, 2.0
    if kind == "ou":
        beta = dt / (1.0 + dt)
        state[3] = (1 - beta) * state[3] + 0.1 * math.sqrt(beta) * normal(rng)
        speed = 2.0 * math.exp(state[3])
    if kind == "cosine":
        speed = 1.0 + 0.75 * (1 + math.cos(2 * math.pi * t / 3.0))
    if kind == "static":
        speed = 0.0
    if kind == "start":
        speed = min(2.0, max(0.0, 2.0 * (t - 2.5)))
    if kind == "line":
        speed = 2.35 * math.cos(2.35 / 4.0 * t)
    curvature = 0.0 if kind == "line" else 0.35 * math.sin(0.9 * t + state[4])
    state[0] += speed * dt * math.cos(state[2])
    state[1] += speed * dt * math.sin(state[2])
    state[2] += speed * curvature * dt
    return speed, speed * curvature


def run(kind, seed, sigma=0.03, angle=0.03, lost=(), period=6, seconds=6.0, params=None, bias=0.0):
    """Feed a filter at 200 / period Hz; returns it with NIS, NEES of position and of speed and turn rate, and truth.

    What is measured wanders about the truth as the filter expects of calibration and odometry; headings by `bias` rad.
    """
    rng, filter_ = stream(seed, 1), BoardFilter(params)
    state = np.array([0.0, 0.0, 0.3 * seed, 0.0, seed * 1.7])
    nis, nees, speeds, codes = [], [], [], []
    truth, wander = np.zeros(8), np.zeros(5)
    walk = np.array([PARAMS.q_position, PARAMS.q_position, 0.5 * PARAMS.q_position, 0.0, PARAMS.q_inclination])
    for k in range(int(seconds * 200)):
        t = k * 0.005
        speed, turn = motion(kind, t, rng, state)
        wander += math.sqrt(0.005) * walk * [normal(rng) for _ in walk]
        x, y, z, heading, inclination = np.array([state[0], state[1], 1.5, state[2], 0.9]) + wander
        truth[:] = (x, y, z, b.wrap(heading), speed, turn, inclination, 0.0)
        if k % period or any(a <= t < z for a, z in lost):
            continue
        noisy = (x + sigma * normal(rng), y + sigma * normal(rng), z + sigma * normal(rng))
        q = quaternion(heading + bias + angle * normal(rng), inclination + angle * normal(rng))
        codes.append(filter_.update(int((t + 0.005) * 1e9), noisy, q, sigma, angle))
        if t > 1.0 and codes[-1] == "accepted":
            nis.append(filter_.row[belief_row.NIS])
            error = filter_.row[:8] - truth
            cov = filter_.row[belief_row.COVARIANCE : belief_row.TIME].reshape(belief_state.DIM, belief_state.DIM)
            nees.append(error[:2] @ np.linalg.solve(cov[:2, :2], error[:2]))
            speeds.append(error[4:6] @ np.linalg.solve(cov[4:6, 4:6], error[4:6]))
    return filter_, np.array(nis), np.array(nees), np.array(speeds), truth, codes


@pytest.mark.parametrize("kind", ["ou", "cosine", "line"])
@pytest.mark.parametrize("sigma", [0.08, 0.008])
def test_errors_are_consistent_with_the_covariance(kind, sigma):
    runs = [run(kind, seed, sigma, sigma) for seed in range(6)]
    nis = np.concatenate([r[1] for r in runs]).mean()
    position = np.concatenate([r[2] for r in runs]).mean()
    speed = np.concatenate([r[3] for r in runs]).mean()
    assert 3.5 < nis < 6.0  # five degrees of freedom
    assert 0.5 < position < 3.0  # two degrees of freedom
    assert 0.2 < speed < 3.0
    assert sum(code != "accepted" for r in runs for code in r[5]) <= 0.01 * sum(len(r[5]) for r in runs)


@pytest.mark.parametrize("kind", ["ou", "cosine"])
def test_filter_recovers_after_a_second_without_measurements_in_a_turn(kind):
    for seed in range(8):
        filter_, *_, truth, codes = run(kind, seed, 0.02, 0.02, lost=((3.0, 4.0),))
        now = filter_.estimate(6_000 * MS)
        assert codes[-10:] == ["accepted"] * 10
        assert sum(code in ("gated", "restarted") for code in codes) <= 6
        assert math.hypot(now.position[0] - truth[0], now.position[1] - truth[1]) < 0.05
        assert abs(now.speed - truth[4]) < 0.35


def test_innovation_test_refuses_an_outlier_and_restarts_after_a_jump():
    filter_ = BoardFilter()
    for k in range(20):
        assert filter_.update(k * 30 * MS, (0.06 * k, 0, 1.5), quaternion(0, 0.5), 0.02, 0.02) == "accepted"
    assert filter_.update(600 * MS, (4.0, 2.0, 1.5), quaternion(1.5, 0.5), 0.02, 0.02) == "gated"
    assert filter_.update(630 * MS, (1.26, 0, 1.5), quaternion(0, 0.5), 0.02, 0.02) == "accepted"
    codes = [
        filter_.update((660 + 30 * k) * MS, (4.0, 2.0 + 0.06 * k, 1.5), quaternion(1.5, 0.5), 0.02, 0.02)
        for k in range(6)
    ]
    assert codes == ["gated", "gated", "restarted", "accepted", "accepted", "accepted"]
    scattered = [
        filter_.update((900 + 30 * k) * MS, (5.0 * (-1) ** k, 9.0, 1.5), quaternion(1.5, 0.5), 0.02, 0.02)
        for k in range(6)
    ]
    assert set(scattered) == {"gated"}


def test_invalid_measurements_are_counted_and_ignored():
    filter_ = BoardFilter()
    for k in range(10):
        filter_.update(k * 33 * MS, (0, 0, 1.5), quaternion(0.2, 0.0), 0.02, 0.02)
    before = filter_.row[: belief_row.TIME + 1].copy()
    assert filter_.update(400 * MS, (math.nan, 0, 1.5), quaternion(0.2, 0), 0.02, 0.02) == "not_finite"
    assert filter_.update(400 * MS, (0, 0, 1.5), quaternion(0.2, 0), 0.0, 0.02) == "not_finite"
    assert filter_.update(400 * MS, (0, 0, 1.5), (math.nan, 0, 0, 0), 0.02, 0.02) == "not_finite"
    assert filter_.update(100 * MS, (0, 0, 1.5), quaternion(0.2, 0), 0.02, 0.02) == "out_of_order"
    assert filter_.update(400 * MS, (0, 0, 1.5), quaternion(0.2, -0.9), 0.02, 0.02) == "implausible"
    assert filter_.update(400 * MS, (0, 0, 1.5), quaternion(0.2, 0.3, roll=0.7), 0.02, 0.02) == "implausible"
    assert np.array_equal(before, filter_.row[: belief_row.TIME + 1])
    assert filter_.estimate(400 * MS).rejected == 6 and filter_.estimate(400 * MS).accepted == 10


def test_reliability_validity_and_the_exposure_time_in_the_estimate():
    filter_ = BoardFilter()
    assert filter_.estimate(5).rho == 0.0 and not filter_.estimate(5).valid
    for k in range(10):
        assert filter_.estimate(10**9 + k * 33 * MS).valid == (k >= PARAMS.valid_after)
        filter_.update(10**9 + k * 33 * MS, (0.033 * k, 0, 1.5), quaternion(0, 0.7), 0.01, 0.01)
    last = 10**9 + 9 * 33 * MS
    assert filter_.estimate(last + 100 * MS).rho == 1.0
    later = filter_.estimate(last + 610 * MS)
    assert later.rho == pytest.approx(math.exp(-PARAMS.lambda_rho * 0.5)) and later.last_exposure_ns == last
    assert later.variance[0] > filter_.estimate(last).variance[0]
    assert later.position[0] == pytest.approx(9 * 0.033 + 0.61, abs=0.05) and later.speed == pytest.approx(1, abs=0.06)
    assert not filter_.estimate(last + 2100 * MS).valid
    filter_.reset()
    assert filter_.estimate(last).accepted == 0


@settings(max_examples=80)
@given(st.floats(-3.1, 3.1), st.floats(0.0, 1.5), st.floats(-0.2, 0.2))
def test_heading_and_inclination_are_recovered_from_any_pose(heading, inclination, roll):
    z, r = np.zeros(5), np.zeros(5)
    q = np.array(quaternion(heading, inclination, roll))
    assert b.measurement_from_pose(np.zeros(3), q, np.full(3, 0.1), 0.05, z, r)
    bound = 1e-9 + abs(roll) * 1.3
    assert abs(b.wrap(z[3] - heading)) < bound and abs(z[4] - inclination) < bound


@settings(max_examples=50)
@given(st.floats(-2.5, 2.5), st.floats(-1.2, 1.2), st.floats(-3.0, 3.0))
def test_prediction_without_acceleration_is_the_arc(speed, turn, heading):
    row, out = np.zeros(belief_row.DIM), np.zeros(8)
    row[:8] = (1.0, 2.0, 1.5, heading, speed, turn, 0.4, 0.0)
    row[belief_row.STREAK] = 9.0
    b.belief_predict(row, 1.5, BeliefParams(turn_tau=1e9).row(), out)
    w = turn if abs(turn) > 1e-7 else 1e-7
    x = 1.0 + speed / w * (math.sin(heading + w * 1.5) - math.sin(heading))
    y = 2.0 - speed / w * (math.cos(heading + w * 1.5) - math.cos(heading))
    assert out[:2] == pytest.approx([x, y], abs=1e-5)
    assert out[3] == pytest.approx(b.wrap(heading + 1.5 * turn)) and out[4] == pytest.approx(speed) and out[7] == 0.0


@pytest.mark.parametrize("turn", [1.2, -0.4])
@pytest.mark.parametrize("seconds", [0.05, 0.1, 0.5, 2.0])
def test_turn_rate_decays_without_measurements(turn, seconds):
    row, out = np.zeros(belief_row.DIM), np.zeros(8)
    row[:8] = (1.0, 2.0, 1.5, 0.3, 2.0, turn, 0.4, 0.0)
    row[belief_row.STREAK] = 9.0
    b.belief_predict(row, seconds, PARAMS.row(), out)
    unseen, tau = max(0.0, seconds - PARAMS.loss_after), PARAMS.turn_tau
    turned = turn * (seconds - unseen + tau * (1.0 - math.exp(-unseen / tau)))
    assert out[5] == pytest.approx(turn * math.exp(-unseen / tau), rel=0.025)
    assert b.wrap(out[3] - 0.3) == pytest.approx(turned, abs=0.03)
    assert math.dist(out[:2], (1.0, 2.0)) <= 2.0 * seconds + 1e-9


@pytest.mark.parametrize("speed", [0.0, 1.0, -3.0])
def test_turn_rate_noise_grows_with_speed(speed):
    x, p = np.array([0.0, 0.0, 1.5, 0.0, speed, 0.0, 0.3, 0.0, 0.0]), np.zeros(belief_state.DIM * belief_state.DIM)
    advance_covariance(x, p, 0.04, PARAMS.row(), 0.5)
    assert math.sqrt(p[5 * (belief_state.DIM + 1)]) == pytest.approx(0.2 * (PARAMS.q_turn + PARAMS.q_bend * abs(speed)))


def test_covariance_is_carried_by_the_jacobian_of_the_motion():
    still = ("q_speed", "q_turn", "q_bend", "q_heading", "q_position", "q_inclination", "accel_sigma", "calm_accel")
    quiet = BeliefParams(**dict.fromkeys(still, 0.0)).row()
    x0 = np.array([0.0, 0.0, 1.5, 0.4, 1.7, 0.8, 0.3, 0.9, 0.02])
    jacobian, dt, eps = np.zeros((belief_state.DIM, belief_state.DIM)), 0.05, 1e-6
    for j in range(belief_state.DIM):
        high, low = x0.copy(), x0.copy()
        high[j] += eps
        low[j] -= eps
        advance_state(high, dt, PARAMS.accel_tau)
        advance_state(low, dt, PARAMS.accel_tau)
        jacobian[:, j] = (high - low) / (2 * eps)
    a = np.random.default_rng(3).normal(size=(belief_state.DIM, belief_state.DIM))
    cov = (a @ a.T).copy()
    p = cov.ravel().copy()
    advance_covariance(x0, p, dt, quiet, 0.5)
    assert p.reshape(belief_state.DIM, belief_state.DIM) == pytest.approx(jacobian @ cov @ jacobian.T, abs=2e-3)


@pytest.mark.parametrize("kind", ["ou", "line"])
def test_motion_separates_heading_from_its_bias(kind):
    ends = [run(kind, seed, 0.02, 0.03, period=4, seconds=5.3, bias=0.05)[:5:4] for seed in range(12)]
    errors = [b.wrap(filter_.row[3] - truth[3]) for filter_, truth in ends]
    left = np.array([filter_.row[8] - 0.05 for filter_, _ in ends])
    sigmas = np.array(
        [math.sqrt(filter_.row[belief_row.COVARIANCE + 8 * (belief_state.DIM + 1)]) for filter_, _ in ends]
    )
    assert abs(np.mean(errors)) < 0.012  # 0.05 if the bias were not known
    assert (sigmas < 0.7 * PARAMS.bias_heading).all() and np.mean((left / sigmas) ** 2) < 6.0


def test_standing_board_keeps_the_measured_heading():
    filter_, *_, truth, _ = run("static", 3, 0.01, 0.01, seconds=3.0, bias=0.03)
    assert b.wrap(filter_.row[3] - truth[3]) == pytest.approx(0.03, abs=0.01)
    assert math.sqrt(filter_.row[belief_row.COVARIANCE + 8 * (belief_state.DIM + 1)]) == pytest.approx(
        PARAMS.bias_heading, rel=0.02
    )


def test_surface_sigma_is_along_the_normal_at_the_last_measurement():
    row, rng = np.zeros(belief_row.DIM), np.random.default_rng(4)
    assert b.surface_sigma(row) == 0.1
    root = rng.normal(0.0, 0.02, (belief_state.DIM, belief_state.DIM))
    (
        row[belief_row.STREAK],
        row[belief_row.STATE : belief_row.COVARIANCE],
        row[belief_row.COVARIANCE : belief_row.TIME],
    ) = 5.0, rng.normal(0.0, 1.0, belief_state.DIM), (root @ root.T).ravel()
    row[belief_row.STATE + 6] = 0.9
    normal_axis = np.array(board_normal(row[belief_row.STATE : belief_row.COVARIANCE]))
    wanted = math.sqrt(normal_axis @ (root @ root.T)[:3, :3] @ normal_axis)
    assert b.surface_sigma(row) == pytest.approx(wanted, rel=1e-9)
    assert 0.01 < wanted < 0.1
    row[belief_row.COVARIANCE : belief_row.TIME] *= 100.0
    assert b.surface_sigma(row) == 0.1


def test_filter_is_continuous_across_heading_pi():
    filter_ = BoardFilter()
    codes = [
        filter_.update(k * 33 * MS, (-0.033 * k, 0, 1.5), quaternion(math.pi + 0.02 * (-1) ** k, 0.3), 0.01, 0.02)
        for k in range(30)
    ]
    assert set(codes) == {"accepted"}
    assert abs(b.wrap(filter_.estimate(29 * 33 * MS).heading - math.pi)) < 0.02


def test_bad_parameters_are_refused():
    with pytest.raises(ValueError, match="gate"):
        BeliefParams(gate=0.0)
    with pytest.raises(ValueError, match="turn_tau"):
        BeliefParams(turn_tau=0.0)
    with pytest.raises(ValueError, match="q_turn"):
        BeliefParams(q_turn=-1.0)


def seen(filter_, exposure_ms, now_ms=None, x=None):
    at = 0.03 * exposure_ms * 0.1 if x is None else x
    now_ns = None if now_ms is None else now_ms * MS
    return filter_.update(exposure_ms * MS, (at, 0, 1.5), quaternion(0, 0.5), 0.02, 0.02, now_ns)


@pytest.mark.parametrize("ahead_ms", [6, 60, 3_600_000, 2**63 // MS])
def test_measurement_stamped_later_than_now_is_refused_and_later_ones_are_accepted(ahead_ms):
    filter_ = BoardFilter()
    for k in range(5):
        assert seen(filter_, 30 * k, 30 * k + 50) == "accepted"
    before = filter_.estimate(200 * MS)
    assert seen(filter_, 200 + ahead_ms, 200) == "later_than_now"
    assert filter_.estimate(200 * MS) == before._replace(rejected=before.rejected + 1)
    assert seen(filter_, 150, 210) == "accepted"


def test_belief_of_a_measurement_later_than_the_time_asked_for_is_not_valid():
    filter_ = BoardFilter()
    for k in range(5):
        seen(filter_, 30 * k)
    assert filter_.estimate(120 * MS).valid
    assert (filter_.estimate(100 * MS).valid, filter_.estimate(100 * MS).rho) == (False, 0.0)


@pytest.mark.parametrize("span_ns", [10**12, 2**63])
def test_prediction_over_any_span_ends_soon_and_stays_finite(span_ns):
    filter_ = BoardFilter()
    for k in range(5):
        seen(filter_, 30 * k)
    found = filter_.estimate(span_ns)
    assert not found.valid
    assert np.isfinite([*found.position, *found.variance, found.speed, found.rho]).all()
    assert filter_.update(span_ns, (5.0, 1.0, 1.5), quaternion(0, 0.5), 0.02, 0.02) == "restarted"
    assert filter_.estimate(span_ns).position == pytest.approx((5.0, 1.0, 1.5))


def test_filter_that_begins_with_an_old_stamp_starts_again_with_a_sound_one():
    filter_ = BoardFilter()
    assert filter_.update(-(2**62), (0.0, 0.0, 1.5), quaternion(0, 0.5), 0.02, 0.02, 0) == "accepted"
    assert [seen(filter_, 30 * k, 30 * k) for k in range(4)] == ["restarted", "accepted", "accepted", "accepted"]
    assert filter_.estimate(100 * MS).valid


@pytest.mark.parametrize("number", [1e7, 1e160])
def test_pose_beyond_any_world_is_implausible(number):
    filter_ = BoardFilter()
    assert filter_.update(0, (number, 0.0, 1.5), quaternion(0, 0.5), 0.02, 0.02) == "implausible"
    assert filter_.update(0, (0.0, 0.0, 1.5), quaternion(0, 0.5), number, 0.02) != "accepted"
