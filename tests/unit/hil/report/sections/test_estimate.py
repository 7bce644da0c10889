"""NEES and NIS of a made-up filter: 1 if its errors agree with its covariance, 4 if they are twice as large."""

from types import SimpleNamespace

import numpy as np
import pytest

from hil.report.drawing.charts import TimePlot
from hil.report.drawing.section import Section
from hil.report.recorded.geometry import Motion
from hil.report.sections.estimate import _consistency

SIGMA, SEEN_SIGMA, N = np.array([0.1, 0.2, 0.05]), 0.02, 4000


class Fake(dict):
    def nanoseconds(self):
        return self["stamp_ns"]


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_nees_and_nis_show_the_consistency_of_the_filter(scale):
    rng = np.random.default_rng(3)
    t = np.arange(N) * 10_000_000
    truth = Motion(t, np.column_stack([t / 1e9, 0 * t, 0 * t + 1.5]), np.zeros((N, 3)), np.tile([1.0, 0, 0, 0], (N, 1)))
    error = scale * SIGMA * rng.standard_normal((N, 3))
    belief = Fake(
        stamp_ns=t, valid=np.ones(N), position=truth.position + error, variance=np.tile(SIGMA**2, (N, 1)),
        heading=np.zeros(N), speed=np.ones(N),
    )  # fmt: skip
    seen = truth.position + scale * SEEN_SIGMA * rng.standard_normal((N, 3))
    detection = Fake(stamp_ns=t, found=np.ones(N), position=seen, position_sigma=np.full(N, SEEN_SIGMA))
    recorded = SimpleNamespace(
        topics={"belief": belief, "board/detection": detection}, during=lambda when: np.ones(len(when), dtype=bool)
    )
    section = Section("estimate", "")
    _consistency(section, recorded, truth)  # type: ignore[arg-type]
    plot = section.parts[0]
    assert isinstance(plot, TimePlot)
    for series in plot.series:
        assert series.y.mean() == pytest.approx(scale**2, rel=0.05), series.name
