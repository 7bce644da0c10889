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
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import IO
from urllib.parse import quote

from hil.report.recorded.flight import Recorded, load

APPLICATION = "perch-hil"
_START_S = 30.0


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


def open_viewer(run: Path | str, remark: Callable[[str], None]) -> None:
    """Show a run in Rerun's window until it is closed; without a display serve a page until Ctrl-C.

    `remark` receives lines on how to open the page. Raises as `save_rrd`, and ViewerError if Rerun does not start.
    """
    sdk = rerun()
    recorded = load(run)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # the viewer must not be left behind
    with tempfile.TemporaryDirectory(prefix="perch-hil-") as folder:
        path = Path(folder) / f"{recorded.name}.rrd"
        _write(sdk, recorded, path)
        if has_display():
            words = _show(path, None, remark)
            if not words:
                return
            remark(f"Rerun opened no window here{words}: serving a page instead")
        words = _show(path, free_port(), remark)
    if words:
        raise ViewerError(f"Rerun does not start{words}. Use --save FILE.rrd and open that elsewhere", 3)


def _show(path: Path, web_port: int | None, remark: Callable[[str], None]) -> str:
    """Show a file until the viewer or the user ends it; returns why it could not be shown, empty if it was."""
    log, port = path.with_suffix(".log"), free_port()
    with log.open("wb") as output:
        viewer = spawn_viewer(port, path, log=output, web_port=web_port)
    try:
        if web_port is not None and accepts(viewer, port):
            for line in (*how_to_open(port, web_port), "Ctrl-C ends it"):
                remark(line)
        viewer.wait()
    except KeyboardInterrupt:
        return ""
    finally:
        stop_viewer(viewer)
    return error_in(log) or (": it ended" if web_port is not None else "")  # its exit code is 0 in any case


def accepts(viewer: subprocess.Popen[bytes], port: int) -> bool:
    """Wait until a viewer accepts connections; False if it ends, or does not within half a minute."""
    until = time.monotonic() + _START_S
    while viewer.poll() is None and time.monotonic() < until:
        with suppress(OSError), socket.create_connection(("127.0.0.1", port), timeout=0.2):
            return True
        time.sleep(0.05)
    return False


def page_of(port: int, web_port: int) -> str:
    """What a browser opens."""
    return f"http://127.0.0.1:{web_port}/?url={quote(address(port), safe='')}"


def how_to_open(port: int, web_port: int) -> list[str]:
    """What to tell of a page that is served, also to the user of another computer."""
    forward = " ".join(f"-L {number}:127.0.0.1:{number}" for number in (web_port, port))
    return [
        f"viewer: open {page_of(port, web_port)}",
        f"  if your browser is on another computer, first there: ssh {forward} {socket.gethostname()}",
    ]


def error_in(log: Path) -> str:
    """The last error that Rerun logged, as the end of a sentence; empty if there is none."""
    lines = [line for line in log.read_text(errors="replace").splitlines() if line.startswith("Error")]
    return f": {lines[-1][:160]}" if lines else ""


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
