import json
import shutil

import pytest
from pages import Page

from hil.binomial import interval
from hil.report.write import write_report


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


def test_counts_with_their_exact_interval(runs, tmp_path):
    out = write_report(runs, out=tmp_path / "c.html")
    text = Page(out.read_text()).text
    low, high = (round(100 * p) for p in interval(3, 4))
    assert f"3 of 4 ({low}–{high} %)" in text
    assert "1 of 1 (3–100 %)" in text
    assert "the time ran out 1" in text
    assert "seed4: ended before the referee decided" in text
    assert "Published flight: planar 0.23 m" in text
    assert "This scenario names no published row." in text


def test_a_folder_of_runs_is_a_campaign(runs):
    out = write_report([runs[0].parent])
    assert out == runs[0].parent / "campaign.html"
    assert "3 of 4" in out.read_text()


def test_mixed_policies_are_said(runs, tmp_path):
    manifest = json.loads((runs[0] / "manifest.json").read_text())
    manifest["policy"]["name"] = "other.onnx"
    (runs[0] / "manifest.json").write_text(json.dumps(manifest))
    out = write_report(runs, out=tmp_path / "c.html")
    assert "mixes policies: other.onnx, planner" in out.read_text()


def test_simulated_and_real_are_never_counted_together(runs, tmp_path):
    manifest = json.loads((runs[0] / "manifest.json").read_text())
    manifest["identity"] = "real"
    (runs[0] / "manifest.json").write_text(json.dumps(manifest))
    text = Page(write_report(runs, out=tmp_path / "c.html").read_text()).text
    assert "2 of 3" in text and "(real vehicle)" in text


def test_no_verdict_at_all(runs):
    for run in runs:
        (run / "score.json").unlink()
    with pytest.raises(ValueError, match="none of the 6 runs has a verdict"):
        write_report(runs)


def test_compare_takes_one_run(runs):
    with pytest.raises(ValueError, match="--compare puts one run beside another"):
        write_report(runs, runs[0])
