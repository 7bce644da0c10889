"""The report in a real browser: it draws, zooms and stays quiet, on a desktop, on a phone and on paper."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from hil.report import page
from hil.report.recorded.flight import load
from hil.report.write import write_report
from tests.paths import GOLDEN_RUN as GOLDEN

sync_api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
CHROMIUM = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no chromium on this machine")

FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
]  # fmt: skip
DESKTOP, PHONE = {"width": 1280, "height": 900}, {"width": 390, "height": 844}


@pytest.fixture(scope="module")
def browser():
    with sync_api.sync_playwright() as playwright:
        started = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield started
        started.close()


@pytest.fixture(scope="module")
def report(tmp_path_factory) -> Path:
    return write_report([GOLDEN], out=tmp_path_factory.mktemp("report") / "report.html")


@pytest.fixture
def opened(browser):
    """Opens a file in a window of a size; fails if the page logged or requested anything."""
    logged: list[str] = []
    pages = []

    def open_(path: Path, size: dict[str, int]):
        tab = browser.new_page(viewport=size)
        tab.on("console", lambda message: logged.append(f"{message.type}: {message.text}"))
        tab.on("pageerror", lambda error: logged.append(f"error: {error}"))
        tab.on("request", lambda request: logged.append(request.url) if not _local(request.url) else None)
        tab.goto(path.as_uri())
        pages.append(tab)
        return tab

    yield open_
    for tab in pages:
        tab.close()
    assert logged == []


def _local(url: str) -> bool:
    return url.startswith(("file:", "data:"))


def view(tab) -> tuple[float, float]:
    low, high = tab.evaluate("document.documentElement.dataset.view").split()
    return float(low), float(high)


def settled(tab) -> None:
    """Two frames later, when what was asked for is drawn."""
    tab.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def drag(tab, ident: str, start: float, end: float) -> None:
    """Drag in a plot between two fractions of its width."""
    svg = tab.locator(f"#{ident} svg")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    y = box["y"] + box["height"] / 2
    tab.mouse.move(box["x"] + start * box["width"], y)
    tab.mouse.down()
    tab.mouse.move(box["x"] + (start + end) / 2 * box["width"], y)
    tab.mouse.move(box["x"] + end * box["width"], y)
    tab.mouse.up()
    settled(tab)


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
def test_every_plot_is_drawn_within_the_page(opened, report, size):
    tab = opened(report, size)
    assert tab.evaluate("document.documentElement.dataset.ready") == "yes"
    plots = tab.evaluate(
        """[...document.querySelectorAll('figure.plot')].map((f) => [f.id, f.getBoundingClientRect().height,
            [...f.querySelectorAll('svg path.line, svg path.dash, svg path.step, svg path.dots')]
              .reduce((n, p) => n + (p.getAttribute('d').match(/[ML]/g) || []).length, 0)])"""
    )
    assert len(plots) == 36
    assert [ident for ident, height, points in plots if height < 80 or points < 5] == []
    assert tab.evaluate("document.documentElement.scrollWidth") <= size["width"]
    drawn = tab.evaluate("[...document.querySelectorAll('svg')].map((s) => s.outerHTML).join('')")
    assert "NaN" not in drawn and "undefined" not in drawn + tab.locator("body").inner_text()


def test_zoom_is_linked_between_plots(opened, report):
    tab = opened(report, DESKTOP)
    home = view(tab)
    before = tab.locator("#plot-thrust path.step").first.get_attribute("d")
    drag(tab, "plot-rho", 0.4, 0.7)
    low, high = view(tab)
    assert home[0] < low < high < home[1]
    assert high - low == pytest.approx(0.3 * (home[1] - home[0]), rel=0.15)
    assert tab.locator("#plot-thrust path.step").first.get_attribute("d") != before
    tab.locator("#plot-speed svg").dblclick()
    settled(tab)
    assert view(tab) == home


def test_zoom_buttons_work_and_a_click_is_not_a_drag(opened, report):
    tab = opened(report, DESKTOP)
    home = view(tab)
    tab.get_by_role("button", name="last second").click()
    settled(tab)
    low, high = view(tab)
    assert high - low == pytest.approx(1.1, abs=1e-3)
    tab.locator("#plot-speed svg").click()
    settled(tab)
    assert view(tab) == (low, high)
    tab.get_by_role("button", name="everything").click()
    settled(tab)
    assert view(tab)[0] < home[0]
    tab.get_by_role("button", name="attempt").click()
    settled(tab)
    assert view(tab) == home


def test_values_are_read_under_the_pointer(opened, report):
    tab = opened(report, DESKTOP)
    svg = tab.locator("#plot-pitch svg")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    tab.mouse.move(box["x"] + box["width"] * 0.6, box["y"] + 60)
    values = tab.locator("#plot-pitch output").all_inner_texts()
    assert float(values[1]) == pytest.approx(45.0, abs=0.5)  # the board's inclination
    assert tab.locator("#plot-rho output").first.inner_text() != ""  # other plots read the same instant
    assert tab.locator("#now").inner_text().endswith(" s")


def test_pinch_zooms_on_a_phone(browser, report):
    context = browser.new_context(viewport=PHONE, has_touch=True, is_mobile=True)
    tab = context.new_page()
    tab.goto(report.as_uri())
    home = view(tab)
    svg = tab.locator("#plot-speed svg")
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    session = context.new_cdp_session(tab)
    y = box["y"] + 60
    xs = [box["x"] + box["width"] * f for f in (0.3, 0.45, 0.6, 0.8)]
    session.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": xs[0], "y": y}]})
    for x in xs[1:]:
        session.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x, "y": y}]})
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    settled(tab)
    low, high = view(tab)
    context.close()
    assert home[0] < low < high < home[1]


def test_scene_can_be_rotated(opened, report):
    tab = opened(report, DESKTOP)
    svg = tab.locator(".scene svg")
    before = svg.inner_html()
    assert before.count("<path") > 20
    svg.scroll_into_view_if_needed()
    box = svg.bounding_box()
    tab.mouse.move(box["x"] + 200, box["y"] + 150)
    tab.mouse.down()
    tab.mouse.move(box["x"] + 300, box["y"] + 120)
    tab.mouse.up()
    assert svg.inner_html() != before


def test_two_flights_are_drawn_on_one_axis(opened, tmp_path):
    path = write_report([GOLDEN], GOLDEN, tmp_path / "two.html")
    for size in (DESKTOP, PHONE):
        tab = opened(path, size)
        assert tab.locator("#plot-speed svg").count() == 1
        drawn = [p.get_attribute("d") for p in tab.locator("#plot-speed path.line").all()]
        assert len(drawn) == 4 and sorted(drawn)[::2] == sorted(drawn)[1::2]  # the same flight twice
        assert tab.locator("#plot-speed .key").all_inner_texts() == ["A: vehicle", "A: board", "B: vehicle", "B: board"]
        assert tab.evaluate("document.documentElement.scrollWidth") <= size["width"]


def test_time_axes_have_a_unit_and_a_spike_has_a_mark(opened, report):
    tab = opened(report, DESKTOP)
    plots = tab.locator("figure.plot").count()
    assert tab.locator("figure.plot text.unit").all_text_contents() == ["s"] * plots
    assert tab.locator("figure.plot path.beyond").count() > 0  # the impact in the body rates


def test_report_prints_on_a_bounded_number_of_pages(opened, report, tmp_path):
    tab = opened(report, DESKTOP)
    tab.pdf(path=tmp_path / "report.pdf")
    data = (tmp_path / "report.pdf").read_bytes()
    assert data.startswith(b"%PDF") and 3 <= data.count(b"/Type /Page\n") + data.count(b"/Type /Page ") <= 16


def test_report_without_scripts_shows_verdict_and_figures(browser, report):
    context = browser.new_context(java_script_enabled=False)
    tab = context.new_page()
    tab.goto(report.as_uri())
    text = tab.locator("body").inner_text()
    assert "Perched" in text and "Plots over time need JavaScript" in text
    assert tab.locator("svg.plane").count() >= 4
    context.close()


def test_report_of_a_truncated_recording_is_drawn(opened, tmp_path):
    run = shutil.copytree(GOLDEN, tmp_path / "run")
    data = (run / "run.mcap").read_bytes()
    (run / "run.mcap").write_bytes(data[: int(len(data) * 0.6)])
    (run / "score.json").unlink()
    path = tmp_path / "broken.html"
    path.write_text(page.render([load(run)]))
    tab = opened(path, DESKTOP)
    assert tab.locator(".alert").first.inner_text().startswith("The recording is incomplete")
    assert tab.locator("figure.plot path.line").count() > 5


def test_campaign_page_opens(opened, tmp_path):
    for seed in range(3):
        run = shutil.copytree(GOLDEN, tmp_path / "runs" / f"seed{seed}")
        manifest = json.loads((run / "manifest.json").read_text())
        (run / "manifest.json").write_text(json.dumps({**manifest, "seed": seed}))
    for size in (DESKTOP, PHONE):
        tab = opened(write_report([tmp_path / "runs"]), size)
        assert "3 of 3" in tab.locator("#summary").inner_text()
        assert tab.evaluate("document.documentElement.scrollWidth") <= size["width"]
