"""The page of a checklist's record."""

import json
import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from hil.check import records
from hil.check.judge import Outcome
from hil.cli.main import app
from hil.report.write import write_report
from tests.unit.hil.check.cleared import Site


@pytest.fixture
def site(tmp_path):
    (tmp_path / "checks").mkdir()
    return Site(tmp_path)


def page(path: Path) -> str:
    html = write_report([path]).read_text()
    assert not re.search(r"(src|href)=.https?://", html)
    return html


def test_page_of_a_go_says_who_signed_it_and_holds_every_item(site):
    path = site.go()
    html = page(path)
    assert "<strong>GO</strong>" in html and "What holds it up" not in html
    record = records.read(path)
    assert all(entry.title in html for entry in record.entries) and record.sign_off["operator"] in html
    assert path.with_suffix(".html").is_file()


def test_page_of_a_no_go_begins_with_what_holds_it_up(site):
    html = page(site.go(Outcome.FAIL, sign=False))
    assert "<strong>NO-GO</strong>" in html and html.index("What holds it up") < html.index("<h2>g</h2>")


def test_record_that_was_changed_after_its_signature_is_said_to_be_so(site):
    path = site.go()
    table = json.loads(path.read_text())
    table["entries"][0]["title"] = "<b>Easier</b>"
    path.write_text(json.dumps(table))
    html = page(path)
    assert "CHANGED after it was signed off" in html and "<b>Easier" not in html


def test_file_that_is_no_record_and_options_of_runs_are_refused_in_one_line(site, tmp_path):
    path = site.go()
    (tmp_path / "other.json").write_text("[]")
    for arguments in ([tmp_path / "other.json"], [path, "--each"], [path, "--compare", path]):
        result = CliRunner().invoke(app, ["runs", "report", *map(str, arguments)])
        assert result.exit_code == 2 and len(result.output.splitlines()) == 1, result.output
    assert not list(tmp_path.glob("*.html"))
