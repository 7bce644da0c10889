"""The environment: start table, determinism, delays, outcomes, the same numbers as the flight's classes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from groundcar.motion import motion_row, speed_row
from policies.environment import ended_row, episode_row
from policies.environment.config import FAMILIES, TICK, EnvConfig
from policies.environment.env import Env, Tally, fill_future
from policies.environment.rows import FUTURE
from policies.estimation.board_ekf import surface_sigma
from policies.task import entry_row, rules_row, tail_row
from policies.task.observation import NEWEST, TAIL, USUAL_DRAG, ObservationBuilder
from policies.teachers.teacher import Teacher
from vehicle.quadrotor import airframe_row, state_row

QUIET = {"odometry_noise": 0.0}
HOVER = np.array([0.0, 0.0, 0.0, 0.0])


def actions(count, seed=0, size=0.1):
    return np.random.default_rng(seed).normal(0.0, size, (count, 4))


def test_start_of_an_episode_is_within_the_published_ranges():
    env = Env(EnvConfig(count=512, seed=3, **QUIET))
    env.reset()
    vehicle, board = env.rows.vehicle, env.rows.track[:, 0]
    dx, dy = vehicle[:, state_row.P] - board[:, 0], vehicle[:, state_row.P + 1] - board[:, 1]
    distance, height = np.hypot(dx, dy), vehicle[:, state_row.P + 2] - board[:, 2]
    azimuth = np.arctan2(dy, dx) - board[:, 3] - math.pi
    azimuth = np.degrees((azimuth + math.pi) % (2 * math.pi) - math.pi)
    assert 1.2 <= distance.min() < 1.3 and 3.4 < distance.max() <= 3.5
    assert 1.2 <= height.min() < 1.25 and 1.95 < height.max() <= 2.0
    assert -60.001 <= azimuth.min() < -55 and 55 < azimuth.max() <= 60.001
    assert np.abs(vehicle[:, state_row.V]).max() <= 0.1 and np.abs(vehicle[:, state_row.V + 2]).max() <= 0.2
    assert np.degrees(board[:, 6]).max() <= 80.0 and (board[:, 2] == 1.5).all()
    drawn = np.bincount(env.rows.state[:, episode_row.FAMILY].astype(int), minlength=len(FAMILIES))
    assert (drawn > 0).all()


@pytest.mark.parametrize(("share", "least", "most"), [(0.0, 0, 0), (0.25, 70, 130), (1.0, 400, 400)])
def test_share_of_oscillating_steep_boards_is_as_configured(share, least, most):
    env = Env(EnvConfig(oscillating=share, speed=(0.0, 0.5), inclination_deg=(0.0, 5.0), count=400, seed=3))
    env.reset()
    slow, fast = env.rows.motion[:, motion_row.SPEED + speed_row.V], env.rows.motion[:, motion_row.SPEED + speed_row.V2]
    inclination = np.degrees(env.rows.track[:, 0, 6])
    oscillates = (
        (fast >= 2.2) & (fast <= 2.9) & (slow >= 0.6) & (slow <= 1.2) & (inclination >= 45) & (inclination <= 75)
    )
    assert least <= oscillates.sum() <= most
    assert (fast[~oscillates] <= 0.5).all() and (inclination[~oscillates] <= 5.0).all()


def test_share_of_hard_boards_is_as_configured():
    env = Env(EnvConfig(hard_examples=0.4, speed=(0.0, 0.5), inclination_deg=(40.0, 50.0), count=1000, seed=3))
    env.reset()
    speed, inclination = env.rows.state[:, episode_row.SPEED], np.degrees(env.rows.track[:, 0, 6])
    flat, steep = inclination <= 20.0, inclination >= 62.0
    assert 90 <= flat.sum() <= 180 and 210 <= steep.sum() <= 330  # 133 and 267 are expected
    moving = speed > 0.0  # what stands has no speed, wherever it was drawn
    assert (speed[flat & moving] > 2.3).all() and (speed[steep & moving] >= 1.2).all()
    assert (speed[~flat & ~steep] <= 0.5).all()


@pytest.mark.parametrize(("power", "expected"), [(1.0, 0.55), (2.0, 0.4)])
def test_share_of_small_noise_is_as_configured(power, expected):
    env = Env(EnvConfig(stage="vision", noise_scale=(0.1, 1.0), noise_power=power, count=2000, seed=3))
    env.reset()
    noise = env.rows.state[:, episode_row.NOISE]
    assert noise.min() >= 0.1 and noise.max() <= 1.0
    assert noise.mean() == pytest.approx(expected, abs=0.03)
    with pytest.raises(ValueError, match="noise_power is 0"):
        EnvConfig(noise_power=0.0)


def test_episode_is_equal_for_equal_seeds_in_batches_of_any_size():
    one, two = (Env(EnvConfig(count=n, seed=4, stage="vision", warm=0.5)) for n in (8, 32))
    one.reset()
    two.reset()
    for k in range(60):
        a = actions(32, k)
        one.step(a[:8])
        two.step(a)
    for name in ("vehicle", "belief", "observation", "future", "reward", "believed"):
        assert np.array_equal(getattr(one.rows, name), getattr(two.rows, name)[:8]), name


def test_only_chosen_rows_begin_a_new_episode():
    env = Env(EnvConfig(count=8, seed=4))
    env.reset()
    for k in range(5):
        env.step(actions(8, k))
    before, chosen = env.rows.vehicle.copy(), np.arange(8) % 2 == 0
    env.restart(chosen)
    assert (env.rows.state[chosen, episode_row.STEP] == 0.0).all() and len(env.tally.rows) == 0
    assert (env.rows.state[~chosen, episode_row.STEP] == 5.0).all()
    assert np.array_equal(env.rows.vehicle[~chosen], before[~chosen])


def test_vision_starts_with_the_board_in_view_and_a_belief():
    env = Env(EnvConfig(count=256, seed=5, stage="vision"))
    env.reset()
    assert (env.rows.state[:, episode_row.VISIBLE] == 1.0).mean() > 0.99
    error = np.linalg.norm(env.rows.believed[:, :3] - env.rows.track[:, 0, :3], axis=1)
    assert np.median(error) < 0.1
    assert (env.rows.observation[:, TAIL + 12] > 0.99).mean() > 0.98  # rho


def test_hovering_start_has_the_board_speed_and_the_thrust_gain():
    config = EnvConfig(count=128, seed=6, stage="vision", warm=1.0, warm_time=(0.6, 1.0), speed=(0.5, 1.0))
    env = Env(config)
    env.reset()
    begin = env.rows.state[:, episode_row.BEGIN].astype(int)
    assert begin.min() >= 60
    truth = env.rows.track[np.arange(128), begin]
    assert np.median(np.abs(env.rows.believed[:, 4] - truth[:, 4])) < 0.15
    true = env.rows.params[:, 9] / env.rows.params[:, 0] / (env.shared.nominal[9] / env.shared.nominal[0])
    assert np.abs(env.rows.observation[:, TAIL + tail_row.GAIN] - true).max() < 0.05
    assert env.rows.observation[:, TAIL + tail_row.DRAG] == pytest.approx(
        USUAL_DRAG, abs=0.01
    )  # hovering does not show it


def test_the_airframe_is_drawn_anew_for_every_episode():
    ranges = {"drag": (0.0, 2.0), "motor_lag": (0.5, 1.5), "rate_gain": (0.6, 1.4)}
    env = Env(EnvConfig(count=512, seed=6, **ranges))
    env.reset()
    for index, (low, high) in (
        (airframe_row.DRAG, ranges["drag"]),
        (airframe_row.MOTOR_LAG, ranges["motor_lag"]),
        (airframe_row.RATE_K, ranges["rate_gain"]),
    ):
        factor = env.rows.params[:, index] / env.shared.nominal[index]
        assert low <= factor.min() < low + 0.1 * (high - low) and high - 0.1 * (high - low) < factor.max() <= high


def test_drag_range_below_zero_gives_a_share_of_episodes_without_drag():
    env = Env(EnvConfig(count=512, seed=6, drag=(-1.0, 3.0)))
    env.reset()
    drag = env.rows.params[:, airframe_row.DRAG]
    assert drag.min() == 0.0 and (drag == 0.0).mean() == pytest.approx(0.25, abs=0.06)


def test_state_stage_observes_the_truth():
    env = Env(EnvConfig(count=64, seed=7, **QUIET))
    env.reset()
    for k in range(20):
        env.step(actions(64, k))
    step = env.rows.state[:, episode_row.STEP].astype(int)
    truth = env.rows.track[np.arange(64), step]
    offset = truth[:, :3] - env.rows.vehicle[:, state_row.P : state_row.P + 3]
    seen = env.rows.observation[:, NEWEST : NEWEST + 3]
    assert np.linalg.norm(seen, axis=1) == pytest.approx(np.linalg.norm(offset, axis=1), abs=1e-5)
    assert seen[:, 2] == pytest.approx(offset[:, 2], abs=1e-5)


def test_flight_classes_agree_with_the_training_environment():
    """One recorded vision episode through ObservationBuilder: the observation that training saw."""
    config = EnvConfig(count=1, seed=8, stage="vision", odometry_noise=0.0, gain_slot=False)
    env = Env(config)
    env.reset()
    builder = ObservationBuilder(config.stride)
    previous = env.rows.state[0, 3:7].copy()
    rows, usual = env.rows, env.shared.nominal[airframe_row.DRAG] / env.shared.nominal[airframe_row.MASS]
    for k in range(120):
        now_ns = round(rows.state[0, episode_row.STEP] * TICK * 1e9)
        builder.push(now_ns, rows.believed[0])
        vehicle = rows.vehicle[0]
        rho = float(rows.observation[0, TAIL + 12])
        own = (
            vehicle[state_row.P : state_row.P + 3],
            vehicle[state_row.V : state_row.V + 3],
            vehicle[state_row.Q : state_row.Q + 4],
        )
        built = builder.build(now_ns, *own, rho, previous, 1.0, usual, surface_sigma(rows.belief[0]))
        assert built == pytest.approx(rows.observation[0], abs=2e-5)
        previous = actions(1, k)[0]
        env.step(previous[None])
        if rows.done[0]:
            break
    assert k > 30


def test_belief_follows_the_board_within_its_noise():
    config = EnvConfig(count=256, seed=9, stage="vision", limit=60, noise_scale=(1.0, 1.0))
    env = Env(config)
    env.reset()
    teacher = Teacher(env)
    errors = []
    for _ in range(50):
        env.step(teacher.act())
        alive = env.rows.state[:, episode_row.STEP] > 25
        step = env.rows.state[:, episode_row.STEP].astype(int)
        truth = env.rows.track[np.arange(256), step]
        seen = alive & (env.rows.state[:, episode_row.VISIBLE] == 1.0)
        errors.append(np.linalg.norm(env.rows.believed[seen, :3] - truth[seen, :3], axis=1))
    assert np.median(np.concatenate(errors)) < 0.08


def test_delayed_detections_are_queued():
    env = Env(EnvConfig(count=64, seed=10, stage="vision", latency=(0.09, 0.09), detector_hz=(60.0, 60.0)))
    env.reset()
    for _ in range(9):
        env.step(np.tile(HOVER, (64, 1)))
    assert env.rows.state[:, episode_row.PENDING].max() >= 4


def test_time_limit_ends_every_episode_and_is_tallied():
    env = Env(EnvConfig(count=32, seed=11, limit=20, **QUIET))
    env.reset()
    for _ in range(20):
        env.step(np.tile(HOVER, (32, 1)))
    rows = env.tally.rows
    assert rows.shape == (32, ended_row.DIM)
    assert env.tally.causes() == {"time": 32}
    assert (rows[:, ended_row.STEPS] == 20).all()
    assert env.tally.success() == 0.0
    assert math.isnan(Tally().success())
    assert env.shared.rules[rules_row.TIME_LIMIT] == pytest.approx(0.195)


def test_privileged_future_equals_later_states():
    env = Env(EnvConfig(count=16, seed=13, limit=300, **QUIET))
    env.reset()
    future = np.zeros((41, 8))
    fill_future(env.rows, 3, 0, 5, future)
    assert env.rows.state[3, episode_row.FILLED] >= 200
    for _ in range(30):
        env.step(np.tile(HOVER, (16, 1)))
        if env.rows.done[3]:
            pytest.skip("the vehicle fell before the future came")
    assert env.rows.track[3, 30] == pytest.approx(future[6])


def test_future_of_the_critic_is_the_true_board_later_in_every_episode():
    config = EnvConfig(count=16, seed=13, limit=40, warm=0.5, future_stride=4, **QUIET)
    env = Env(config)
    env.reset()
    row, ends = np.arange(16), 0
    for k in range(90):
        env.step(actions(16, k))
        ends += int(env.rows.done.sum())
        begin = env.rows.state[:, episode_row.STEP].astype(int)
        for j, entry in enumerate(env.rows.future.reshape(16, FUTURE, entry_row.DIM).transpose(1, 0, 2)):
            offset = env.rows.track[row, begin + 4 * (j + 1), :3] - env.rows.vehicle[:, state_row.P : state_row.P + 3]
            assert np.hypot(entry[:, 0], entry[:, 1]) == pytest.approx(np.hypot(offset[:, 0], offset[:, 1]), abs=1e-5)
            assert entry[:, 2] == pytest.approx(offset[:, 2], abs=1e-5)
            assert entry[:, entry_row.TIME] == pytest.approx(0.04 * (j + 1), abs=1e-6)
    assert ends >= 32


def test_ablations_change_the_observation():
    base = EnvConfig(count=64, seed=14, stage="vision")
    full, raw, blind = (Env(c) for c in (base, replace(base, augmentation=False), replace(base, rho=False)))
    for env in (full, raw, blind):
        env.reset()
        for k in range(80):
            env.step(actions(64, k, 0.3))
    assert full.rows.observation[:, TAIL + 12].min() < 0.9
    assert (raw.rows.observation[:, TAIL + 12] == 1.0).all()
    assert (blind.rows.observation[:, TAIL + 12] == 1.0).all()
    assert not np.allclose(raw.rows.believed, full.rows.believed)
    assert np.allclose(blind.rows.believed, full.rows.believed)


def test_ablation_without_rho_is_evaluated_by_the_rho_of_its_belief():
    base = EnvConfig(count=64, seed=14, stage="vision", **QUIET)
    full, raw, blind = (Env(c) for c in (base, replace(base, augmentation=False), replace(base, rho=False)))
    for env in (full, raw, blind):
        env.reset()
        for k in range(40):
            env.step(actions(64, k, 0.3))
    for ablation in (raw, blind):
        assert np.array_equal(ablation.rows.state[:, episode_row.RHO], full.rows.state[:, episode_row.RHO])
        assert ablation.rows.observation[:, TAIL + tail_row.RHO].min() == 1.0
    assert full.rows.state[:, episode_row.RHO].min() < 38.0


def test_invalid_settings_and_actions_are_refused():
    with pytest.raises(ValueError, match="stage is 'sound'"):
        EnvConfig(stage="sound")
    with pytest.raises(ValueError, match="speed"):
        EnvConfig(speed=(2.0, 1.0))
    with pytest.raises(ValueError, match="families"):
        EnvConfig(families=(1.0,))
    with pytest.raises(ValueError, match="command_delay"):
        EnvConfig(command_delay=(0.0, 0.05))
    env = Env(EnvConfig(count=2, seed=1))
    env.reset()
    with pytest.raises(ValueError, match="not finite"):
        env.step(np.full((2, 4), math.nan))
