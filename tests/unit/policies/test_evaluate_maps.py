"""The map of speed and inclination as data and picture, and the trajectory families."""

import numpy as np

from policies.env_config import FAMILIES, EnvConfig
from policies.env_rows import S_FAMILY
from policies.evaluate_maps import MOTIONS, HeatMap, heatmap, motions


def fall(env):
    return np.tile([0.0, 0.0, 0.0, -1.0], (env.config.count, 1))


def test_heat_map_picture_has_its_contours():
    picture = HeatMap([0.0, 1.0], [0.0, 80.0], [[100.0, 90.0], [60.0, 20.0]], 10).svg("map")
    assert picture.startswith("<svg") and picture.count("<rect") == 5
    red, blue = (picture.split(f'stroke="{colour}"')[0].rsplit('d="', 1)[1] for colour in ("#900", "#036"))
    assert red.count("M") == 2  # 60|20 and 90|20
    assert blue.count("M") == 2  # 100|60 and 90|20


def test_heat_map_covers_the_paper_s_axes():
    told = []
    found = heatmap(fall, EnvConfig(odometry_noise=0.0), 2, watch=told.append)
    assert found.speeds[0] == 0.0 and found.speeds[-1] >= 3.0
    assert (found.inclinations_deg[0], found.inclinations_deg[-1]) == (0.0, 80.0)
    lines = found.csv().splitlines()
    assert lines[0] == "speed,inclination_deg,success_percent,episodes"
    assert lines[1] == "0,0,0,2" and len(lines) == 1 + len(found.speeds) * len(found.inclinations_deg)
    assert told[-1] == 1.0


def test_motions_are_the_four_families():
    drawn = set()

    def noting(env):
        drawn.update(FAMILIES[int(k)] for k in env.rows.state[:, S_FAMILY])
        return fall(env)

    rows = motions(noting, EnvConfig(odometry_noise=0.0), 4)
    assert drawn == set(MOTIONS)
    assert len(rows) == 4 * 2 * 3 and rows[0].name == "spline 1 m/s 0 deg"
