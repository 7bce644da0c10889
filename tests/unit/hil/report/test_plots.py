import base64

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hil.report.drawing.charts import Pack, TimePlot, thin
from hil.report.drawing.svg import Plane, histogram, ticks
from hil.report.recorded.flight import load
from hil.report.sections.latency import first_use_ms


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4), st.integers(2, 10))
def test_axis_ticks_are_few_and_within_the_axis(low, span, about):
    marks = ticks(low, low + span, about)
    assert len(marks) <= about + 2
    assert all(low - 1e-6 * span <= m <= low + span * (1 + 1e-6) for m in marks)
    assert marks == sorted(set(marks))


def test_equal_arrays_are_packed_once_and_unpack_unchanged(golden):
    recorded = load(golden)
    t = recorded.topics["belief"].nanoseconds()
    plot = TimePlot("p", "P", "m")
    plot.add("a", "#000000", t, np.sin(t / 1e9))
    plot.add("b", "#000000", t, np.sin(t / 1e9))
    pack = Pack()
    pack.add([(recorded, plot)])
    table = pack.table()
    assert len(table["arrays"]) == 2
    a, b = table["plots"][0]["series"]
    assert (a["t"], a["y"]) == (b["t"], b["y"])
    back = np.frombuffer(base64.b64decode(table["arrays"][a["t"]]), "<f4")
    np.testing.assert_allclose(back, recorded.seconds(t[thin(recorded, t)]), atol=1e-5)


def test_thinning_keeps_the_attempt_and_isolated_samples(golden):
    recorded = load(golden)
    start, end = recorded.window_ns
    t = np.arange(start - 60_000_000_000, end, 4_000_000)
    kept = t[thin(recorded, t)]
    assert np.diff(kept[kept > start]).max() <= 8_000_000
    assert (kept < start - 20_000_000_000).sum() <= 40 * 10 + 1
    assert len(thin(recorded, t, every=False)) == len(t)


def test_plot_without_data_is_left_out():
    plot = TimePlot("p", "P", "m")
    plot.add("a", "#000000", np.arange(3), np.full(3, np.nan))
    assert not plot.drawable


def test_latency_plot_counts_each_picture_once_without_the_first_after_a_pause(golden):
    recorded = load(golden)
    delays = first_use_ms(recorded, recorded.topics["policy/action"])
    used = {m.exposure_ns for m in recorded.topics["policy/action"].messages if m.stamp_ns <= recorded.decided_ns}
    assert len(delays) == len(used) - 1
    assert delays.min() > 10
    assert delays.max() < 100


def test_scene_scale_is_equal_on_both_axes():
    plane = Plane((0.0, 4.0), (0.0, 1.0), width=400, max_height=400, name="p")
    (x0, y0), (x1, y1) = plane.to(1.0, 0.2), plane.to(2.0, 1.2)
    assert x1 - x0 == y0 - y1
    plane.path([0.0, np.nan, 1.0, 2.0], [0.0, 0.0, 0.5, 0.5], "stroke:#000")
    assert plane.svg().count("M") == 2 and "nan" not in plane.svg()


@given(st.lists(st.floats(0.0, 1e6), min_size=1, max_size=50))
def test_plot_histogram_counts_every_value(values):
    svg = histogram(np.array(values), name="x", unit="ms", colour="#123456")
    shown = [int(part.rsplit(": ", 1)[1]) for part in svg.split("</title>")[:-1]]
    assert sum(shown) == len(values)


def test_plot_size_of_an_hour_of_recording_is_bounded(golden):
    recorded = load(golden)
    start = recorded.span_ns[0]
    recorded.span_ns = (start, start + 3_600_000_000_000)
    recorded.attempt_ns, recorded.decided_ns = None, None
    t = np.arange(start, start + 3_600_000_000_000, 20_000_000)
    assert len(thin(recorded, t)) < 60 * 50 + 3100


def test_samples_out_of_order_are_sorted(golden):
    recorded = load(golden)
    t = recorded.topics["belief"].nanoseconds()[::-1].copy()
    plot = TimePlot("p", "P", "m")
    plot.add("a", "#000000", t, np.arange(len(t)), "dots")
    pack = Pack()
    pack.add([(recorded, plot)])
    back = np.frombuffer(base64.b64decode(pack.table()["arrays"][0]), "<f4")
    assert (np.diff(back) > 0).all()
