"""Motion capture over VRPN: the library's client with a server of that protocol, and the node."""

import math
import socket
import subprocess
import sys
import time

import pytest

from hil.contract.messages import CarFeedback, Stage
from hil.contract.node import Inbox
from hil.nodes.mocap_device import MocapDevice
from hil.wires import WireError
from hil.wires.mocap_vrpn import BodyPose, VrpnMocap
from tests.contract.vrpn_server import VrpnServer
from vehicle.mocap.agreement import BoardSetting

MS = 1_000_000
INCLINED = (0.0, -math.sin(0.4), 0.0, math.cos(0.4))  # x, y, z, w: a board at 46 deg that faces back along x


@pytest.fixture
def server():
    pytest.importorskip("motioncapture", reason="kind vrpn: the package motioncapture is not installed")
    server = VrpnServer()
    yield server
    server.close()


def bodies(t, **more):
    """What the server streams: the vehicle rises at 0.5 m/s, the board drives along x at 2 m/s."""
    return {
        "quad": ((1.0, 2.0, 1.0 + 0.5 * t), (0.0, 0.0, 0.0, 1.0)),
        "board": ((2.0 * t, 0.0, 1.5), INCLINED),
        **more,
    }


class Feeder:
    """Streams at 100 Hz of the wall clock while `until` runs."""

    def __init__(self, server):
        self.server, self.start = server, time.monotonic()

    def until(self, condition, limit_s=10.0, names=("quad", "board")):
        while not condition():
            t = time.monotonic() - self.start
            assert t < limit_s, "not within the limit"
            self.server.send_poses({name: pose for name, pose in bodies(t).items() if name in names})
            time.sleep(0.01)


def client(server, names=("quad", "board")):
    return VrpnMocap(f"127.0.0.1:{server.port}", names, 4 * MS)


def test_mocap_poses_have_an_age_and_wxyz_quaternions(server):
    wire, got = client(server), []
    Feeder(server).until(lambda: got.extend(wire.take(0)) or len(got) > 20)
    assert {pose.body for pose in got} == {"quad", "board"}
    board = next(pose for pose in got if pose.body == "board")
    assert board.orientation == pytest.approx((math.cos(0.4), 0.0, -math.sin(0.4), 0.0), abs=1e-6), "w, x, y, z"
    assert board.position[2] == pytest.approx(1.5)
    assert all(pose.age_ns >= 4 * MS for pose in got)
    quads = [pose.position[2] for pose in got if pose.body == "quad"]
    assert quads == sorted(set(quads)), "each pose once, oldest first"
    assert wire.lost == ""
    wire.close()
    wire.close()


def test_mocap_node_publishes_states_with_measured_motion(server):
    node = MocapDevice(client(server), "quad", "board")
    seen = {"mocap/vehicle": [], "mocap/board": [], "event": []}

    def step():
        inbox = Inbox(node.inputs)
        for out in node.step(time.monotonic_ns(), inbox):
            seen[out.topic].append(out.message)
        return min(len(seen["mocap/vehicle"]), len(seen["mocap/board"])) >= 60

    Feeder(server).until(step)
    node.close()
    # the poll of the library shakes single stamps by up to its 10 ms; their mean is the motion
    vehicle, board = seen["mocap/vehicle"][10:], seen["mocap/board"][10:]
    assert sorted(v.velocity[2] for v in vehicle)[len(vehicle) // 2] == pytest.approx(0.5, abs=0.2)
    assert sorted(b.speed for b in board)[len(board) // 2] == pytest.approx(2.0, abs=0.6)
    assert board[-1].heading == pytest.approx(0.0, abs=1e-6)
    assert [v.stamp_ns for v in vehicle] == sorted(v.stamp_ns for v in vehicle)
    assert node.counters["poses of motion capture rejected"] == 0


def test_silent_server_or_missing_body_is_an_error_before_arming(server):
    with pytest.raises(WireError, match=r"motion capture at 127\.0\.0\.1:\d+ sends nothing for 0\.3 s"):
        client(server).wait_for_bodies(0.3)
    wire = client(server, ("quad", "boat"))
    Feeder(server).until(lambda: wire.received >= {"quad", "board"})
    with pytest.raises(WireError, match=r'does not know the body "boat"; it streams "board", "quad"'):
        wire.wait_for_bodies(0.3)


def test_mocap_wire_is_lost_when_its_server_ends(server):
    wire, got = client(server), []
    Feeder(server).until(lambda: got.extend(wire.take(0)) or len(got) > 4)
    server.drop_clients()
    until = time.monotonic() + 10.0
    while not wire.lost and time.monotonic() < until:
        wire.take(0)
        time.sleep(0.02)
    assert "is silent: no new pose for 1 s" in wire.lost
    wire.close()


def test_process_with_an_open_mocap_wire_ends_with_its_own_exit_code(server):
    program = f"""
from hil.wires.mocap_vrpn import VrpnMocap
wire = VrpnMocap("127.0.0.1:{server.port}", ("quad",), 0)
raise SystemExit(7)
"""
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert ended.returncode == 7, ended.stderr


def test_server_answers_a_client_after_one_that_left_before_its_answer(server):
    with socket.create_server(("127.0.0.1", 0)) as listening, socket.socket(type=socket.SOCK_DGRAM) as asking:
        asking.sendto(f"127.0.0.1 {listening.getsockname()[1]}".encode() + b"\0", ("127.0.0.1", server.port))
        called_back = listening.accept()[0]
        called_back.recv(24, socket.MSG_WAITALL)
        called_back.close()
    wire, got = client(server), []
    Feeder(server).until(lambda: got.extend(wire.take(0)) or len(got) > 4)
    wire.close()


@pytest.mark.parametrize("address", ["no such host.invalid", "127.0.0.1:vrpn", "127.0.0.1:123456"])
def test_invalid_address_raises_at_once(address):
    pytest.importorskip("motioncapture", reason="kind vrpn: the package motioncapture is not installed")
    with pytest.raises(WireError, match="not a HOST or HOST:PORT"):
        VrpnMocap(address, ("a",), 0)


def test_missing_mocap_package_error_names_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "motioncapture", None)
    with pytest.raises(WireError, match=r"needs the Python package motioncapture.*pip install 'perch-hil\[mocap\]'"):
        VrpnMocap("127.0.0.1", ("a", "b"), 0)


class FakeWire:
    """Gives the scripted poses."""

    def __init__(self):
        self.lost, self.poses, self.closed = "", [], False

    def take(self, now_ns):
        poses, self.poses = self.poses, []
        return poses

    def close(self):
        self.closed = True


def fake():
    wire = FakeWire()
    return wire, MocapDevice(wire, "quad", "board")


def step(node, now_ns):
    inbox = Inbox(node.inputs)
    inbox.put("run/stage", Stage(now_ns, "attempt", 1, 1))
    return node.step(now_ns, inbox)


def test_hidden_body_and_its_return_are_reported_once():
    wire, node = fake()
    events = []
    for k in range(100):
        now = k * 10 * MS
        if k < 10 or k >= 60:
            wire.poses = [BodyPose("quad", 2 * MS, (0.0, 0.0, 0.01 * k), (1.0, 0.0, 0.0, 0.0))]
        events += [out.message for out in step(node, now) if out.topic == "event"]
    assert [(e.severity, e.text) for e in events] == [
        ("warning", '"quad" is hidden from motion capture'),
        ("info", '"quad" is seen again'),
    ]
    assert node.counters["times a body was hidden from motion capture"] == 1


def test_invalid_mocap_data_is_counted_and_not_published():
    wire, node = fake()
    wire.poses = [BodyPose("quad", 2 * MS, (math.nan, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))]
    assert step(node, 10 * MS) == []
    assert node.counters["poses of motion capture rejected"] == 1


def test_lost_motion_capture_is_reported_and_ends_the_service():
    wire, node = fake()
    wire.lost = "motion capture at here is silent"
    (out,) = step(node, 10 * MS)
    assert (out.topic, out.message.severity, out.message.text) == ("event", "error", wire.lost)
    assert node.counters["motion capture systems lost"] == 1
    with pytest.raises(WireError, match="is silent"):
        step(node, 12 * MS)


SET = BoardSetting(0.8, 1.5, 25.0)
STANDING = ("board", 2 * MS, (2.0, 0.0, 1.5), (math.cos(0.4), 0.0, -math.sin(0.4), 0.0))


def run(poses, seconds=1.5, stage="prepare", feedback=None, setting=SET):
    """Events of a node that gets the poses of `poses(t)` at 100 Hz, until it raises."""
    wire, events = FakeWire(), []
    node = MocapDevice(wire, "quad", "board", setting)
    for k in range(round(seconds * 100)):
        now = (1000 + 10 * k) * MS
        wire.poses = [BodyPose(*pose) for pose in poses(0.01 * k)]
        inbox = Inbox(node.inputs)
        inbox.put("run/stage", Stage(now, stage, 1, 1))
        if feedback is not None:
            inbox.put("car/feedback", CarFeedback(now, *feedback, "can", 26.0, "", 0))
        try:
            events += [out.message for out in node.step(now, inbox) if out.topic == "event"]
        except WireError as error:
            return [*events, str(error)]
    return events


def test_board_that_is_set_as_the_scenario_says_is_published():
    assert run(lambda t: [STANDING]) == []
    driven = ("board", 2 * MS, None, STANDING[3])
    assert run(lambda t: [(*driven[:2], (2.0 + t, 0.0, 1.5), driven[3])], feedback=(1.0, 0.0)) == []


@pytest.mark.parametrize(
    ("pose", "reason"),
    [
        (((2000.0, 0.0, 1500.0), STANDING[3]), "millimetres"),
        (((2.0, 0.0, 1.5), (1.0, 0.0, 0.0, 0.0)), "inclined by 0 deg"),
        (((2.0, 1.5, 0.0), STANDING[3]), "0.00 m high"),
    ],
)
def test_board_that_is_not_the_one_that_is_set_ends_the_service(pose, reason):
    event, raised = run(lambda t: [("board", 2 * MS, *pose)])
    assert (event.severity, reason in event.text) == ("error", True)
    assert raised == event.text
    assert run(lambda t: [("board", 2 * MS, *pose)], stage="attempt") == [], "too late to refuse"
    assert run(lambda t: [("board", 2 * MS, *pose)], setting=None) == []


@pytest.mark.parametrize(
    ("feedback", "reason"),
    [((-1.0, 0.0), "moves at 1.00 m/s along its heading, the car's wheels at -1.00"), ((0.0, 0.0), "at 0.00")],
)
def test_board_that_does_not_move_as_the_wheels_ends_the_service(feedback, reason):
    moving = lambda t: [(*STANDING[:2], (2.0 + t, 0.0, 1.5), STANDING[3])]  # noqa: E731
    event, _ = run(moving, stage="lead", feedback=feedback)
    assert reason in event.text


def test_pose_stamped_later_than_now_is_reported_once_and_later_ones_are_used():
    wire, node = fake()
    wire.poses = [BodyPose("quad", -3_600_000 * MS, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))]
    (out,) = step(node, 10 * MS)
    assert (out.topic, "later than now" in out.message.text) == ("event", True)
    wire.poses = [BodyPose("quad", -3_600_000 * MS, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))]
    assert step(node, 20 * MS) == []
    wire.poses = [BodyPose("quad", 2 * MS, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0))]
    (out,) = step(node, 30 * MS)
    assert out.topic == "mocap/vehicle"
    assert node.counters["poses of motion capture rejected"] == 2
