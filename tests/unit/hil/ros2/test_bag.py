"""A run as a ROS 2 bag, read back by rosbags and by the MCAP library."""

import json
import math
import struct

import cv2
import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader
from typer.testing import CliRunner

from hil.cli.main import app
from hil.contract import messages as m
from hil.recording.foxglove import FoxgloveView, belief_orientation
from hil.recording.reader import Recording
from hil.recording.recorder import Recorder
from hil.ros2.bag import export, zero_of
from hil.ros2.convert import Converter
from hil.ros2.types import typestore
from kernel.rotations import rotate
from tests.paths import GOLDEN_RUN
from tests.unit.hil.recording.recorded_flight import PICTURE, record
from tests.unit.vehicle.render.camera_scene import BOARD, CAMERA, view
from vehicle.apriltag.detector import BoardDetector
from vehicle.render.renderer import Renderer


def read(bag, topic=None):
    """(time ns, topic, message) of a bag, in its order."""
    with AnyReader([bag], default_typestore=typestore()) as reader:
        chosen = [c for c in reader.connections if topic in (None, c.topic)]
        return [(t, c.topic, reader.deserialize(data, c.msgtype)) for c, t, data in reader.messages(chosen)]


def stamp_ns(header):
    return header.stamp.sec * 10**9 + header.stamp.nanosec


@pytest.fixture(scope="module")
def bag(tmp_path_factory):
    out = tmp_path_factory.mktemp("ros") / "bag"
    export(GOLDEN_RUN, out)
    return out


@pytest.fixture(scope="module")
def kinds(bag):
    with Reader(bag) as reader:
        return {c.topic: c.msgtype for c in reader.connections}


def test_bag_has_the_runs_messages_as_standard_types(bag, kinds):
    counts = Recording(GOLDEN_RUN).counts()
    assert kinds["/truth/vehicle"] == kinds["/vehicle/odometry"] == "nav_msgs/msg/Odometry"
    assert kinds["/tf"] == kinds["/tf_static"] == "tf2_msgs/msg/TFMessage"
    assert kinds["/camera/image_raw/compressed"] == "sensor_msgs/msg/CompressedImage"
    assert kinds["/belief/pose"] == "geometry_msgs/msg/PoseWithCovarianceStamped"
    assert {kind.split("/")[0] for kind in kinds.values()} <= {
        *("sensor_msgs", "geometry_msgs", "nav_msgs", "tf2_msgs", "apriltag_msgs", "std_msgs", "rcl_interfaces")
    }
    found = read(bag)
    for topic in ("/truth/vehicle", "/truth/board", "/vehicle/odometry", "/car/feedback"):
        assert sum(name == topic for _, name, _ in found) == counts[f"/perch{topic}"] > 0, topic
    pictures = sum(name == "/camera/image_raw/compressed" for _, name, _ in found)
    assert pictures == counts["/camera/image"] > 0
    assert [t for t, _, _ in found] == sorted(t for t, _, _ in found)


def test_bag_is_a_whole_mcap_file_for_other_readers(bag):
    with (bag / "bag.mcap").open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert sum(1 for _ in reader.iter_messages()) == summary.statistics.message_count > 1000
        assert {schema.encoding for schema in summary.schemas.values()} == {"ros2msg"}
    assert sorted(path.name for path in bag.iterdir()) == ["bag.mcap", "metadata.yaml"]
    assert [path.name for path in bag.parent.iterdir()] == ["bag"]  # nothing half-written is left


def test_odometry_has_the_pose_in_the_world_and_the_twist_in_the_body(bag):
    recorded = [entry.message for entry in Recording(GOLDEN_RUN).messages(["truth/vehicle"])]
    for (_, _, odometry), state in zip(read(bag, "/truth/vehicle")[::50], recorded[::50], strict=True):
        place, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
        moving, turning = odometry.twist.twist.linear, odometry.twist.twist.angular
        assert (place.x, place.y, place.z) == state.position
        assert (turn.w, turn.x, turn.y, turn.z) == state.orientation
        assert rotate(state.orientation, moving.x, moving.y, moving.z) == pytest.approx(state.velocity)
        assert (turning.x, turning.y, turning.z) == state.body_rate
        assert odometry.header.frame_id == "world" and odometry.child_frame_id == "vehicle"
        assert stamp_ns(odometry.header) == zero_of(GOLDEN_RUN) + state.stamp_ns


def test_times_are_of_the_wall_clock_where_the_folder_tells_it(tmp_path):
    record(tmp_path / "run.mcap", seconds=0.1)
    (tmp_path / "manifest.json").write_text(json.dumps({"wall_clock": {"zero_utc": "2026-01-02T03:04:05.678+00:00"}}))
    export(tmp_path, tmp_path / "bag")
    zero_ns = 1767323045_678_000_000
    assert zero_of(tmp_path) == zero_ns
    first = read(tmp_path / "bag", "/truth/vehicle")[0]
    assert first[0] == stamp_ns(first[2].header) == zero_ns


def test_transforms_make_one_tree_and_the_mount_is_told_once(bag):
    moved = {(t.header.frame_id, t.child_frame_id) for _, _, tf in read(bag, "/tf") for t in tf.transforms}
    assert moved == {("world", "vehicle"), ("world", "board"), ("world", "board_belief")} & moved and moved
    ((_, _, static),) = read(bag, "/tf_static")
    assert [(t.header.frame_id, t.child_frame_id) for t in static.transforms] == [("vehicle", "camera")]
    text = (bag / "metadata.yaml").read_text()
    assert ("/tf_static" in text and "transient_local" in text.lower()) or "durability: 1" in text


@pytest.mark.parametrize(("pictures", "scale"), [("preview", 2), ("raw", 1)])
def test_tags_lie_on_the_picture_in_the_bag(tmp_path, pictures, scale):
    vehicle, board = view(0.8)
    pixels = Renderer(CAMERA, BOARD, 1).render(vehicle, board, 0, 0)
    found = BoardDetector(CAMERA, BOARD).detect(pixels)
    at, turn = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    corners = tuple(found.corners.ravel().tolist())
    with Recorder(tmp_path / "run.mcap", view=FoxgloveView(pictures=pictures)) as recorder:
        recorder(9, "camera/image", m.Image(9, CAMERA.width, CAMERA.height, 0, pixels.tobytes(), 0))
        recorder(12, "board/detection", m.Detection(9, True, at, turn, 0.1, 0.1, found.ids, corners, "", 0, 0))
    export(tmp_path / "run.mcap", tmp_path / "bag")
    by_topic = {topic: one for _, topic, one in read(tmp_path / "bag")}
    seen, info = by_topic["/camera/detections"], by_topic["/camera/camera_info"]
    assert (info.width, info.height, info.distortion_model) == (1280 // scale, 720 // scale, "plumb_bob")
    assert stamp_ns(seen.header) == stamp_ns(info.header) == 9 and seen.header.frame_id == "camera"
    assert tuple(tag.id for tag in seen.detections) == found.ids and found.ids
    if pictures == "raw":
        grey = by_topic["/camera/image_raw"].data.reshape(info.height, info.width)
    else:
        grey = cv2.imdecode(by_topic["/camera/image_raw/compressed"].data, cv2.IMREAD_GRAYSCALE)
    for tag, expected in zip(seen.detections, (found.corners + 0.5) / scale - 0.5, strict=True):
        assert np.array([(p.x, p.y) for p in tag.corners]) == pytest.approx(expected, abs=1e-3)
        to = tag.homography.reshape(3, 3) @ np.array([-1.0, 1.0, 1.0])
        assert to[:2] / to[2] == pytest.approx(expected[0], abs=1e-2)
    # the border of a tag is black, the ring around it white: look a little inside and outside the large one's corners
    large = max(range(len(found.ids)), key=lambda k: np.ptp(found.corners[k]))
    tag, corners = seen.detections[large], (found.corners[large] + 0.5) / scale - 0.5
    centre = np.array((tag.centre.x, tag.centre.y))
    within, out = (centre + f * (corners - centre) for f in (0.93, 1.07))
    dark, light = (np.mean([grey[round(y), round(x)] for x, y in points]) for points in (within, out))
    assert dark + 60 < light


def test_belief_covariance_is_about_the_boards_own_axes():
    variance = (1.0, 2.0, 3.0, 0.4, 0.0, 0.0, 0.5, 0.0, 0.0)
    belief = m.Belief(7, True, (1.0, 2.0, 3.0), math.pi / 2, 2.0, 0.1, 0.6, 0.9, 0, 0, 0, variance, 0.0, 0, 0.0)
    by_topic = {one.topic: one.content for one in Converter(0, False)("belief", belief)}
    found = by_topic["/belief/pose"].pose.covariance.reshape(6, 6)
    assert np.diag(found) == pytest.approx([1.0, 2.0, 3.0, 0.5, 0.0, 0.4])  # heading 90 deg: it inclines about -x
    assert by_topic["/belief/rho"].data == 0.9
    moving = by_topic["/belief/twist"].twist
    assert (moving.linear.x, moving.linear.y) == pytest.approx((0.0, 2.0)) and moving.angular.z == 0.1
    unknown = m.Belief(7, False, (0.0,) * 3, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, (), 0.0, 0, 0.0)
    assert [one.topic for one in Converter(0, False)("belief", unknown)] == ["/belief/rho"]


def test_binary_form_is_cdr_little_endian():
    one = typestore().types["std_msgs/msg/Float64"](data=0.25)
    assert bytes(typestore().serialize_cdr(one, "std_msgs/msg/Float64")) == b"\0\1\0\0" + struct.pack("<d", 0.25)


def test_whole_pictures_are_exported_as_they_are(tmp_path):
    run = record(tmp_path / "run.mcap", pictures="raw", seconds=0.2)
    export(run, tmp_path / "bag")
    found = read(tmp_path / "bag")
    pictures = [one for _, topic, one in found if topic == "/camera/image_raw"]
    assert len(pictures) == 10 and bytes(pictures[0].data) == PICTURE and pictures[0].encoding == "mono8"
    (info, *_) = [one for _, topic, one in found if topic == "/camera/camera_info"]
    assert (info.width, info.k[0], info.k[2]) == pytest.approx((1280, 723.9, 639.5))
    assert not [1 for _, topic, _ in found if topic.endswith("compressed")]
    assert zero_of(tmp_path) == 0 and found[0][0] == 0  # no manifest: the run's own clock


def test_message_that_is_not_finite_is_kept_and_a_damaged_one_left_out(tmp_path):
    nan = m.VehicleState(5, (math.nan, 0.0, math.inf), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
    early = m.Detection(-5, True, (0.0,) * 3, belief_orientation(0.0, 0.0), 0.1, 0.1, (1,), (math.nan,) * 8, "", 0, 0)
    with Recorder(tmp_path / "run.mcap", view=FoxgloveView()) as recorder:
        recorder(5, "truth/vehicle", nan)
        recorder(6, "board/detection", early)
        recorder(7, "camera/image", m.Image(7, 4, -1, 0, b"", 0))
    export(tmp_path / "run.mcap", tmp_path / "bag")
    first = read(tmp_path / "bag", "/truth/vehicle")[0][2].pose.pose.position
    assert math.isnan(first.x) and math.isinf(first.z)


def run_cli(*words):
    return CliRunner().invoke(app, ["runs", "export", *map(str, words)])


def test_command_writes_a_bag_and_refuses_what_it_cannot(tmp_path):
    record(tmp_path / "run.mcap", seconds=0.1)
    done = run_cli(tmp_path / "run.mcap", "--ros2", tmp_path / "bag")
    assert done.exit_code == 0 and "topics" in done.stdout
    again = run_cli(tmp_path / "run.mcap", "--ros2", tmp_path / "bag")
    assert again.exit_code == 2 and "exists already" in again.stderr
    (tmp_path / "no.mcap").write_bytes(b"no recording")
    wrong = run_cli(tmp_path / "no.mcap", "--ros2", tmp_path / "other")
    assert wrong.exit_code == 2 and "no MCAP recording" in wrong.stderr and wrong.stderr.count("\n") == 1
    (tmp_path / "file").write_text("")
    under = run_cli(tmp_path / "run.mcap", "--ros2", tmp_path / "file" / "bag")
    assert under.exit_code in (2, 3) and under.stderr.count("\n") == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ["bag", "file", "no.mcap", "run.mcap"]
