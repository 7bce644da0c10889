"""The supervisor: who ended is named with its last words, nobody survives it, left-over memory is removed."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hil.supervisor import Process, Supervisor, SupervisorError, remove_orphaned_memory


def process(tmp_path, code):
    return Process("brain", [sys.executable, "-c", code], tmp_path / "brain.log")


def wait_for(condition, limit_s=10.0):
    until = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def test_an_exit_is_told_with_the_last_words(tmp_path):
    one = process(tmp_path, "import sys; print('perch-hil: no camera'); sys.exit(3)")
    wait_for(lambda: one.ended() is not None)
    assert one.why() == "brain ended with exit code 3: no camera"


def test_a_kill_is_told_by_its_signal(tmp_path):
    one = process(tmp_path, "import time; time.sleep(60)")
    os.kill(one.pid, signal.SIGKILL)
    wait_for(lambda: one.ended() is not None)
    assert one.why() == "brain was killed by SIGKILL"


def test_who_does_not_listen_is_killed(tmp_path):
    ready = tmp_path / "ready"
    code = f"import signal, time, pathlib; signal.signal(15, signal.SIG_IGN); pathlib.Path({str(ready)!r}).touch()\n"
    one = process(tmp_path, code + "while True: time.sleep(1)")
    wait_for(ready.exists)
    assert one.end(0.1) == "brain had to be stopped with SIGKILL"
    assert one.ended() == -signal.SIGKILL


def test_a_stopped_process_is_killed_too(tmp_path):
    one = process(tmp_path, "import time; time.sleep(60)")
    os.kill(one.pid, signal.SIGSTOP)
    assert one.end(0.1) == "brain had to be stopped with SIGKILL"


def test_a_hub_that_cannot_start_is_named(tmp_path):
    spec = tmp_path / "spec.json"
    spec.write_text("{}")
    with Supervisor(spec, "tcp/127.0.0.1:1", tmp_path) as supervisor:
        supervisor.start("hub")
        with pytest.raises(SupervisorError, match=r"hub ended with exit code .*spec"):
            supervisor.connect(limit_s=60.0)


@pytest.mark.skipif(not Path("/dev/shm").is_dir(), reason="no /dev/shm")
def test_only_memory_that_nobody_holds_is_removed():
    began = time.time() - 1.0
    orphan, held = Path(f"/dev/shm/{os.getpid()}1.zenoh"), Path(f"/dev/shm/{os.getpid()}2.zenoh")
    holder = None
    try:
        for path in (orphan, held):
            path.write_bytes(bytes(4096))
        code = (
            "import mmap, sys, time; f = open(sys.argv[1], 'r+b'); m = mmap.mmap(f.fileno(), 4096); print(flush=True)\n"
        )
        holder = subprocess.Popen(
            [sys.executable, "-c", code + "time.sleep(60)", str(held)], stdout=subprocess.PIPE, text=True
        )
        assert holder.stdout is not None
        holder.stdout.readline()
        assert orphan.name in remove_orphaned_memory(began)
        assert held.exists()
        assert not orphan.exists()
    finally:
        if holder is not None:
            holder.kill()
            holder.communicate()
        for path in (orphan, held):
            path.unlink(missing_ok=True)
