"""The viewer, without a display: what is written, and the error when it cannot be used."""

import os
import re
import shutil
import signal
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from hil.cli import runs as cli_runs
from hil.recording.reader import ReadError
from hil.report.recorded.flight import load
from hil.viewer import view
from tests.paths import GOLDEN_RUN as GOLDEN
from tests.paths import ROOT
from vehicle.camera.pinhole import Camera


@pytest.fixture
def command():
    app = typer.Typer()
    cli_runs.register(app)
    return lambda *args: CliRunner().invoke(app, [str(a) for a in args])


def entities(path):
    """entity path -> rows of an .rrd file."""
    chunks = pytest.importorskip("rerun.chunk")
    rows: dict[str, int] = {}
    reader = chunks.RrdReader(path)
    assert len(reader.recordings()) == 1 and len(reader.blueprints()) >= 1
    for chunk in reader.stream(store=reader.recordings()[0]).to_chunks():
        rows[str(chunk.entity_path)] = rows.get(str(chunk.entity_path), 0) + chunk.num_rows
    return rows


def test_saved_file_holds_scene_pictures_and_series(tmp_path):
    pytest.importorskip("rerun")
    view.save_rrd(GOLDEN, tmp_path / "run.rrd")
    rows = entities(tmp_path / "run.rrd")
    for path in ("/world/vehicle", "/world/board", "/world/belief", "/world/vehicle/camera", "/plots/rho/0", "/events"):
        assert rows.get(path, 0) > 1, path
    for path in ("/world/board/tags", "/world/board/plate", "/world/vehicle/camera/tags", "/world/detection"):
        assert rows.get(path, 0) >= 1, path
    assert [p.name for p in tmp_path.iterdir()] == ["run.rrd"]


def test_finished_run_has_the_entities_of_a_live_run(tmp_path):
    sdk = pytest.importorskip("rerun")
    from hil.viewer.stream import ViewStream

    recorded = load(GOLDEN)
    live, saved = tmp_path / "live.rrd", tmp_path / "saved.rrd"
    with sdk.RecordingStream("test") as stream:
        stream.save(live, default_blueprint=sdk.blueprint.Blueprint())
        view_stream = ViewStream(stream, recorded.board_size, recorded.tolerance.distance, Camera())
        for topic, columns in recorded.topics.items():
            for message in columns.messages:
                view_stream.add(topic, message)
    view.save_rrd(GOLDEN, saved)
    shown = set(entities(saved))
    assert set(entities(live)) <= shown
    derived = {path.split("/")[2] if path.startswith("/plots") else path for path in shown - set(entities(live))}
    assert derived <= {"closing", "belief-position", "belief-angles", "belief-speed", "thrust"} | {
        "/world/paths/vehicle", "/world/paths/board", "/world/vehicle/camera/tags",
    }  # fmt: skip


def test_truncated_recording_is_shown_up_to_the_cut(tmp_path):
    pytest.importorskip("rerun")
    run = shutil.copytree(GOLDEN, tmp_path / "run")
    data = (run / "run.mcap").read_bytes()
    (run / "run.mcap").write_bytes(data[: len(data) // 2])
    view.save_rrd(run, tmp_path / "run.rrd")
    assert entities(tmp_path / "run.rrd").get("/world/vehicle", 0) > 1


def test_view_of_a_file_that_is_not_a_recording_is_refused(tmp_path, command):
    pytest.importorskip("rerun")
    (tmp_path / "x.mcap").write_bytes(b"nonsense")
    with pytest.raises(ReadError):
        view.save_rrd(tmp_path / "x.mcap", tmp_path / "x.rrd")
    result = command("view", tmp_path / "x.mcap", "--save", tmp_path / "x.rrd")
    assert result.exit_code == 2 and result.stderr.count("\n") == 1
    assert not (tmp_path / "x.rrd").exists()


def test_missing_viewer_package_is_a_one_line_error(monkeypatch, command):
    monkeypatch.setitem(sys.modules, "rerun", None)
    result = command("view", GOLDEN)
    assert result.exit_code == 2
    assert result.stderr == "perch-hil: the viewer is not installed: pip install 'perch-hil[view]' (rerun-sdk 0.41)\n"


def test_missing_folder_of_the_saved_file_is_a_one_line_error(tmp_path, command):
    pytest.importorskip("rerun")
    result = command("view", GOLDEN, "--save", tmp_path / "no" / "x.rrd")
    assert result.exit_code == 3 and "cannot be written" in result.stderr and result.stderr.count("\n") == 1


def without_display(monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    if not sys.platform.startswith("linux"):
        pytest.skip("only Linux can be without a display")


def test_without_a_display_a_page_is_served_until_ctrl_c(monkeypatch, tmp_path):
    pytest.importorskip("rerun")
    without_display(monkeypatch)
    environment = {k: v for k, v in os.environ.items() if "DISPLAY" not in k and k != "WAYLAND_SOCKET"}
    command = [sys.executable, "-c", "from hil.cli.main import main; main()", "runs", "view", str(GOLDEN)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment, cwd=ROOT) as process:
        assert process.stdout is not None
        page = process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+/\?url=\S+", page)
        try:
            assert found, page
            with urllib.request.urlopen(found[0], timeout=10) as answer:
                assert answer.status == 200
        finally:
            process.send_signal(signal.SIGINT)
        assert process.wait(20) == 0
    with pytest.raises(OSError):  # nothing is left behind that serves
        urllib.request.urlopen(found[0], timeout=2)


def test_a_viewer_that_does_not_start_is_a_one_line_error(monkeypatch, command):
    pytest.importorskip("rerun")
    without_display(monkeypatch)
    monkeypatch.setattr(view, "spawn_viewer", lambda *_, **__: subprocess.Popen(["false"], start_new_session=True))
    result = command("view", GOLDEN)
    assert result.exit_code == 3
    assert "Rerun does not start" in result.stderr and "Use --save FILE.rrd" in result.stderr
    assert result.stderr.count("\n") == 1


def test_the_viewer_listens_on_loopback_only(monkeypatch):
    started = []
    monkeypatch.setattr(view.subprocess, "Popen", lambda command, **_: started.append(command))
    port = view.free_port()
    view.spawn_viewer(port, Path("a.rrd"))
    assert started[0][started[0].index("--bind") + 1] == "127.0.0.1"
    assert started[0][started[0].index("--port") + 1] == str(port)
    assert started[0][-1] == "a.rrd"
    assert view.address(port) == f"rerun+http://127.0.0.1:{port}/proxy"


def test_report_command_writes_a_report(tmp_path, command):
    run = shutil.copytree(GOLDEN, tmp_path / "run")
    result = command("report", run)
    assert result.exit_code == 0 and result.stdout.startswith(f"wrote {run / 'report.html'}")
    result = command("report", run, "--out", tmp_path / "absent" / "r.html")
    assert result.exit_code == 3 and result.stderr.count("\n") == 1
    result = command("report", run, run, "--compare", run)
    assert result.exit_code == 2 and result.stderr.count("\n") == 1


@pytest.mark.parametrize("content", [b"", b"not a recording", b"\x89MCAP0\r\n"])
def test_report_command_refuses_a_file_that_is_not_a_recording(tmp_path, command, content):
    (tmp_path / "x.mcap").write_bytes(content)
    result = command("report", tmp_path / "x.mcap")
    assert result.exit_code == 2
    assert result.stderr.startswith("perch-hil: ") and result.stderr.count("\n") == 1
    assert [p.name for p in tmp_path.iterdir()] == ["x.mcap"]
