"""The firmware's core: it comes to rest before anything goes on, and a machine that cannot do it is refused."""

import os
import subprocess
import sys

import pytest

from hil.wires import WireError, settled
from hil.wires.settled import IdleCore, SettledServer, SettledWire

BUSY = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(50))
print(flush=True)
until = time.monotonic() + float(sys.argv[2])
while time.monotonic() < until:
    pass
open(sys.argv[3], "w").close()
"""


@pytest.fixture
def core():
    try:
        found = IdleCore()
    except WireError as error:
        pytest.skip(str(error))
    yield found
    found.close()


def work_on(core, seconds, path):
    busy = subprocess.Popen(
        [sys.executable, "-c", BUSY, str(core.core), str(seconds), str(path)], stdout=subprocess.PIPE
    )
    assert busy.stdout.readline()
    return busy


def test_rest_is_when_everything_on_the_core_has_ended(core, tmp_path):
    with work_on(core, 0.3, tmp_path / "done"):
        core.settle()
        assert (tmp_path / "done").exists()


def test_firmware_that_never_rests_is_told(core, tmp_path, monkeypatch):
    monkeypatch.setattr(settled, "REST_S", 0.2)
    with work_on(core, 0.8, tmp_path / "done") as busy:
        with pytest.raises(WireError, match=r"did not come to rest within 0\.2 s"):
            core.settle()
        busy.kill()


def test_the_process_leaves_the_core_and_gets_it_back():
    before = os.sched_getaffinity(0)
    try:
        core = IdleCore()
    except WireError as error:
        pytest.skip(str(error))
    assert os.sched_getaffinity(0) == before - {core.core}
    core.close()
    core.close()
    assert os.sched_getaffinity(0) == before


def test_machine_with_one_core_is_refused(monkeypatch):
    monkeypatch.setattr("hil.wires.settled.os.sched_getaffinity", lambda _: {0})
    with pytest.raises(WireError, match="may use one only"):
        IdleCore()


def test_user_without_real_time_priorities_is_refused(monkeypatch):
    if len(os.sched_getaffinity(0)) < 2:
        pytest.skip("one core")
    monkeypatch.setattr(settled, "_IDLE", "import sys; sys.exit(3)")
    with pytest.raises(WireError, match="run it as root"):
        IdleCore()


class Log:
    """Stands for a wire, a core or a socket: notes what is called."""

    def __init__(self, calls, name):
        self.calls, self.name = calls, name

    def send(self, data):
        self.calls.append((self.name, data))

    sendall = send

    def settle(self):
        self.calls.append("rest")

    def receive(self):
        return [b"x"]


def test_what_is_sent_has_been_processed():
    calls = []
    wire = SettledWire(Log(calls, "sent"), Log(calls, "core"))
    wire.send(b"a")
    wire.send(b"b")
    assert calls == [("sent", b"a"), "rest", ("sent", b"b"), "rest"]
    assert wire.receive() == [b"x"]


def test_step_waits_for_the_start_script_until_it_waits_for_the_clock(monkeypatch):
    """A command that is seen twice waits for the clock; a shell between two commands does not."""
    calls = []
    seen = iter([(), (1,), (2,), (2,), None])
    monkeypatch.setattr(settled, "COMMAND_S", 0.0)
    server = SettledServer("127.0.0.1", 0, Log(calls, "core"), lambda: next(seen))
    server._client = Log(calls, "sent")
    server.send(b"a")  # between two commands, the first, the second, and again
    assert calls == [("sent", b"a")] + 4 * ["rest"]
    server.send(b"b")  # has ended
    server.send(b"c")
    assert calls[5:] == [("sent", b"b"), "rest", "rest", ("sent", b"c"), "rest"]
    server._client = None
    server.close()
