"""A PX4 SITL firmware as a process: started in a folder of its own, ended with the run, its log kept.

A restart keeps the folder, and with it the parameters, as a flight controller does.

The build folder is the one that PX4's build makes (build/px4_sitl_default): it holds bin/px4 and etc.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Mapping
from pathlib import Path

from hil.wires import WireError

MODEL = "none_iris"  # of the firmware's own models the one that waits for a simulator of the user's
LOG, FLIGHT_LOG = "firmware.log", "firmware.ulg"
_GRACE_S = 3.0
_SESSION = 3  # of /proc/PID/stat, behind the name
_PR_SET_PDEATHSIG = 1


def check_build(folder: str) -> Path:
    """The build folder. Raises WireError if PX4 is not in it."""
    path = Path(folder).expanduser().resolve()
    for needed in ("bin/px4", "etc/init.d-posix/rcS"):
        if not (path / needed).exists():
            raise WireError(f"{folder} is no build folder of PX4's SITL: {needed} is missing in it")
    if not os.access(path / "bin/px4", os.X_OK):
        raise WireError(f"{path / 'bin/px4'} may not be executed")
    return path


class Firmware:
    """One firmware process. `start` it, and `stop` it at the end of the run."""

    def __init__(self, build: str, parameters: Mapping[str, float], instance: int = 0, core: int | None = None) -> None:
        """`parameters`: name -> value, set before it boots. `core`: the one that it runs on, None for any.

        Raises WireError for a folder without PX4.
        """
        self._build, self._instance, self._core = check_build(build), instance, core
        self._environment = {
            **{name: value for name, value in os.environ.items() if not name.startswith("PX4_")},
            **{f"PX4_PARAM_{name}": f"{value:.9g}" for name, value in parameters.items()},
            "PX4_SIM_MODEL": MODEL,
        }
        self._process: subprocess.Popen[bytes] | None = None
        self._work: Path | None = None
        self._folder: Path | None = None

    def start(self, folder: Path) -> None:
        """Start it; its log goes into `folder`. Raises WireError if it cannot be executed."""
        self._folder, self._work = folder, Path(tempfile.mkdtemp(prefix="perch-firmware-"))
        self._launch()

    def restart(self) -> None:
        """End it as a loss of power does, and start it anew. Raises WireError if it cannot be executed."""
        self._end((signal.SIGKILL,))
        self._launch()

    def _launch(self) -> None:
        assert self._folder is not None
        binary = str(self._build / "bin/px4")
        command = [binary, "-d", "-i", str(self._instance), "-w", str(self._work), str(self._build / "etc")]
        try:
            with (self._folder / LOG).open("ab") as log:
                self._process = subprocess.Popen(
                    command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT, cwd=self._work,
                    env=self._environment, start_new_session=True, preexec_fn=self._prepare,
                )  # fmt: skip
        except OSError as error:
            raise WireError(f"{binary} cannot be started: {error.strerror}") from None

    def _prepare(self) -> None:
        """In the new process."""
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if self._core is not None:
            os.sched_setaffinity(0, {self._core})

    def starting(self) -> frozenset[int] | None:
        """Commands of its start script that are under way (process ids); None once the script has ended."""
        commands, shells = set(), 0
        for stat in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):  # it has ended meanwhile
                before, _, after = stat.read_text(encoding="utf-8", errors="replace").rpartition(")")
                number, _, name = before.partition(" (")
                if self._process is None or int(after.split()[_SESSION]) != self._process.pid:
                    continue
                if name == "sh":
                    shells += 1
                elif int(number) != self._process.pid:
                    commands.add(int(number))
        return frozenset(commands) if commands or shells else None

    def ended(self) -> str:
        """How it ended, in words; empty while it runs."""
        code = None if self._process is None else self._process.poll()
        return "" if code is None else f"the firmware has ended with exit code {code}: see {self._folder}/{LOG}"

    def stop(self) -> None:
        """End it and keep its flight log; may be called twice."""
        self._end((signal.SIGTERM, signal.SIGKILL))
        work, self._work = self._work, None
        if work is not None:
            self._keep(work)
            shutil.rmtree(work, ignore_errors=True)

    def _end(self, signals: tuple[int, ...]) -> None:
        process, self._process = self._process, None
        if process is None:
            return
        for number in signals:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, number)
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(_GRACE_S)
                break

    def _keep(self, work: Path) -> None:
        """The last flight log; a full disk loses it and nothing else."""
        logs = sorted(work.rglob("*.ulg"), key=lambda path: path.stat().st_mtime)
        if logs and self._folder is not None:
            with contextlib.suppress(OSError):
                shutil.copyfile(logs[-1], self._folder / FLIGHT_LOG)
