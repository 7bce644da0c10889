"""Evaluation: unbiased counting, contents of a row, points and noise as requested, separate seeds."""

import json
import math

import numpy as np
import pytest

from policies.environment.config import EnvConfig
from policies.environment.env import Env
from policies.environment.rows import E_STEPS, ENDED_DIM
from policies.evaluation.evaluate import POINTS, as_data, evaluate, evaluation_seed, run_episodes, summarise
from policies.task import result_row
from policies.task.contact import SUCCESS
from vehicle.camera.noise import measured_noise


def test_every_row_counts_its_first_episodes_only():
    config = EnvConfig(count=24, seed=2, limit=30, odometry_noise=0.0)

    def fall(env):
        return np.tile([0.0, 0.0, 0.0, -1.0], (24, 1))

    ended = run_episodes(fall, config, each=2)
    assert ended.shape == (48, ENDED_DIM)
    assert (ended[:, E_STEPS] <= 30).all()


def test_summary_of_ended_rows_has_counts_rates_and_means():
    ended = np.zeros((4, ENDED_DIM))
    ended[:3, result_row.OUTCOME], ended[3, result_row.OUTCOME], ended[3, 1] = SUCCESS, 1, 3
    ended[:, 9], ended[:, E_STEPS] = [-0.5, -0.6, -0.9, -3.0], 200
    row = summarise("T1", ended)
    assert (row.episodes, row.success) == (4, 75.0)
    assert row.normal_speed == pytest.approx(2.0 / 3.0) and row.in_band == pytest.approx(200.0 / 3.0)
    assert row.duration == pytest.approx(2.0) and row.causes == {"time": 1}
    assert row.hits == 3
    assert json.loads(json.dumps(as_data([row])))[0]["name"] == "T1"
    none = summarise("x", np.ones((3, ENDED_DIM)))
    assert none.success == 0.0 and math.isnan(none.duration)
    assert result_row.DIM < ENDED_DIM


def test_operating_points_are_those_of_the_paper():
    assert POINTS["T1"]["speed"] == (3.0, 3.0) and POINTS["T1"]["inclination_deg"] == (0.0, 0.0)
    assert POINTS["T2"]["speed"] == (2.0, 2.0) and POINTS["T2"]["inclination_deg"] == (30.0, 30.0)
    assert POINTS["T3"]["speed"] == (1.0, 1.0) and POINTS["T3"]["inclination_deg"] == (60.0, 60.0)


def test_noise_and_progress_are_passed_on():
    seen, told = [], []

    def wait(env: Env):
        seen.append(env.shared.noise.copy())
        return np.zeros((env.config.count, 4))

    config = EnvConfig(stage="vision", limit=5)
    rows = evaluate(wait, config, 10, ("T1", "T2"), "measured", told.append)
    assert [row.name for row in rows] == ["T1", "T2"] and rows[0].episodes == 10
    assert (seen[0] == measured_noise()).all()
    assert told == sorted(told) and told[-1] == 1.0


def test_evaluation_seeds_are_apart_from_those_of_training():
    assert evaluation_seed(0) >= 1 << 40 and evaluation_seed(1) == evaluation_seed(0) + 1
    with pytest.raises(ValueError, match="seed -1"):
        evaluation_seed(-1)
    learnt, judged = (Env(EnvConfig(count=4, seed=seed)).rows.rng for seed in (0, evaluation_seed(0)))
    assert not np.intersect1d(learnt, judged).size
