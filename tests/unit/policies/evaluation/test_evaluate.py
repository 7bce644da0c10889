"""Evaluation: unbiased counting, what a row holds, points and noise as asked, seeds of its own."""

import json
import math

import numpy as np
import pytest

from policies.environment import ended_row
from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.evaluation.evaluate import POINTS, as_data, evaluation_seed, fly_cases, points, run_episodes, summarise
from policies.task import result_row
from policies.task.contact import SUCCESS
from vehicle.camera.noise import measured_noise


def test_evaluation_uses_the_first_episodes_of_every_row():
    config = EnvConfig(count=24, seed=2, limit=30, odometry_noise=0.0)

    def fall(env):
        return np.tile([0.0, 0.0, 0.0, -1.0], (24, 1))

    ended = run_episodes(fall, config, each=2)
    assert ended.shape == (48, ended_row.DIM)
    assert (ended[:, ended_row.STEPS] <= 30).all()


def test_summary_has_success_speeds_and_causes():
    ended = np.zeros((4, ended_row.DIM))
    ended[:3, result_row.OUTCOME], ended[3, result_row.OUTCOME], ended[3, 1] = SUCCESS, 1, 3
    ended[:, 9], ended[:, ended_row.STEPS] = [-0.5, -0.6, -0.9, -3.0], 200
    row = summarise("T1", ended)
    assert (row.episodes, row.success) == (4, 75.0)
    assert row.normal_speed == pytest.approx(2.0 / 3.0) and row.in_band == pytest.approx(200.0 / 3.0)
    assert row.duration == pytest.approx(2.0) and row.causes == {"time": 1}
    assert row.hits == 3
    assert json.loads(json.dumps(as_data([row])))[0]["name"] == "T1"
    none = summarise("x", np.ones((3, ended_row.DIM)))
    assert none.success == 0.0 and math.isnan(none.duration)
    assert result_row.DIM < ended_row.DIM


def test_evaluation_points_agree_with_the_paper():
    assert POINTS["T1"]["speed"] == (3.0, 3.0) and POINTS["T1"]["inclination_deg"] == (0.0, 0.0)
    assert POINTS["T2"]["speed"] == (2.0, 2.0) and POINTS["T2"]["inclination_deg"] == (30.0, 30.0)
    assert POINTS["T3"]["speed"] == (1.0, 1.0) and POINTS["T3"]["inclination_deg"] == (60.0, 60.0)


def test_evaluation_applies_noise_and_reports_progress():
    seen, progress = [], []

    def wait(env: Env):
        seen.append(env.shared.noise.copy())
        return np.zeros((env.config.count, 4))

    config = EnvConfig(stage="vision", limit=5)
    rows = fly_cases(wait, points(config, 10, ("T1", "T2")), "measured", progress.append)
    assert [row.name for row in rows] == ["T1", "T2"] and rows[0].episodes == 10
    assert (seen[0] == measured_noise()).all()
    assert progress == sorted(progress) and progress[-1] == 1.0


def test_evaluation_seeds_differ_from_training_seeds():
    assert evaluation_seed(0) >= 1 << 40 and evaluation_seed(1) == evaluation_seed(0) + 1
    with pytest.raises(ValueError, match="seed -1"):
        evaluation_seed(-1)
    learnt, judged = (Env(EnvConfig(count=4, seed=seed)).rows.rng for seed in (0, evaluation_seed(0)))
    assert not np.intersect1d(learnt, judged).size
