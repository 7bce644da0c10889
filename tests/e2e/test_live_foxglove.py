"""A live run served to Foxglove: a client sees it while it flies, on an open and on a closed bus, and may hang."""

import subprocess
import sys

import pytest

from hil.assembly.node_table import SERVICES
from hil.bus.certificates import make_keys
from hil.bus.leaf import OBSERVERS
from hil.recording.foxglove import FoxgloveView
from hil.recording.reader import Recording
from hil.viewer.view import free_port
from tests.unit.hil.viewer.foxglove.foxglove_client import Client
from tests.unit.hil.viewer.foxglove.test_server import CHANNELS

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("real_time")]


def run(out, port, *more):
    """`perch-hil run --live --foxglove` under way."""
    words = ["run", "simple-ii", "--live", "--foxglove", "--foxglove-port", str(port), "--out", str(out), *more]
    return subprocess.Popen(
        [sys.executable, "-m", "hil", *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )


def listening(process, port):
    """Wait until the run says that it is served."""
    assert process.stdout is not None
    for line in process.stdout:
        if f"ws://127.0.0.1:{port}" in line:
            return
    raise AssertionError(f"the run ended: {process.wait()}")


@pytest.mark.parametrize("closed", [False, True])
def test_client_sees_a_live_run_while_it_flies(tmp_path, closed):
    port, more = free_port(), []
    if closed:
        make_keys(tmp_path / "keys", ["hub", *OBSERVERS, *SERVICES])
        more = ["--keys", str(tmp_path / "keys")]
    process = run(tmp_path / "runs", port, *more)
    listening(process, port)
    seen = set()
    with Client(port) as client:
        client.welcome(CHANNELS)
        wanted = {"/perch/truth/vehicle", "/perch/belief", "/perch/vehicle/sent", "/camera/image", "/tf"}
        client.subscribe(*wanted)
        while seen != wanted:
            seen.add(client.data().topic)
    output, _ = process.communicate(timeout=200)
    assert process.returncode in (0, 1), output
    (folder,) = (tmp_path / "runs").iterdir()
    assert Recording(folder).complete
    assert {topic for topic, _, _ in FoxgloveView.CHANNELS} <= set(Recording(folder).topics)


def test_hanging_client_changes_nothing_of_the_run(tmp_path):
    port = free_port()
    process = run(tmp_path / "runs", port)
    listening(process, port)
    with Client(port) as client:
        client.welcome(CHANNELS)
        client.subscribe(*client.channels)  # and it reads nothing of all that
        output, _ = process.communicate(timeout=200)
    assert process.returncode in (0, 1), output
    (folder,) = (tmp_path / "runs").iterdir()
    assert Recording(folder).complete and not Recording(folder).missing()
