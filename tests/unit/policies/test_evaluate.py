"""Evaluation: exact intervals against known values, unbiased counting, the table, maps as data and picture."""

import json
import math

import numpy as np
import pytest

from policies.contact import OUTCOME, RESULT_DIM, SUCCESS
from policies.env_config import EnvConfig
from policies.env_rows import E_STEPS, ENDED_DIM
from policies.evaluate import POINTS, HeatMap, as_data, clopper_pearson, run_episodes, summarise, table


@pytest.mark.parametrize(
    ("hits", "trials", "low", "high"),
    [  # published tables of the exact binomial interval
        (0, 10, 0.0, 0.3085),
        (10, 10, 0.6915, 1.0),
        (5, 10, 0.1871, 0.8129),
        (95, 100, 0.8872, 0.9836),
        (1, 20, 0.0013, 0.2487),
    ],
)
def test_clopper_pearson(hits, trials, low, high):
    assert clopper_pearson(hits, trials) == pytest.approx((low, high), abs=2e-4)


def test_clopper_pearson_of_many_and_of_nonsense():
    low, high = clopper_pearson(1998, 2000)
    assert 0.9960 < low < 0.9970 and 0.9998 < high < 0.99995
    with pytest.raises(ValueError, match="not a rate"):
        clopper_pearson(3, 2)
    with pytest.raises(ValueError, match="not a rate"):
        clopper_pearson(0, 0)


def test_every_row_counts_its_first_episodes():
    config = EnvConfig(count=24, seed=2, limit=30, odometry_noise=0.0)

    def fall(env):
        return np.tile([0.0, 0.0, 0.0, -1.0], (24, 1))

    ended = run_episodes(fall, config, each=2)
    assert ended.shape == (48, ENDED_DIM)
    assert (ended[:, E_STEPS] <= 30).all()


def test_summary_and_table():
    ended = np.zeros((4, ENDED_DIM))
    ended[:3, OUTCOME], ended[3, OUTCOME], ended[3, 1] = SUCCESS, 1, 3
    ended[:, 9], ended[:, E_STEPS] = [-0.5, -0.6, -0.9, -3.0], 200
    row = summarise("T1", ended)
    assert (row.episodes, row.success) == (4, 75.0)
    assert row.normal_speed == pytest.approx(2.0 / 3.0) and row.in_band == pytest.approx(200.0 / 3.0)
    assert row.duration == pytest.approx(2.0) and row.causes == {"time": 1}
    text = table([row], "state")
    assert text.row_count == 2
    assert json.loads(json.dumps(as_data([row])))[0]["name"] == "T1"
    none = summarise("x", np.ones((3, ENDED_DIM)))
    assert none.success == 0.0 and math.isnan(none.duration)
    assert RESULT_DIM < ENDED_DIM


def test_points_are_the_paper_s():
    assert POINTS["T1"]["speed"] == (3.0, 3.0) and POINTS["T1"]["inclination_deg"] == (0.0, 0.0)
    assert POINTS["T2"]["speed"] == (2.0, 2.0) and POINTS["T2"]["inclination_deg"] == (30.0, 30.0)
    assert POINTS["T3"]["speed"] == (1.0, 1.0) and POINTS["T3"]["inclination_deg"] == (60.0, 60.0)


def test_heat_map_picture_has_its_contours():
    picture = HeatMap([0.0, 1.0], [0.0, 80.0], [[100.0, 90.0], [60.0, 20.0]], 10).svg("map")
    assert picture.startswith("<svg") and picture.count("<rect") == 5
    red, blue = (picture.split(f'stroke="{colour}"')[0].rsplit('d="', 1)[1] for colour in ("#900", "#036"))
    assert red.count("M") == 2  # 60|20 and 90|20
    assert blue.count("M") == 2  # 100|60 and 90|20
