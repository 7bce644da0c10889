import errno
import json
import math
import subprocess
import sys
import textwrap
from pathlib import Path

import cv2
import numpy as np
import pytest
from foxglove_schemas_protobuf.CameraCalibration_pb2 import CameraCalibration
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.PoseInFrame_pb2 import PoseInFrame
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from hil.contract.codec import decode
from hil.contract.messages import BoardState, Event, Image
from hil.recording.foxglove import FoxgloveView, belief_orientation, optical_from_tilt
from hil.recording.reader import Recording
from hil.recording.recorder import Recorder, RecordingError
from tests.paths import ROOT
from tests.unit.hil.recording.recorded_flight import PICTURE, flight, record
from vehicle.camera.pinhole import Camera


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    return record(tmp_path_factory.mktemp("run") / "run.mcap", pictures="preview")


def views(path, topic, kind):
    return [(raw.log_ns, kind.FromString(raw.data)) for raw in Recording(path).raw([topic])]


def rotation(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def test_official_mcap_reader_accepts_the_recording_with_all_checksums(recorded):
    with recorded.open("rb") as file:
        for _ in StreamReader(file, validate_crcs=True).records:
            pass
    with recorded.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        seen = [(c.topic, m.log_time, m.data) for _, c, m in reader.iter_messages()]
    assert summary is not None
    assert summary.statistics.message_count == len(seen)
    ours = [(raw.topic, raw.log_ns, raw.data) for raw in Recording(recorded).raw()]
    assert sorted(ours) == sorted(seen)
    boards = [decode(BoardState, data) for topic, _, data in seen if topic == "/perch/truth/board"]
    assert boards == [message for _, topic, message in flight() if topic == "truth/board"]


def test_pictures_have_chunks_of_their_own(recorded):
    with recorded.open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    topics = {i: c.topic for i, c in summary.channels.items()}
    for chunk in summary.chunk_indexes:
        inside = {topics[i] for i in chunk.message_index_offsets}
        assert ("/camera/image" in inside) == (inside == {"/camera/image"})


def test_equal_messages_give_equal_bytes(recorded, tmp_path):
    again = record(tmp_path / "again.mcap", pictures="preview")
    assert again.read_bytes() == recorded.read_bytes()


def test_transforms_place_vehicle_camera_and_boards(recorded):
    pairs = set()
    for log_ns, message in views(recorded, "/tf", FrameTransforms):
        for t in message.transforms:
            pairs.add((t.parent_frame_id, t.child_frame_id))
            assert t.timestamp.ToNanoseconds() == log_ns
            q = t.rotation
            assert q.w**2 + q.x**2 + q.y**2 + q.z**2 == pytest.approx(1.0)
    assert pairs == {("world", "vehicle"), ("vehicle", "camera"), ("world", "board"), ("world", "board_belief")}


def test_view_topics_are_thinned_to_50_hz(recorded):
    for topic in ("/vehicle/pose", "/board/pose", "/belief/pose"):
        stamps = [log_ns for log_ns, _ in views(recorded, topic, PoseInFrame)]
        assert min(np.diff(stamps)) >= 20_000_000
    assert len(views(recorded, "/vehicle/pose", PoseInFrame)) == 150  # the truth, not motion capture as well


def test_invalid_belief_is_not_shown(recorded):
    assert views(recorded, "/belief/pose", PoseInFrame)[0][0] > 500_000_000


def test_preview_pictures_are_half_size_at_a_low_rate_with_matching_calibration(recorded):
    pictures = views(recorded, "/camera/image", CompressedImage)
    assert min(np.diff([log_ns for log_ns, _ in pictures])) >= 66_000_000
    assert len(pictures) >= 3 * 12
    pixels = cv2.imdecode(np.frombuffer(pictures[0][1].data, np.uint8), cv2.IMREAD_UNCHANGED)
    assert pixels.shape == (360, 640)
    original = np.frombuffer(PICTURE, np.uint8).reshape(720, 1280)
    assert np.abs(cv2.resize(original, (640, 360)).astype(int) - pixels).mean() < 2.0
    calibration = views(recorded, "/camera/calibration", CameraCalibration)[0][1]
    assert (calibration.width, calibration.height) == (640, 360)
    # the full picture's corner, half a pixel outside the first pixel's centre, stays the corner
    camera = Camera()
    for k, c, f in ((0, camera.cx, camera.fx), (4, camera.cy, camera.fy)):
        full = (-0.5 - c) / f
        half = (-0.5 - calibration.K[{0: 2, 4: 5}[k]]) / calibration.K[k]
        assert half == pytest.approx(full, abs=1e-12)


@pytest.mark.parametrize(("mode", "count", "shape"), [("none", 0, None), ("all", 50, (720, 1280))])
def test_picture_modes_other_than_preview_are_recorded(tmp_path, mode, count, shape):
    path = record(tmp_path / "run.mcap", pictures=mode, seconds=1.0)
    pictures = views(path, "/camera/image", CompressedImage)
    assert len(pictures) == count
    if count:
        assert cv2.imdecode(np.frombuffer(pictures[0][1].data, np.uint8), cv2.IMREAD_UNCHANGED).shape == shape


def test_raw_keeps_every_picture_bit_for_bit(tmp_path):
    path = record(tmp_path / "run.mcap", pictures="raw", seconds=0.2)
    images = [e.message for e in Recording(path).messages(["camera/image"])]
    assert images == [message for _, topic, message in flight(0.2) if topic == "camera/image"]
    assert isinstance(images[0], Image)


def test_events_become_log_lines(recorded):
    [(_, log)] = views(recorded, "/log", Log)
    assert (log.level, log.name, log.message) == (Log.WARNING, "director", "the end")


@pytest.mark.parametrize("tilt", [0.0, math.radians(15), 1.0])
def test_the_camera_looks_forward_and_down(tilt):
    r = rotation(optical_from_tilt(tilt))
    assert r[:, 2] == pytest.approx([math.cos(tilt), 0.0, -math.sin(tilt)])  # forward axis, in FLU
    assert r[:, 0] == pytest.approx([0.0, -1.0, 0.0], abs=1e-12)  # right
    assert r[:, 1] == pytest.approx([-math.sin(tilt), 0.0, -math.cos(tilt)])  # down


def test_board_of_the_belief_has_the_normal_of_the_layout():
    heading, inclination = 0.4, math.radians(70)
    normal = rotation(belief_orientation(heading, inclination))[:, 2]
    back = -math.sin(inclination)
    assert normal == pytest.approx([back * math.cos(heading), back * math.sin(heading), math.cos(inclination)])


def test_unrecordable_message_raises_at_once(tmp_path):
    with pytest.raises(RecordingError, match="No such file or directory"):
        Recorder(tmp_path / "missing" / "run.mcap")
    (tmp_path / "run.mcap").write_bytes(b"")
    with pytest.raises(RecordingError, match="File exists"):
        Recorder(tmp_path / "run.mcap")
    with pytest.raises(RecordingError, match="no/such"):
        Recorder(tmp_path / "other.mcap", topics=["no/such"])
    with pytest.raises(ValueError, match="none, preview, all, raw"):
        FoxgloveView(pictures="some")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_full_disk_is_reported(tmp_path, monkeypatch):
    recorder = Recorder(tmp_path / "run.mcap")
    monkeypatch.setattr(recorder._writer, "_file", open("/dev/full", "wb", buffering=0))  # noqa: SIM115, PTH123
    with pytest.raises(RecordingError, match="No space left"):
        for entry in flight(3.0):
            recorder(*entry)


class FullDisk:
    """A file on a disk with room for `room` bytes more."""

    def __init__(self, file, room):
        self.file, self.room = file, room

    def write(self, data):
        taken = data[: self.room]
        if not taken:
            raise OSError(errno.ENOSPC, "No space left on device")
        self.room -= len(taken)
        return self.file.write(taken)

    def __getattr__(self, name):
        return getattr(self.file, name)


@pytest.mark.parametrize("room", [0, 1, 1000, 20_000, 120_000])
def test_recording_on_a_full_disk_keeps_its_whole_chunks(tmp_path, monkeypatch, room):
    path = tmp_path / "run.mcap"
    recorder = Recorder(path)
    monkeypatch.setattr(recorder._writer, "_file", FullDisk(recorder._writer._file, room))
    with pytest.raises(RecordingError, match="No space left"), recorder:
        for entry in flight(20.0):
            recorder(*entry)
    recorder(0, "event", Event(0, "info", "a", "b"))  # nothing more is written, nothing raised
    recorder.close()
    recording = Recording(path)
    assert not recording.complete
    assert [fault for fault in recording.faults if "not finished" not in fault] == []
    messages = list(recording.messages(["truth/board"]))
    assert [entry.log_ns for entry in messages] == list(range(0, 10_000_000 * len(messages), 10_000_000))
    assert len(messages) > 100 or room < 120_000


def test_end_of_a_recording_that_does_not_fit_is_reported(tmp_path, monkeypatch):
    recorder = Recorder(tmp_path / "run.mcap")
    monkeypatch.setattr(recorder._writer, "_file", FullDisk(recorder._writer._file, 10))
    recorder(0, "event", Event(0, "info", "a", "b"))
    with pytest.raises(RecordingError, match="failed at its end: No space left"):
        recorder.close()


@pytest.mark.parametrize(
    "message",
    [
        Image(0, -1, -1, 0, b"", 0),
        Image(0, 1280, 720, 0, b"short", 0),
        Image(2**63 - 1, 640, 480, 2**63 - 1, bytes(640 * 480), 2**63 - 1),
        Image(-(2**63), 2**62, 2**62, -1, b"x", -1),
    ],
)
def test_picture_that_cannot_be_shown_ends_no_recording(tmp_path, message):
    with Recorder(tmp_path / "run.mcap", view=FoxgloveView(pictures="all")) as recorder:
        recorder(0, "camera/image", message)
        recorder(0, "event", Event(0, "info", "a", "b"))
        assert recorder.counts["event"] == 1


def test_counts_are_of_the_contracts_topics(tmp_path):
    with Recorder(tmp_path / "run.mcap", topics=["event", "belief"]) as recorder:
        recorder(0, "event", Event(0, "info", "a", "b"))
        recorder(0, "truth/board", None)  # not asked for: ignored
        assert recorder.counts == {"belief": 0, "event": 1}
    recorder.close()


def test_a_killed_process_loses_at_most_a_second(tmp_path):
    path = tmp_path / "run.mcap"
    code = f"""
        import os, signal, sys
        sys.path.insert(0, {str(ROOT)!r})
        from tests.unit.hil.recording.recorded_flight import flight
        from hil.recording.foxglove import FoxgloveView
        from hil.recording.recorder import Recorder
        from pathlib import Path
        recorder = Recorder(Path({str(path)!r}), view=FoxgloveView(pictures="preview"))
        for now_ns, topic, message in flight(60.0):
            if now_ns >= 4_700_000_000:
                os.kill(os.getpid(), signal.SIGKILL)
            recorder(now_ns, topic, message)
    """
    done = subprocess.run([sys.executable, "-c", textwrap.dedent(code)], cwd=ROOT, check=False)
    assert done.returncode == -9
    recording = Recording(path)
    assert not recording.complete
    assert "not finished" in recording.faults[0]
    for topic in ("truth/board", "belief"):
        entries = list(recording.messages([topic]))
        assert entries[0].log_ns == 0
        assert entries[-1].log_ns >= 3_700_000_000
        assert [e.log_ns for e in entries] == list(range(0, entries[-1].log_ns + 1, 10_000_000))
    assert views(path, "/camera/image", CompressedImage)[-1][0] >= 3_700_000_000


def test_metadata_is_recorded_and_has_no_clock_value(recorded):
    assert json.loads(json.dumps(Recording(recorded).metadata)) == {"perch-hil": {"format": "1", "scenario": "hard-i"}}
