"""The checklist's camera and motion capture items on kinds that are no simulation: a recording, a VRPN server."""

import math
import time
from dataclasses import replace

import numpy as np
import pytest

from groundcar.board.layout import Board, rotation_from_car
from hil.assembly.rig import CameraSlot, MocapSlot
from hil.bench import mocap as bench_mocap
from hil.bench.reading import Unavailable
from hil.check.catalogue import checks
from hil.check.checklist import load_checklist
from hil.check.judge import Outcome, judge
from hil.contract.messages import Image, VehicleState
from hil.recording.foxglove import FoxgloveView
from hil.recording.recorder import Recorder
from hil.wires.mocap_vrpn import BodyPose
from kernel.rotations import from_euler, from_matrix, rotate
from tests.unit.hil.check.made_up import context as make_context
from vehicle.camera.pinhole import Camera
from vehicle.render.pose import motion_row
from vehicle.render.renderer import Renderer
from vehicle.render.sensor import Sensor

MS = 1_000_000
HEIGHT = 1.5
DISTANCE = 2.0
ITEMS = {
    item.check: item for group in load_checklist("preflight").group for item in group.item if item.check in checks()
}


@pytest.fixture(scope="module")
def stand(tmp_path_factory):
    """Twelve pictures of the board at 65 deg from 2 m at 30 Hz, and the vehicle's attitude: nose down by 5 deg."""
    folder = tmp_path_factory.mktemp("stand")
    inclination, pitch = math.radians(65.0), math.radians(5.0)
    context = make_context(folder)
    tilt = math.radians(context.airframe.camera.tilt_deg)
    tilt += context.drawn.camera_tilt_offset
    camera = Camera(offset=context.airframe.camera.offset, tilt=tilt)
    attitude = from_euler(0.0, pitch, 0.0)
    look = tilt + pitch  # below the horizon
    mount = rotate(attitude, *camera.offset)
    centre = (0.0, 0.0, HEIGHT)
    back = (-math.cos(look), 0.0, math.sin(look))
    position = tuple(c + DISTANCE * b - m for c, b, m in zip(centre, back, mount, strict=True))
    board = motion_row(centre, from_matrix(rotation_from_car(0.0, inclination)))
    renderer = Renderer(camera, Board(size=context.scenario.board.size), 1, Sensor())
    view = FoxgloveView(pictures="raw")
    with Recorder(folder / "run.mcap", topics=["camera/image", "mocap/vehicle"], view=view) as tap:
        for k in range(12):
            stamp = k * 33_333_333
            pixels = renderer.render(motion_row(position, attitude), board, 2 * MS, k)
            height, width = pixels.shape
            tap(stamp, "mocap/vehicle", VehicleState(stamp, position, (0.0,) * 3, attitude, (0.0,) * 3))
            tap(stamp + 16 * MS, "camera/image", Image(stamp, width, height, 2 * MS, pixels.tobytes(), k))
    return folder


def with_rig(tmp_path, **slots):
    context = make_context(tmp_path)
    return replace(context, rig=context.rig.model_copy(update=slots), _kept={})


@pytest.fixture(scope="module")
def context(stand, tmp_path_factory):
    slot = CameraSlot(kind="mcap", device=str(stand))
    return with_rig(tmp_path_factory.mktemp("out"), camera=slot)


def result(context, name, **args):
    item, known = ITEMS[name], checks()[name]
    return judge(known.function(context, **{**item.args, **args}), item.limits, known.unit)


@pytest.mark.parametrize(
    "name", ["camera.mode", "camera.decode", "camera.distance", "camera.layout", "camera.contrast", "board.inclination"]
)
def test_recorded_pictures_pass_every_camera_item(context, name):
    judged = result(context, name)
    assert judged.outcome in (Outcome.PASS, Outcome.MARGINAL), judged


def test_bench_measures_the_values_set_in_the_simulation(context):
    bench = context.camera()
    seen = bench.measure_board(DISTANCE)
    assert len(seen) == 10
    assert {s.pose.found for s in seen} == {True}
    assert np.mean([s.distance for s in seen]) == pytest.approx(DISTANCE, abs=0.02)
    assert np.mean([s.inclination for s in seen]) == pytest.approx(65.0, abs=1.0), "the attitude is the recording's"
    assert bench.mode[2] == pytest.approx(30.0, rel=0.02)
    assert "vehicle's attitude as recorded" in bench.source


def test_camera_item_fails_on_a_board_at_another_angle_or_distance(context):
    bench = context.camera()
    bench.set_deg -= 10.0
    try:
        assert result(context, "board.inclination").outcome is Outcome.FAIL
    finally:
        bench.set_deg += 10.0
    assert result(context, "camera.distance", distance=2.5).outcome is Outcome.FAIL


def test_a_recording_without_pictures_is_unknown(tmp_path):
    with Recorder(tmp_path / "run.mcap", topics=["mocap/vehicle"]):
        pass
    context = with_rig(tmp_path, camera=CameraSlot(kind="mcap", device=str(tmp_path)))
    with pytest.raises(Unavailable, match="holds no pictures"):
        result(context, "camera.decode")


# motion capture


class FakeVrpn:
    """A server that streams the vehicle at 100 Hz, 8 ms old, for as long as `streams`."""

    streams = True

    def __init__(self, server, bodies, delay_ns):
        self.bodies, self.delay_ns, self.start, self.count = bodies, delay_ns, time.monotonic_ns(), 0

    def wait_for_bodies(self):
        return self

    def take(self, now_ns):
        due = (time.monotonic_ns() - self.start) // (10 * MS)
        poses = []
        while self.streams and self.count < due:
            self.count += 1
            age = time.monotonic_ns() - self.start - self.count * 10 * MS + self.delay_ns
            poses.append(BodyPose(self.bodies[0], age, (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)))
        return poses

    def close(self):
        pass


@pytest.fixture
def vrpn(tmp_path, monkeypatch):
    monkeypatch.setattr(bench_mocap, "VrpnMocap", FakeVrpn)
    return with_rig(tmp_path, mocap=MocapSlot(kind="vrpn", server="here", delay_ms=8.0))


def test_motion_capture_rate_and_age_are_measured(vrpn):
    report = vrpn.mocap()
    assert report.rate_hz == pytest.approx(100.0, abs=10.0)
    assert report.age_ms > 10.0
    assert "VRPN from here; 8 ms of the age are the rig's setting" in report.source


def test_motion_capture_that_is_silent_is_unknown(vrpn, monkeypatch):
    monkeypatch.setattr(FakeVrpn, "streams", False)
    with pytest.raises(Unavailable, match="sent nothing in a second"):
        vrpn.mocap()
