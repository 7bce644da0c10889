"""`run --view`: messages reach the viewer, a slow viewer does not block the run, and no process is orphaned."""

import os
import re
import signal
import socket
import subprocess
import sys
import urllib.request
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from hil.cli import main as cli
from hil.contract import messages as m
from hil.viewer import live as view_live
from hil.viewer.tap import PICTURES, SHOWN_NS, Feed, FeedSpec, Thinner, reduced
from hil.viewer.view import stop_viewer
from tests.unit.hil.recording.recorded_flight import PICTURE, flight
from tests.unit.hil.viewer.test_view import entities

SPEC = FeedSpec("", "a flight", 0.42, 0.2, (0.08, 0.0, 0.0), 0.26)


@pytest.fixture
def sink(tmp_path):
    pytest.importorskip("rerun")
    return tmp_path / "shown.rrd"


def test_viewer_shows_a_lockstep_flight(sink, tmp_path):
    with Feed(replace(SPEC, sink=str(sink)), tmp_path / "log") as feed:
        for lane in feed._lanes:
            lane.setblocking(True)  # here every message shall arrive
        for now_ns, topic, message in flight(2.0):
            feed(now_ns, topic, message)
    assert feed.dropped == 0
    rows = entities(sink)
    assert rows["/world/vehicle"] == rows["/world/board"] == 50  # 2 s at 25 Hz
    assert rows["/world/vehicle/camera"] >= 20
    assert rows["/plots/tags/0"] == 1 + 100  # its colour, and every picture's outcome
    for path in ("/world/belief", "/world/belief/outline", "/plots/rho/0", "/plots/pitch/1", "/events"):
        assert rows.get(path, 0) >= 1, path
    assert "messages shown" in (tmp_path / "log").read_text()


def test_viewer_shows_a_live_run(sink, tmp_path):
    pytest.importorskip("zenoh")
    from hil.bus.leaf import Bus, open_hub

    endpoint = f"tcp/127.0.0.1:{view_live.free_port()}"
    spec = replace(SPEC, sink=str(sink), endpoint=endpoint)
    with open_hub(endpoint), Feed(spec, tmp_path / "log") as feed, Bus(endpoint) as bus:
        steps = ((now + lap * 2 * 10**9, topic, m) for lap in range(10**6) for now, topic, m in flight(2.0))
        while not sink.exists() or sink.stat().st_size < 200_000:  # a run that goes on until enough was shown
            assert feed._process.poll() is None, (tmp_path / "log").read_text()
            bus.publish(*next(steps))
    rows = entities(sink)
    for path in ("/world/vehicle", "/world/board", "/world/vehicle/camera", "/plots/rho/0"):
        assert rows.get(path, 0) > 1, path


def test_hanging_viewer_does_not_block_the_run(sink, tmp_path):
    picture = m.Image(0, 1280, 720, 2_000_000, PICTURE, 0)
    with Feed(replace(SPEC, sink=str(sink)), tmp_path / "log") as feed:
        os.kill(feed._process.pid, signal.SIGSTOP)
        for step in range(5000):  # a call that waited would never come back
            now = step * 100_000_000
            feed(now, "event", m.Event(now, "info", "test", "x" * 200))
            feed(now, PICTURES, replace(picture, stamp_ns=now))
        assert feed.dropped > 5000
        os.kill(feed._process.pid, signal.SIGCONT)


def test_ended_viewer_does_not_end_the_run(sink, tmp_path):
    with Feed(replace(SPEC, sink=str(sink)), tmp_path / "log") as feed:
        feed._process.kill()
        feed._process.wait()
        for now_ns, topic, message in flight(0.5):
            feed(now_ns, topic, message)
        assert feed.dropped > 10
    assert feed._process.returncode == -signal.SIGKILL


def test_feed_process_ends_when_its_run_is_killed(sink, tmp_path):
    """A run that is killed closes its sockets: the feed sees it and ends."""
    feed = Feed(replace(SPEC, sink=str(sink)), tmp_path / "log")
    for lane in feed._lanes:
        lane.close()
    assert feed._process.wait(60) == 0
    feed.close()


@given(st.lists(st.integers(0, 10**10), min_size=1, max_size=60), st.sampled_from(sorted(SHOWN_NS)))
def test_thinner_keeps_the_minimum_interval_between_messages(times, topic):
    thinner = Thinner()
    let = [now for now in sorted(times) if thinner.lets(now, topic)]
    assert let[0] == min(times)
    assert all(b - a >= SHOWN_NS[topic] for a, b in pairwise(let))
    assert not thinner.lets(10**12, "car/command")


def test_wide_picture_is_halved_once():
    small = reduced(m.Image(5, 1280, 720, 1, PICTURE, 7))
    assert (small.width, small.height, len(small.data), small.stamp_ns) == (640, 360, 640 * 360, 5)
    assert reduced(small) is small


def test_viewer_without_a_display_serves_a_page_on_loopback(monkeypatch):
    pytest.importorskip("rerun")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    reported: list[str] = []
    with view_live.RunViewer(reported.append) as viewer:
        address = re.search(r"http://127\.0\.0\.1:(\d+)/", reported[0])
        assert address and "ssh -L" in reported[1]
        listening = subprocess.run(["ss", "-ltnH"], capture_output=True, text=True, check=True).stdout.split()
        assert f"127.0.0.1:{viewer._port}" in listening and f"0.0.0.0:{viewer._port}" not in listening
        with urllib.request.urlopen(viewer.page, timeout=30) as page:
            assert page.status == 200
    with suppress(ConnectionError):  # refused, or reset while it goes
        while True:
            socket.create_connection(("127.0.0.1", viewer._port), timeout=5).close()


def test_viewer_serves_a_page_when_no_window_opens(monkeypatch):
    pytest.importorskip("rerun")
    monkeypatch.setenv("DISPLAY", ":77")
    asked: list[int | None] = []
    real = view_live.spawn_viewer

    def spawn(port, *files, log=None, web_port=None):
        asked.append(web_port)
        if web_port is None:
            return subprocess.Popen(["false"], start_new_session=True)
        return real(port, *files, log=log, web_port=web_port)

    monkeypatch.setattr(view_live, "spawn_viewer", spawn)
    reported: list[str] = []
    with view_live.RunViewer(reported.append) as viewer:
        assert viewer.served and asked[0] is None and asked[1]
    assert reported[0].startswith("Rerun could not open a window here") and reported[1].startswith(
        "viewer: open http://"
    )


def test_viewer_start_error_is_one_line(monkeypatch, tmp_path):
    pytest.importorskip("rerun")
    monkeypatch.setattr(view_live, "spawn_viewer", lambda *_, **__: subprocess.Popen(["false"], start_new_session=True))
    result = CliRunner().invoke(cli.app, ["run", "simple-i", "--view", "--out", str(tmp_path / "runs")])
    assert result.exit_code == 3 and result.stderr.endswith("perch-hil: the viewer does not start\n")
    assert not (tmp_path / "runs").exists()


def test_run_with_view_is_refused_without_the_sdk(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "rerun", None)
    result = CliRunner().invoke(cli.app, ["run", "simple-i", "--view", "--out", str(tmp_path / "runs")])
    assert result.exit_code == 2 and "pip install 'perch-hil[view]'" in result.stderr
    assert not (tmp_path / "runs").exists()


def test_child_process_of_the_viewer_launcher_is_ended():
    launcher = subprocess.Popen(
        ["sh", "-c", "sleep 600 & echo $!; wait"], stdout=subprocess.PIPE, start_new_session=True
    )
    assert launcher.stdout is not None
    launcher.stdout.readline()
    stop_viewer(launcher)
    assert launcher.stdout.read() == b""  # the end of file: the child held the other end
