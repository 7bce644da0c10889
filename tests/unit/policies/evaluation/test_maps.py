"""The map of speed and inclination as data and drawing, and the trajectory families."""

from dataclasses import replace

import numpy as np
import pytest

from policies.environment import episode_row
from policies.environment.config import FAMILIES, EnvConfig
from policies.evaluation.evaluate import POINTS, fly_cases
from policies.evaluation.maps import CAMERAS, MOTIONS, VEHICLES, HeatMap, heatmap, map_cells, motions, robustness


def fall(env):
    return np.tile([0.0, 0.0, 0.0, -1.0], (env.config.count, 1))


def test_drawing_of_a_heat_map_has_both_contours():
    drawing = HeatMap([0.0, 1.0], [0.0, 80.0], [[100.0, 90.0], [60.0, 20.0]], 10).svg("map")
    assert drawing.startswith("<svg") and drawing.count("<rect") == 5
    red, blue = (drawing.split(f'stroke="{colour}"')[0].rsplit('d="', 1)[1] for colour in ("#900", "#036"))
    assert red.count("M") == 2  # 60|20 and 90|20
    assert blue.count("M") == 2  # 100|60 and 90|20


def test_heat_map_covers_the_axes_of_the_paper():
    progress = []
    found = heatmap(fly_cases(fall, map_cells(EnvConfig(odometry_noise=0.0), 2), watch=progress.append))
    assert found.speeds[0] == 0.0 and found.speeds[-1] >= 3.0
    assert (found.inclinations_deg[0], found.inclinations_deg[-1]) == (0.0, 80.0)
    lines = found.csv().splitlines()
    assert lines[0] == "speed,inclination_deg,success_percent,episodes"
    assert lines[1] == "0,0,0,2" and len(lines) == 1 + len(found.speeds) * len(found.inclinations_deg)
    assert progress[-1] == 1.0


def test_motions_fly_the_four_trajectory_families():
    drawn = set()

    def noting(env):
        drawn.update(FAMILIES[int(k)] for k in env.rows.state[:, episode_row.FAMILY])
        return fall(env)

    rows = fly_cases(noting, motions(EnvConfig(odometry_noise=0.0), 4))
    assert drawn == set(MOTIONS)
    assert len(rows) == 4 * 2 * 3 and rows[0].name == "spline 1 m/s 0 deg"


@pytest.mark.parametrize(("stage", "others"), [("state", VEHICLES), ("vision", {**VEHICLES, **CAMERAS})])
def test_robustness_cases_change_one_parameter_at_the_published_points(stage, others):
    seen = []

    def noting(env):
        if not seen or seen[-1] is not env.config:
            seen.append(env.config)
        return fall(env)

    usual = EnvConfig(stage=stage, odometry_noise=0.0)
    rows = fly_cases(noting, robustness(usual, 4))
    assert [row.name for row in rows][:3] == ["T1, no drag", "T2, no drag", "T3, no drag"]
    assert len(rows) == len(seen) == 3 * len(others)
    for config, (name, change) in zip(seen[::3], others.items(), strict=True):
        flown = replace(usual, count=4, **{**POINTS["T1"], **change})
        assert config == flown, name
