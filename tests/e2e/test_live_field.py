"""The rig field, everything real but the devices themselves: no simulated node is left in the harness's processes.

The camera shows nothing, so that the attempt ends at its time limit; what is tried is the whole way there and back.
"""

import json
import os
import socket
import stat
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from hil.assembly.node_table import node_names
from hil.assembly.plan import Plan
from hil.assembly.rig import RIG_DIR, load_rig
from hil.live.run import fly_live
from hil.recording import provenance
from hil.recording.reader import Recording
from hil.wires import WireError
from hil.wires.can import open_can

pytestmark = [pytest.mark.live, pytest.mark.slow, pytest.mark.timeout(300)]
PROGRAM = Path(__file__).parent / "field_world.py"
GROUP = "239.74.163.2"

BLIND = """\
    #!{python}
    import sys, time
    while True:
        sys.stdout.buffer.write(bytes(1280 * 720))
        sys.stdout.buffer.flush()
        time.sleep(1 / 30)
"""


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """The rig field, with the addresses of this test."""
    pytest.importorskip("motioncapture", reason="kind vrpn: the package motioncapture is not installed")
    try:
        open_can("udp_multicast", GROUP).close()
    except WireError as error:
        pytest.skip(f"kind can: {error}")
    program = tmp_path / "bin" / "gst-launch-1.0"
    program.parent.mkdir()
    program.write_text(textwrap.dedent(BLIND).format(python=sys.executable))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    world = subprocess.Popen(
        [sys.executable, str(PROGRAM), str(port), GROUP, "simple-i"], stdout=subprocess.PIPE, text=True
    )
    text = (RIG_DIR / "field.toml").read_text()
    for before, after in (
        ("serial:///dev/ttyACM0?baud=921600", f"udp://:{port}"),
        ('"socketcan"', '"udp_multicast"'),
        ('"can0"', f'"{GROUP}"'),
        ('"v4l2"', '"gstreamer"'),
        ('"/dev/video0"', '"v4l2src"'),
        ("192.168.1.10", f"127.0.0.1:{json.loads(world.stdout.readline())['vrpn']}"),
    ):
        assert before in text
        text = text.replace(before, after)
    path = tmp_path / "field.toml"
    path.write_text(text)
    yield path, world
    world.kill()
    world.communicate(timeout=20)


def test_rig_with_only_real_links_flies_and_returns(rig, tmp_path):
    path, world = rig
    assert not {"vehicle_device", "car_device"} & set(node_names(load_rig(str(path))))
    names = {"scenario": "simple-i", "rig": str(path), "policy": None, "camera": None}
    live = fly_live(
        Plan(**names), names, 0, pictures="none", out=tmp_path / "runs", code=provenance.code(),
        progress=lambda now_ns, what: None,
    )  # fmt: skip
    world.terminate()
    report = json.loads(world.communicate(timeout=20)[0])
    recording = Recording(live.flight.run.path)
    events = [e.message.text for e in recording.messages(["event"])]
    assert live.flight.failure == "", events[-6:]
    assert live.flight.run.manifest["identity"] == "real"
    assert "stage attempt" in events
    counts = recording.counts()
    for topic in ("mocap/vehicle", "mocap/board", "car/feedback", "car/sent", "vehicle/odometry", "board/detection"):
        assert counts[f"/perch/{topic}"] > 50, topic
    assert not {"/perch/truth/vehicle", "/perch/truth/board"} & {t for t, n in counts.items() if n}
    assert (report["armed"], report["armed_now"]) == (1, False)
    assert report["highest_m"] > 1.0
    assert report["position"][2] < 0.3
