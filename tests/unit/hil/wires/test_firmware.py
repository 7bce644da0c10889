"""A PX4 SITL firmware as a process; a script stands for PX4."""

import os
import time
from pathlib import Path

import pytest

from hil.wires import WireError
from hil.wires.firmware import Firmware, check_build

SCRIPT = """#!/bin/sh
echo "started $@"
env | grep '^PX4_' | sort
mkdir -p log/2026-11-27
echo ulog > log/2026-11-27/10_00_00.ulg
pwd > "$WHERE"
exec sleep 60
"""


@pytest.fixture
def build(tmp_path):
    folder = tmp_path / "build"
    (folder / "etc/init.d-posix").mkdir(parents=True)
    (folder / "etc/init.d-posix/rcS").touch()
    (folder / "bin").mkdir()
    (folder / "bin/px4").write_text(SCRIPT)
    (folder / "bin/px4").chmod(0o755)
    return folder


def wait_for(path):
    until = time.monotonic() + 10.0
    while not (path.exists() and path.read_text()):
        assert time.monotonic() < until
        time.sleep(0.02)
    return path.read_text().strip()


def test_firmware_runs_in_a_folder_of_its_own_and_leaves_its_logs(build, tmp_path, monkeypatch):
    monkeypatch.setenv("WHERE", str(tmp_path / "where"))
    monkeypatch.setenv("PX4_PARAM_STRAY", "1")
    run = tmp_path / "run"
    run.mkdir()
    firmware = Firmware(str(build), {"MPC_THR_HOVER": 0.442, "CA_ROTOR_COUNT": 4}, instance=2)
    assert firmware.ended() == ""
    firmware.start(run)
    work = Path(wait_for(tmp_path / "where"))
    assert work != Path.cwd() and firmware.ended() == ""
    firmware.stop()
    firmware.stop()
    assert not work.exists()
    lines = (run / "firmware.log").read_text().splitlines()
    assert lines[0] == f"started -d -i 2 -w {work} {build}/etc"
    assert {"PX4_PARAM_CA_ROTOR_COUNT=4", "PX4_PARAM_MPC_THR_HOVER=0.442", "PX4_SIM_MODEL=none_iris"} <= set(lines)
    assert not any("STRAY" in line for line in lines), "what the shell has set does not fly"
    assert (run / "firmware.ulg").read_text() == "ulog\n"


def test_firmware_that_ends_by_itself_is_told(build, tmp_path):
    (build / "bin/px4").write_text("#!/bin/sh\nexit 3\n")
    firmware = Firmware(str(build), {})
    firmware.start(tmp_path)
    until = time.monotonic() + 10.0
    while not firmware.ended() and time.monotonic() < until:
        time.sleep(0.02)
    assert firmware.ended() == f"the firmware has ended with exit code 3: see {tmp_path}/firmware.log"
    firmware.stop()


def test_folder_without_px4_is_refused(build, tmp_path):
    assert check_build(str(build)) == build
    with pytest.raises(WireError, match=r"no build folder of PX4's SITL: bin/px4 is missing"):
        check_build(str(tmp_path))
    if os.geteuid() != 0:
        (build / "bin/px4").chmod(0o644)
        with pytest.raises(WireError, match="may not be executed"):
            check_build(str(build))
