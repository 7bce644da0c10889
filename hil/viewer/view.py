"""Rerun views of a run: 3-D with board, camera and tags, pictures with detections, and the main time series.

Rerun is an optional extra, imported only on request; it never runs in a process that controls anything.
"""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import IO

from hil.report.recorded.flight import Recorded, load

APPLICATION = "perch-hil"


class ViewerError(RuntimeError):
    """The viewer cannot be used; `code` is the exit code the command line should give."""

    def __init__(self, text: str, code: int) -> None:
        super().__init__(text)
        self.code = code


def rerun() -> ModuleType:
    """The SDK. Raises ViewerError with how to install it."""
    try:
        import rerun as module
    except ImportError:
        raise ViewerError("the viewer is not installed: pip install 'perch-hil[view]' (rerun-sdk 0.41)", 2) from None
    return module


def save_rrd(run: Path | str, path: Path) -> None:
    """Write a run as an .rrd file with its blueprint, without a display.

    Raises ReadError, RunError (not a run), ViewerError (no Rerun), OSError (cannot be written).
    """
    sdk = rerun()
    recorded = load(run)
    scratch = path.with_name(f".{path.name}.new")
    scratch.touch()  # the SDK does not report why it could not open a file
    try:
        _write(sdk, recorded, scratch)
        scratch.replace(path)
    finally:
        scratch.unlink(missing_ok=True)


def open_viewer(run: Path | str) -> None:
    """Show a run in Rerun's window and wait until it is closed.

    Raises as `save_rrd`, and ViewerError if no window can be opened.
    """
    sdk = rerun()
    recorded = load(run)
    if not has_display():
        raise ViewerError("there is no display for a window here. Use --save FILE.rrd and open that elsewhere", 3)
    with tempfile.TemporaryDirectory(prefix="perch-hil-") as folder:
        path = Path(folder) / f"{recorded.name}.rrd"
        _write(sdk, recorded, path)
        log = Path(folder) / "viewer.log"
        with log.open("wb") as output, spawn_viewer(free_port(), path, log=output) as window:
            try:
                window.wait()
            except KeyboardInterrupt:
                stop_viewer(window)
                return
        # its exit code is 0 also when no window could be opened
        errors = [line for line in log.read_text(errors="replace").splitlines() if line.startswith("Error")]
    if errors:
        raise ViewerError(
            f"Rerun opened no window ({errors[-1][:160]}). Use --save FILE.rrd and open that elsewhere", 3
        )


def spawn_viewer(
    port: int, *files: Path, log: IO[bytes] | None = None, web_port: int | None = None
) -> subprocess.Popen[bytes]:
    """Start Rerun in a process of its own, listening on loopback only. Raises OSError if it cannot start.

    A window; with `web_port` a page for a browser instead. `address(port)` is what a process that logs connects to;
    `files` are opened at once; `log` receives its output. Ctrl-C in the terminal does not reach it.
    """
    command = [sys.executable, "-m", "rerun_cli", "--bind", "127.0.0.1", "--port", str(port), "--hide-welcome-screen"]
    if web_port is not None:
        command += ["--serve-web", "--web-viewer-port", str(web_port)]
    return subprocess.Popen(
        [*command, *map(str, files)], stdout=subprocess.DEVNULL, stderr=log or subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip


def stop_viewer(process: subprocess.Popen[bytes]) -> None:
    """End a viewer: its whole session, for the SDK's launcher does not take the viewer itself along."""
    with suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGTERM)
    process.wait()


def address(port: int) -> str:
    """Where the window of `spawn_viewer` listens."""
    return f"rerun+http://127.0.0.1:{port}/proxy"


def has_display() -> bool:
    """Whether a window can be asked for here."""
    names = ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET")
    return not sys.platform.startswith("linux") or any(map(os.environ.get, names))


def free_port() -> int:
    """A TCP port of loopback that nothing listens on now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def _write(sdk: ModuleType, recorded: Recorded, path: Path) -> None:
    from hil.viewer.finished import blueprint, log_run

    with sdk.RecordingStream(APPLICATION, recording_id=recorded.name) as stream:
        stream.save(path, default_blueprint=blueprint(recorded))
        log_run(stream, recorded)
