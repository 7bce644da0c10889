"""`run --live --foxglove`: starts the server's process for a run, and ends it."""

from __future__ import annotations

import importlib.util
import json
import select
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from hil.viewer.foxglove.feed import ServerSpec
from hil.viewer.tap import yield_to_others
from hil.viewer.view import ViewerError

LAYOUT = Path(__file__).with_name("perching.json")
_START_S = 60.0
_END_S = 5.0


def check_installed() -> None:
    """Raises ViewerError without the SDK."""
    if importlib.util.find_spec("foxglove") is None:
        raise ViewerError(
            "Foxglove's server is not installed: pip install 'perch-hil[foxglove]' (foxglove-sdk 0.30)", 2
        )


class FoxgloveProcess:
    """The server of one run, in a process of its own.

    `dropped`: messages that the process was too slow for, known at its end.
    """

    def __init__(self, spec: ServerSpec) -> None:
        """Start it, and wait until it listens. Raises ViewerError if it does not."""
        check_installed()
        self.dropped = 0
        self._folder = tempfile.TemporaryDirectory(prefix="perch-hil-foxglove-")
        self.log = Path(self._folder.name) / "log"
        with self.log.open("ab") as output:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "hil.viewer.foxglove.feed", json.dumps(asdict(spec))],
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=output, start_new_session=True,
            )  # fmt: skip
        yield_to_others(self.process)
        self.port = self._listening()

    def _listening(self) -> int:
        """The port that the process tells once it listens."""
        pipe = self.process.stdout
        assert pipe is not None
        ready, _, _ = select.select([pipe], [], [], _START_S)
        line = pipe.readline() if ready else b""
        pipe.close()
        if line.strip().isdigit():
            return int(line)
        why = self._last_line() or "it does not start"
        self.close()
        raise ViewerError(f"Foxglove's server: {why}", 3)

    def _last_line(self) -> str:
        lines = self.log.read_text(errors="replace").splitlines()
        return lines[-1] if lines else ""

    def close(self) -> None:
        """End it; what it has received is still sent, for a few seconds at most."""
        self.process.terminate()
        try:
            self.process.wait(_END_S)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        with suppress(OSError, ValueError, TypeError, KeyError):
            self.dropped = int(json.loads(self._last_line())["dropped"])
        self._folder.cleanup()

    def __enter__(self) -> FoxgloveProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
