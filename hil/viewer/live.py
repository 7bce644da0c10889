"""`run --view`: shows a run in progress in a window or on a web page. A separate process, bound to loopback."""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from hil.viewer.tap import Feed, FeedSpec, yield_to_others
from hil.viewer.view import (
    ViewerError,
    accepts,
    address,
    error_in,
    free_port,
    has_display,
    how_to_open,
    page_of,
    rerun,
    spawn_viewer,
    stop_viewer,
)


class RunViewer:
    """The viewer of one `run --view`: a window where there is a display, else a page served on loopback."""

    def __init__(self, remark: Callable[[str], None]) -> None:
        """Start it; `remark` receives lines on how to open the view. Raises ViewerError if there can be none."""
        rerun()
        self._remark = remark
        self._folder = tempfile.TemporaryDirectory(prefix="perch-hil-view-")
        self.log = Path(self._folder.name) / "log"
        self._port, self._web = free_port(), free_port()
        self.served = not has_display()
        process = self._start()
        if process is None and not self.served:
            remark("Rerun could not open a window here: serving a page instead")
            self.served, self._port = True, free_port()
            process = self._start()
        if process is None:
            words = error_in(self.log)
            self._folder.cleanup()
            raise ViewerError(f"the viewer does not start{words}", 3)
        self._process = process
        for line in how_to_open(self._port, self._web) if self.served else ():
            remark(line)

    def _start(self) -> subprocess.Popen[bytes] | None:
        """The viewer, once it accepts connections; None if it ended instead."""
        with self.log.open("ab") as output:
            process = spawn_viewer(self._port, log=output, web_port=self._web if self.served else None)
        yield_to_others(process)
        if accepts(process, self._port):
            return process
        stop_viewer(process)
        return None

    @property
    def page(self) -> str:
        """What a browser opens."""
        return page_of(self._port, self._web)

    @property
    def sink(self) -> str:
        """Where a feed sends to."""
        return address(self._port)

    def feed(
        self, name: str, *, board_size: float, tolerance: float,
        camera_offset: tuple[float, float, float], camera_tilt: float, endpoint: str = "", keys: str = "",
    ) -> Feed:  # fmt: skip
        """A feed for one run (see `FeedSpec`); several runs share the viewer."""
        spec = FeedSpec(self.sink, name, board_size, tolerance, camera_offset, camera_tilt, endpoint, keys)
        return Feed(spec, self.log)

    def close(self) -> None:
        """A page is served until Ctrl-C if there is a terminal; the user closes a window."""
        if not self.served:
            if self._process.poll() is not None and (why := error_in(self.log)):
                self._remark(f"the viewer's window is gone{why}")
        elif sys.stdin.isatty():
            self._remark(f"viewer: still at {self.page}; Ctrl-C ends it")
            with suppress(KeyboardInterrupt):
                self._process.wait()
        if self.served:
            stop_viewer(self._process)
        self._folder.cleanup()

    def __enter__(self) -> RunViewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
