"""The report's sections on PX4's own log."""

import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

from hil.cli.main import app
from hil.report import page
from hil.report.recorded.flight import load
from tests.paths import FIRMWARE_RUN, GOLDEN_RUN
from tests.unit.hil.report.pages import Page

PLOTS = [f"px4-rate-{axis}" for axis in range(3)] + ["px4-motors", "px4-voltage", "px4-shake", "px4-ratio-gps"]


@pytest.fixture(scope="module")
def full():
    return Page(page.render([load(FIRMWARE_RUN)]))


@pytest.fixture
def folder(tmp_path):
    return shutil.copytree(FIRMWARE_RUN, tmp_path / "runs" / "flight")


def report(*arguments):
    return CliRunner().invoke(app, ["runs", "report", *map(str, arguments)])


def test_log_in_the_runs_folder_is_shown_by_itself(full):
    keys = [plot["key"] for plot in full.data["plots"]]
    assert set(PLOTS) <= set(keys)
    assert {"px4-log", "px4-control", "px4-estimator"} <= set(full.ids)
    assert "PX4 1.17.0" in full.text and "time synchronisation" in full.text
    assert "one sigma" in full.text and "MPC_THR_HOVER" in full.text and "during the attempt" in full.text


def test_rates_of_the_log_are_drawn_as_the_run_draws_them(full):
    t, mine = full.series("px4-rate-1", "achieved")
    at, run = full.series("rate-1", "achieved")
    inside = (t > max(at[0], 0.0)) & (t < full.data["flights"][0]["decided"])
    assert np.corrcoef(mine[inside], np.interp(t[inside], at, run))[0, 1] > 0.9  # the same sign and time


def test_motor_outputs_are_shares(full):
    for motor in range(1, 5):
        _, y = full.series("px4-motors", f"motor {motor}")
        assert np.nanmin(y) >= 0.0 and np.nanmax(y) <= 1.0


def test_run_without_a_log_has_no_such_section():
    assert not {"px4-log", "px4-control", "px4-estimator"} & set(Page(page.render([load(GOLDEN_RUN)])).ids)


def test_run_with_a_log_beside_one_without_makes_one_page():
    both = Page(page.render([load(FIRMWARE_RUN), load(GOLDEN_RUN)]))
    assert both.series("px4-motors", "motor 1")[0].size


def test_log_is_given_by_option(folder):
    elsewhere = folder.parent / "log_7.ulg"
    (folder / "firmware.ulg").rename(elsewhere)
    assert report(folder, "--ulog", elsewhere).exit_code == 0
    assert "log_7.ulg" in Page((folder / "report.html").read_text()).text


def test_broken_log_in_the_folder_is_a_remark(folder):
    (folder / "firmware.ulg").write_bytes(b"no log")
    assert report(folder).exit_code == 0
    assert "the autopilot's log is left out" in (folder / "report.html").read_text().replace("&#39;", "'")


def test_cut_log_says_what_is_missing(folder):
    data = (folder / "firmware.ulg").read_bytes()
    (folder / "firmware.ulg").write_bytes(data[: len(data) // 2])
    assert report(folder).exit_code == 0
    assert "cut off" in Page((folder / "report.html").read_text()).text


def test_log_of_another_flight_is_not_drawn(folder):
    shutil.copy(FIRMWARE_RUN / "firmware.ulg", folder / "firmware.ulg")
    other = shutil.copytree(GOLDEN_RUN, folder.parent / "other")
    assert report(other, "--ulog", folder / "firmware.ulg").exit_code == 0
    found = Page((other / "report.html").read_text())
    assert "not drawn over time" in found.text and "px4-motors" not in [p["key"] for p in found.data["plots"]]
    assert "MPC_THR_HOVER" in found.text  # what needs no clock is shown


@pytest.mark.parametrize(
    ("ulog", "words"), [("none.ulg", "no such file"), ("manifest.json", "is no log of PX4"), (".", "no such file")]
)
def test_wrong_log_is_refused_in_one_line(folder, ulog, words):
    result = report(folder, "--ulog", folder / ulog)
    assert result.exit_code == 2 and words in result.output and len(result.output.splitlines()) == 1
    assert not (folder / "report.html").exists()


def test_one_log_for_several_runs_is_refused(folder):
    result = report(folder, GOLDEN_RUN, "--ulog", folder / "firmware.ulg")
    assert result.exit_code == 2 and "one flight" in result.output
