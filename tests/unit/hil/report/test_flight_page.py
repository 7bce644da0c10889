import json

import numpy as np
import pytest

from hil.report import page
from hil.report.recorded.flight import load
from hil.report.write import write_report
from tests.unit.hil.report.pages import Page

SECTIONS = [
    "row", "touchdown", "attempt", "frames", "motion", "perception", "estimate", "commands", "latency", "car", "timing",
    "events", "missing", "provenance",
]  # fmt: skip
PLOTS = [
    "closing", "over-board", "alignment", "roll", "pitch", "yaw", "position-0", "position-1", "position-2", "speed",
    "velocity-0", "velocity-1", "velocity-2", "tags", "corners", "rate", "rho", "accepted-age", "belief-position",
    "consistency", "detection-error", "belief-angles", "belief-speed", "odometry-position", "odometry-velocity",
    "odometry-attitude", "rate-0", "rate-1", "rate-2", "thrust", "age", "detection-latency", "car-speed", "car-turn",
    "car-x", "car-y",
]  # fmt: skip


@pytest.fixture(scope="module")
def full(golden):
    return Page(page.render([load(golden)]))


def test_flight_page_has_every_section_and_plot(full):
    assert [i for i in full.ids if i in SECTIONS] == SECTIONS
    assert [p["key"] for p in full.data["plots"]] == PLOTS
    assert {p["id"] for p in full.data["plots"]} <= set(full.ids)
    assert "Nothing: every topic of the contract has messages, and every plot is drawn." in full.text


def test_flight_page_begins_with_the_verdict_and_the_published_row(full, golden):
    score = json.loads((golden / "score.json").read_text())
    assert full.text.index("Perched") < full.text.index("The paper's row")
    assert f"{score['metrics']['planar']:.3f} m" in full.text
    assert "≤ 0.20" in full.text and "≤ 11.46" in full.text
    assert "0.50 to 2.35" in full.text  # published board speed of Simple-II
    assert "score.json against the recording agrees" in full.text
    assert "The recording is incomplete" not in full.text


def test_plots_equal_the_recorded_values(full, golden):
    recorded = load(golden)
    t, y = full.series("rho", "rho")
    belief = recorded.topics["belief"]
    chosen = np.isfinite(y)
    wanted = np.interp(t[chosen], recorded.seconds(belief.nanoseconds()), belief["rho"])
    np.testing.assert_allclose(y[chosen], wanted, atol=1e-5)
    t, y = full.series("pitch", "board")
    np.testing.assert_allclose(y, 45.0, atol=0.5)  # the board's set inclination
    t, y = full.series("over-board", "height")
    contact = full.data["flights"][0]["decided"]
    assert abs(np.interp(contact, t, y)) < 0.02  # at contact the magnet is on the board


def test_commands_end_with_the_verdict(full, golden):
    decided = full.data["flights"][0]["decided"]
    went_on = load(golden).topics["policy/action"].nanoseconds()[-1]
    assert float(load(golden).seconds(went_on)) > decided + 0.1  # the policy does not know that it has perched
    for key in ("rate-0", "rate-1", "rate-2", "thrust"):
        t, y = full.series(key, "asked")
        assert np.isfinite(y[t < decided - 0.02]).any() and not np.isfinite(y[t > decided + 0.001]).any()
    t, y = full.series("thrust", "achieved, from velocity")
    assert not np.isfinite(y[t > decided + 0.001]).any()
    assert "its commands are not sent any more" in full.text


def test_touchdown_agrees_with_the_referee(golden):
    recorded = load(golden)
    seen, metrics = recorded.approach, recorded.score["metrics"]
    i = int(np.searchsorted(seen.t, recorded.decided_ns))
    assert seen.magnet[i, 0] == pytest.approx(metrics["x"], abs=5e-3)
    assert seen.magnet[i, 1] == pytest.approx(metrics["y"], abs=5e-3)
    assert np.degrees(seen.normal_error[i]) == pytest.approx(metrics["normal_alignment_deg"], abs=1.0)


def test_time_axis_has_marks_and_phases(full):
    axis = full.data["flights"][0]
    assert any(label == "contact" and t == axis["decided"] for t, _, _, label in axis["marks"])
    assert any("stage attempt" in text and t == 0.0 for t, _, text, _ in axis["marks"])
    names = [name for _, _, name in axis["phases"]]
    assert "commit" in names and names[-1] == "ended"
    starts = [a for a, _, _ in axis["phases"]]
    assert starts == sorted(starts)


def test_key_frames_show_outlined_tags(full):
    frames = full.html[full.html.index('id="frames"') : full.html.index('id="motion"')]
    assert frames.count("data:image/jpeg") >= 2
    assert "<polygon" in frames
    assert "first detection" in frames and "last picture before contact" in frames


def test_flight_page_size_is_bounded(full):
    pictures = sum(len(part.split('"')[0]) for part in full.html.split("data:image/jpeg;base64,")[1:])
    attempt_s = full.data["flights"][0]["home"][1]
    plots = sum(map(len, full.data["arrays"]))
    rest = len(full.html.encode()) - pictures - plots
    assert rest + plots * 20.0 / attempt_s < 3_000_000  # a flight of 20 s, without pictures
    assert pictures < 200_000


def test_page_of_two_flights_shows_both(golden, copied):
    score = json.loads((copied / "score.json").read_text())
    score["attached"] = False
    (copied / "score.json").write_text(json.dumps(score))
    both = Page(page.render([load(golden), load(copied)]))
    assert [p["key"] for p in both.data["plots"]] == PLOTS  # each once, with the series of both
    assert all({s["flight"] for s in p["series"]} == {0, 1} for p in both.data["plots"])
    assert len(both.data["flights"]) == 2
    assert "Perched" in both.text
    assert "Missed: within tolerance, but not attached" in both.text
    assert "DIFFERS" in both.text  # the second score.json differs from its recording


def test_report_is_written_to_its_default_path(copied, tmp_path, golden):
    assert write_report([copied]) == copied / "report.html"
    assert write_report([copied], golden) == copied / "report_vs_simple-ii.html"
    target = tmp_path / "mine.html"
    assert write_report([copied / "run.mcap"], out=target) == target
    assert "Perched" in target.read_text()
    assert not list(copied.glob(".*"))


def test_every_plot_has_one_unit(full):
    assert [p["unit"] for p in full.data["plots"] if "," in p["unit"] or "/10" in p["unit"]] == []
    units = {p["key"]: p["unit"] for p in full.data["plots"]}
    assert (units["over-board"], units["alignment"], units["accepted-age"]) == ("m", "deg", "s")
    assert full.plot("corners")["down"] and not full.plot("speed")["down"]  # a picture's first row is its highest


def test_the_page_lists_its_sections_and_says_what_detections_were_found_in(full, copied):
    assert [f'href="#{ident}"' in full.html for ident in SECTIONS] == [True] * len(SECTIONS)
    assert "detections from drawn pictures" in full.text
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["rig"]["camera"]["source"] = "model"
    (copied / "manifest.json").write_text(json.dumps(manifest))
    assert "detections from the paper's noise model, no pictures" in Page(page.render([load(copied)])).text
    manifest["rig"]["policy"]["knows"] = "mocap"
    (copied / "manifest.json").write_text(json.dumps(manifest))
    text = Page(page.render([load(copied)])).text
    assert "board known by motion capture" in text and "detections from" not in text


def test_wall_time_of_the_attempt_is_shown_of_a_live_run(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["wall_clock"]["zero_utc"] = "2026-01-02T03:04:05.500+00:00"
    (copied / "manifest.json").write_text(json.dumps(manifest))
    assert "attempt began" not in Page(page.render([load(copied)])).text  # virtual time
    (copied / "manifest.json").write_text(json.dumps({**manifest, "host": "live"}))
    recorded = load(copied)
    began = 5.5 + recorded.attempt_ns / 1e9
    text = f"attempt began 03:04:{int(began):02d}.{int(began * 1000) % 1000:03d} UTC"
    assert text in Page(page.render([recorded])).text


def test_roll_and_yaw_agree_with_the_recorded_attitude(full, golden):
    recorded = load(golden)
    t, y = full.series("yaw", "board")
    headings = np.degrees(np.unwrap(recorded.topics["truth/board"]["heading"]))
    wanted = np.interp(t, recorded.seconds(recorded.topics["truth/board"].nanoseconds()), headings)
    np.testing.assert_allclose((y - wanted + 180) % 360 - 180, 0.0, atol=0.5)
    t, y = full.series("roll", "board")
    np.testing.assert_allclose(y, 0.0, atol=0.5)  # the board's left axis stays level


def test_names_of_a_run_are_escaped_in_html(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    manifest["policy"]["name"] = "<script>alert(1)</script>"
    manifest["rig"]["title"] = '"><img src=x>'
    (copied / "manifest.json").write_text(json.dumps(manifest))
    html = page.render([load(copied)])
    assert "<script>alert" not in html
    assert "<img src=x" not in html
    Page(html)


def test_live_run_report_shows_late_steps(copied):
    pace = {"steps": 900, "late": 7, "missed": 2, "worst_ns": 12_500_000, "busy_ns": 5}
    table = {"services": {"brain": {"nodes": {"policy": pace}, "lost": {"belief": 3}, "dropped": {}}}}
    (copied / "live.json").write_text(json.dumps({**table, "remarks": ["the camera came late"]}))
    text = Page(page.render([load(copied)])).text
    assert "policy brain 900 7 2 12.5 3" in text
    assert "the camera came late" in text


def test_live_run_without_live_summary_is_reported(copied):
    manifest = json.loads((copied / "manifest.json").read_text())
    (copied / "manifest.json").write_text(json.dumps({**manifest, "host": "live"}))
    assert "late and missed steps of each node no live.json" in Page(page.render([load(copied)])).text
    (copied / "live.json").write_text("{")
    Page(page.render([load(copied)]))
