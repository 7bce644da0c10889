import json
import re
import shutil
from urllib.parse import unquote

import pytest

from hil.report.write import write_report
from hil.scoring.binomial import interval
from tests.unit.hil.report.pages import Page


@pytest.fixture
def runs(golden, tmp_path):
    """Five runs of one scenario, three of them perched, one without a verdict; and one of another."""
    made = []
    for seed in range(6):
        run = tmp_path / "runs" / f"20260102T03040{seed}Z_simple-ii_sim-seed{seed}"
        shutil.copytree(golden, run)
        made.append(run)
        score = json.loads((run / "score.json").read_text())
        manifest = json.loads((run / "manifest.json").read_text())
        manifest["seed"] = score["seed"] = seed
        if seed == 3:
            score |= {"within_tolerance": False, "attached": False, "outcome": "fail", "reasons": ["time"]}
            score["metrics"] |= {"planar": None, "x": None, "y": None, "normal_alignment_deg": None}
        if seed == 4:
            score["outcome"] = "incomplete"
        if seed == 5:
            manifest["scenario"] |= {"name": "mine", "title": "My own", "published": None}
            score["scenario"] = "mine"
        (run / "score.json").write_text(json.dumps(score))
        (run / "manifest.json").write_text(json.dumps(manifest))
    return made


def test_campaign_page_shows_counts_with_exact_intervals(runs, tmp_path):
    out = write_report(runs, out=tmp_path / "c.html")
    text = Page(out.read_text()).text
    low, high = (round(100 * p) for p in interval(3, 4))
    assert f"3 of 4 ({low}–{high} %)" in text
    assert "1 of 1 (3–100 %)" in text
    assert "the time ran out 1" in text
    assert "impact m/s" in text[: text.index("outcome")]  # of each scenario, before its single runs
    assert "seed4: ended before the referee decided" in text
    assert "Published flight: planar 0.23 m" in text
    assert "This scenario names no published row." in text


def test_a_contact_within_tolerance_without_attachment_is_a_miss(runs):
    score = json.loads((runs[0] / "score.json").read_text()) | {"attached": False}
    (runs[0] / "score.json").write_text(json.dumps(score))
    text = Page(write_report([runs[0].parent]).read_text()).text
    low, high = (round(100 * p) for p in interval(2, 4))
    assert f"2 of 4 ({low}–{high} %)" in text
    alone = Page(write_report([runs[0]]).read_text()).text
    assert "Missed: within tolerance, but not attached" in alone and "Perched" not in alone


def test_an_interrupted_run_is_not_counted(runs):
    change(runs[0], state="interrupted")
    text = Page(write_report([runs[0].parent]).read_text()).text
    assert "2 of 3" in text and "seed0: its state is interrupted" in text
    alone = Page(write_report([runs[0]]).read_text()).text
    assert "Not counted: the run's state is interrupted" in alone and "Perched" not in alone


def test_a_folder_of_runs_is_a_campaign(runs):
    out = write_report([runs[0].parent])
    assert out == runs[0].parent / "campaign.html"
    assert "3 of 4" in out.read_text()


def change(run, **tables):
    manifest = json.loads((run / "manifest.json").read_text())
    for name, table in tables.items():
        manifest[name] = {**manifest[name], **table} if isinstance(table, dict) else table
    (run / "manifest.json").write_text(json.dumps(manifest))


def test_a_run_that_was_cut_short_and_flown_again_is_no_warning(runs):
    change(runs[4], seed=2)  # seed 2 has a verdict: this is the run that the resumed campaign repeated
    found = Page(write_report([runs[0].parent]).read_text())
    assert "Left out" not in found.text and "1 cut short, and flown again" in found.text
    change(runs[4], seed=4)
    assert "Left out" in Page(write_report([runs[0].parent]).read_text()).text


def test_names_of_runs_link_to_their_reports(runs, tmp_path):
    found = Page(write_report([runs[0].parent]).read_text())
    assert found.links == [] and "runs report FOLDER --each" in found.text
    page = write_report([runs[0].parent], each=True)
    found = Page(page.read_text())
    assert len(found.links) == 5 and all((page.parent / unquote(link)).exists() for link in found.links)
    page = write_report([runs[0].parent], out=tmp_path / "c.html")
    assert all((page.parent / unquote(link)).exists() for link in Page(page.read_text()).links)


def test_the_page_says_what_failed_and_what_the_dots_mean(runs):
    score = json.loads((runs[0] / "score.json").read_text())
    score |= {"within_tolerance": False}
    score["metrics"] |= {"impact_tangential": 0.9}
    (runs[0] / "score.json").write_text(json.dumps(score))
    found = Page(write_report([runs[0].parent]).read_text())
    assert "speed along the board (m/s)" in found.text and "angle to the normal (deg)" in found.text
    assert "perched attached, outside tolerance missed" in found.text
    assert "1 of 4 did not touch the board and have no dot" in found.text


def test_policies_are_counted_separately_and_compared_on_common_seeds(runs, tmp_path):
    for seed in range(4):
        other = shutil.copytree(runs[seed], runs[seed].parent / f"other-{seed}")
        change(other, policy={"name": "mine.onnx", "sha256": "abcdef0123456789"})
        score = json.loads((other / "score.json").read_text())
        score |= {"within_tolerance": seed == 3, "attached": seed == 3, "reasons": [] if seed == 3 else ["time"]}
        (other / "score.json").write_text(json.dumps(score))
    text = Page(write_report([runs[0].parent]).read_text()).text
    assert "3 of 4" in text and "mine.onnx abcdef01 1 of 4" in text
    assert "planner mine.onnx abcdef01 simple-ii no difference shown: +50 points" in text  # the first by name is first
    assert "of 4 seeds 3 gained, 1 lost" in text


def test_runs_with_pictures_and_with_the_camera_model_are_counted_separately(runs, tmp_path):
    manifest = json.loads((runs[0] / "manifest.json").read_text())
    change(runs[0], rig={"camera": {**manifest["rig"]["camera"], "source": "model"}})
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert "sim, model planner 1 of 1" in text and "sim, pictures planner 2 of 3" in text


def test_campaign_page_reports_different_code_and_repeated_seeds(runs, tmp_path):
    change(runs[1], code={"commit": "1234567890abcdef", "dirty": False}, seed=0)
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert "These runs are of different code: 1234567890, " in text
    assert "simple-ii with planner: 1 runs repeat a seed" in text


def test_simulated_and_real_are_never_counted_together(runs, tmp_path):
    manifest = json.loads((runs[0] / "manifest.json").read_text())
    manifest["identity"] = "real"
    (runs[0] / "manifest.json").write_text(json.dumps(manifest))
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert "2 of 3" in text and "(real vehicle, planner)" in text


def test_campaign_without_a_verdict_is_refused(runs):
    for run in runs:
        (run / "score.json").unlink()
    with pytest.raises(ValueError, match="none of the 6 runs has a verdict"):
        write_report(runs)


def test_compare_of_a_campaign_is_refused(runs):
    with pytest.raises(ValueError, match="--compare puts one run beside another"):
        write_report(runs, runs[0])


def test_scenarios_of_one_name_and_another_content_are_counted_separately(runs, tmp_path):
    change(runs[0], scenario={"time_limit": 99.0})
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert re.search(r"simple-ii [0-9a-f]{8} sim, pictures planner 1 of 1", text)
    assert re.search(r"simple-ii [0-9a-f]{8} sim, pictures planner 2 of 3", text)
    assert " mine sim, pictures" in text, "a name that says its content is shown alone"


def test_rigs_of_one_name_and_another_content_are_counted_separately(runs, tmp_path):
    manifest = json.loads((runs[0] / "manifest.json").read_text())
    change(runs[0], rig={"mocap": {**manifest["rig"]["mocap"], "delay_ms": 99.0}})
    change(runs[1], rig={"title": "a title flies nothing"})
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert re.search(r"sim, pictures, sim [0-9a-f]{8} planner 1 of 1", text)
    assert re.search(r"sim, pictures, sim [0-9a-f]{8} planner 2 of 3", text)


def test_planners_with_other_predictors_are_counted_separately(runs, tmp_path):
    change(runs[0], policy={"predictor_sha256": "a" * 64})
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert re.search(r"planner [0-9a-f]{8} 1 of 1", text) and re.search(r"planner [0-9a-f]{8} 2 of 3", text)
