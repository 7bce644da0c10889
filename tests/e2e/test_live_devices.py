"""Live runs with devices in them: a camera that goes away in the middle, and motion capture over VRPN in the loop."""

import os
import socket
import stat
import sys
import textwrap
import threading
import time

import pytest

from groundcar.motion import board_row
from groundcar.scout.sim import ScoutSim
from hil.assembly.board_motion import hover_start, start_board
from hil.assembly.plan import Plan
from hil.bus.leaf import Bus, BusError, Mailbox
from hil.live.run import fly_live
from hil.live.supervisor import SupervisorError
from hil.recording import provenance
from hil.recording.reader import Recording
from hil.viewer.view import free_port
from hil.wires import WireError
from hil.wires.can import open_can
from scenarios.draw import draw
from scenarios.spec import load
from tests.contract.vrpn_server import VrpnServer

GROUP = "239.74.163.3"
pytestmark = [pytest.mark.slow, pytest.mark.timeout(300), pytest.mark.usefixtures("real_time")]


def fly(tmp_path, rig_text, **options):
    rig = tmp_path / "mine.toml"
    rig.write_text(rig_text)
    names = {"scenario": "simple-i", "rig": str(rig), "policy": None, "camera": None} | options.pop("names", {})
    return fly_live(
        Plan(**names), names, 0, pictures="none", out=tmp_path / "runs", code=provenance.code(),
        progress=lambda now_ns, what: None, **options,
    )  # fmt: skip


def events(run):
    return [(e.message.severity, e.message.source, e.message.text) for e in Recording(run.path).messages(["event"])]


FAKE_GST = """\
    #!{python}
    import pathlib, sys, time
    began = time.monotonic()
    while time.monotonic() - began < 40.0:
        sys.stdout.buffer.write(bytes(1280 * 720))
        sys.stdout.buffer.flush()
        time.sleep(1 / 30)
        if pathlib.Path({flag!r}).exists():
            break
    sys.exit("ERROR: from element /GstPipeline:pipeline0/GstV4l2Src:v4l2src0: Could not read from resource.")
"""


@pytest.mark.live
def test_vehicle_lands_when_the_camera_is_unplugged_in_flight(tmp_path, monkeypatch):
    flag, program = tmp_path / "pulled", tmp_path / "bin" / "gst-launch-1.0"
    program.parent.mkdir()
    program.write_text(textwrap.dedent(FAKE_GST).format(python=sys.executable, flag=str(flag)))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")

    rig = 'title = "a camera behind a pipe"\n[camera]\nkind = "gstreamer"\ndevice = "v4l2src"\n'
    hovered = threading.Event()

    def watch(supervisor):
        state = supervisor.health.get("vehicle_link", {})
        if state and not state.get("safe", True) and not hovered.is_set():  # it is in the air
            hovered.set()
            flag.touch()

    live = fly(tmp_path, rig, watch=watch)
    assert hovered.is_set()
    assert "camera ended with exit code 3: camera: camera pipeline v4l2src is gone" in live.flight.failure
    assert "Could not read from resource" in live.flight.failure
    texts = events(live.flight.run)
    assert any(source == "camera" and severity == "error" and "is gone" in text for severity, source, text in texts)
    assert any("AUTO.LAND" in text for _, _, text in texts)
    recording = Recording(live.flight.run.path)
    assert recording.complete
    assert live.flight.counters["cameras lost"] == 1
    statuses = [e.message for e in recording.messages(["vehicle/status"])]
    assert not statuses[-1].armed


@pytest.mark.parametrize(
    ("rig", "expected"),
    [
        pytest.param(
            '[camera]\nkind = "v4l2"\ndevice = "/dev/video77"',
            "camera ended with exit code 3: .*no camera /dev/video77",
            marks=pytest.mark.live,
        ),
        ('[vehicle]\nkind = "mavlink"\nurl = "udp://:{port}"', "vehicle_link ended with .* 3: .*{port}.* is in use"),
        pytest.param(
            '[groundcar]\nkind = "can"\nchannel = "nocan9"', "car ended with exit code 3: .*CAN socketcan nocan9",
            marks=pytest.mark.live,
        ),
    ],
)  # fmt: skip
def test_missing_device_ends_the_run_before_motion_with_one_line(tmp_path, rig, expected):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("0.0.0.0", 0))
        port = str(other.getsockname()[1])
        with pytest.raises(SupervisorError, match=expected.replace("{port}", port)) as raised:
            fly(tmp_path, 'title = "mine"\n' + rig.replace("{port}", port), names={"camera": None})
    assert "\n" not in str(raised.value)


class Car(threading.Thread):
    """A Scout on its bus, in real time."""

    def __init__(self, group):
        super().__init__(daemon=True)
        scenario = load("simple-ii")
        board = start_board(scenario, draw(scenario, 0))
        self.bus = open_can("udp_multicast", group)
        self.sim = ScoutSim(self.bus, seed=1, pose=(float(board[0]), float(board[1]), float(board[3])))
        self.fastest, self.ended = 0.0, threading.Event()

    def run(self):
        began = time.monotonic_ns()
        while not self.ended.wait(0.004):
            self.sim.step(time.monotonic_ns() - began)
            self.fastest = max(self.fastest, abs(float(self.sim.board_row(0.0, 0.0)[board_row.SPEED])))
        self.bus.close()


@pytest.mark.live
def test_car_on_a_can_bus_is_driven_and_measured_by_simulated_sensors(tmp_path):
    try:
        car = Car(GROUP)
    except WireError as error:
        pytest.skip(f"kind can: {error}")
    car.start()
    rig = f"""
        title = "a car on a bus"
        [groundcar]
        kind = "can"
        interface = "udp_multicast"
        channel = "{GROUP}"
    """
    live = fly(tmp_path, rig, names={"scenario": "simple-ii", "camera": "model"})
    time.sleep(1.5)  # the harness is gone: the car's own watchdog has acted by now
    standing = abs(float(car.sim.board_row(0.0, 0.0)[board_row.SPEED]))
    car.ended.set()
    car.join()
    texts = events(live.flight.run)
    assert live.flight.failure == "", texts[-6:]
    assert any(text == "stage attempt" for _, _, text in texts)
    boards = [e.message for e in Recording(live.flight.run.path).messages(["truth/board"])]
    assert max(b.speed for b in boards) > 0.3
    assert car.fastest > 0.3
    assert standing < 0.05


class TruthStream(threading.Thread):
    """Streams the true poses of vehicle and board over VRPN, taken from the bus of a live run."""

    def __init__(self, server, endpoint, names):
        super().__init__(daemon=True)
        scenario = load(names)
        drawn = draw(scenario, 0)
        x, y = hover_start(scenario, drawn, 1.0)[:2]
        board = start_board(scenario, drawn)
        self.server, self.endpoint = server, endpoint
        self.poses = {
            "quad": ((x, y, 0.0), (1.0, 0.0, 0.0, 0.0)),
            "board": ((float(board[0]), float(board[1]), 1.5), (1.0, 0.0, 0.0, 0.0)),
        }
        self.ended = threading.Event()

    def run(self):
        bus, mailbox, count = None, Mailbox(), 0
        while not self.ended.wait(0.008):
            if bus is None:
                try:
                    bus = Bus(self.endpoint, timeout_s=0.5)
                    bus.subscribe("status", ["truth/vehicle", "truth/board"], mailbox)
                except BusError:
                    bus = None
            for delivery in mailbox.drain():
                name = "quad" if delivery.topic == "truth/vehicle" else "board"
                self.poses[name] = (delivery.message.position, delivery.message.orientation)
            count += 1
            shake = 1e-5 * (count % 2)  # a real system never sends the same pose twice
            self.server.send_poses({n: ((p[0] + shake, *p[1:]), (*q[1:], q[0])) for n, (p, q) in self.poses.items()})
        if bus is not None:
            bus.close()
        mailbox.close()


@pytest.mark.live
def test_vrpn_poses_reach_the_referee_the_car_and_the_autopilot(tmp_path):
    pytest.importorskip("motioncapture", reason="kind vrpn: the package motioncapture is not installed")
    server = VrpnServer()
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    stream = TruthStream(server, endpoint, "simple-i")
    stream.start()
    rig = f"""
        title = "motion capture over VRPN"
        [vehicle]
        external_pose = true
        [mocap]
        kind = "vrpn"
        server = "127.0.0.1:{server.port}"
        vehicle_body = "quad"
        delay_ms = 8.0
    """
    try:
        live = fly(tmp_path, rig, endpoint=endpoint, names={"camera": "model"})
    finally:
        stream.ended.set()
        stream.join()
        server.close()
    texts = events(live.flight.run)
    assert live.flight.failure == "", texts[-6:]
    assert any(text == "stage attempt" for _, _, text in texts)
    recording = Recording(live.flight.run.path)
    seen = [e.message for e in recording.messages(["mocap/vehicle"])]
    assert len(seen) > 500
    assert any(e.message.outcome != "ongoing" for e in recording.messages(["referee/contact"])), "the referee judged"
