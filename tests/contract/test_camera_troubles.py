"""Time stamps of cameras, and their faults: reported in one line, counted, not raised in flight."""

import time

import cv2
import numpy as np
import pytest

from hil.contract.messages import Image
from hil.recording.foxglove import FoxgloveView
from hil.recording.recorder import Recorder
from hil.wires import WireError
from hil.wires import camera_gstreamer as gst
from hil.wires.camera import NewestPicture, wait_for_picture
from hil.wires.camera_mcap import RecordedCamera
from hil.wires.camera_opencv import open_v4l2, set_mode
from tests.contract.camera_makers import MODE, MS, install_fake_gst, mcap_raw, number, picture, record, take


@pytest.fixture
def fake_gst(tmp_path, monkeypatch):
    install_fake_gst(tmp_path, monkeypatch)


# time stamps


class Scripted:
    """A capture that gives the scripted reads, and then waits, or ends."""

    def __init__(self, *reads, then=None):
        self.reads, self.then, self.trouble, self.closed = list(reads), then, "", False

    def read(self):
        if self.reads:
            return self.reads.pop(0)
        if self.then is not None:
            time.sleep(0.005)
            return self.then
        return None

    def stop(self):
        pass

    def close(self):
        self.closed = True


def opened(capture, mode=MODE, **options):
    return NewestPicture(capture, mode, "scripted", arrival_delay_ns=17 * MS, **options)


def test_exposure_time_is_the_drivers_stamp_or_the_arrival_less_the_delay():
    now = time.monotonic_ns()
    for stamp, least, most in (
        (now - 40 * MS, 37, 2_000),  # stamped 40 ms ago; the middle of the exposure is 3 ms later
        (None, 17, 2_000),
        (now - 3_600_000 * MS, 17, 2_000),  # of another clock
        (now + 10_000 * MS, 17, 2_000),  # from the future
    ):
        camera = opened(Scripted((picture(1), stamp), then=None), stamp_offset_ns=3 * MS)
        found = take(camera)
        assert least * MS <= found.age_ns < most * MS
        assert camera.unstamped == (stamp is None or abs(now - stamp) > 500 * MS)
        camera.close()


def test_the_age_grows_until_the_picture_is_taken():
    clock = [0]
    camera = opened(Scripted((picture(1), None), (picture(1), None), then=None), clock=lambda: clock[0])
    camera._thread.join()
    clock[0] = 30 * MS
    assert camera.take(0).age_ns == 47 * MS
    camera.close()


def test_a_recorded_picture_keeps_its_age_and_its_place_in_time(tmp_path):
    camera = mcap_raw(tmp_path)
    start = 77_000 * MS
    first = camera.take(start)
    assert (number(first.pixels), first.age_ns) == (0, 12 * MS)
    assert camera.take(start + 19 * MS) is None
    second = camera.take(start + 25 * MS)
    assert (number(second.pixels), second.age_ns) == (1, 17 * MS)
    assert number(camera.take(start + 100 * MS).pixels) == 5
    assert camera.dropped == 3


# troubles


def test_a_picture_of_another_size_ends_the_camera():
    camera = opened(Scripted((np.zeros((480, 640), np.uint8), None)))
    camera._thread.join(5.0)
    assert camera.lost == "camera scripted sends 640x480, asked for was 320x240"
    camera.close()
    assert camera._capture.closed


def test_camera_without_pictures_for_a_second_is_lost():
    clock = [0]
    camera = opened(Scripted((picture(0), None), then=(picture(0), None)), clock=lambda: clock[0])
    take(camera)
    camera._closing = True  # the thread stands still: the device hangs
    camera._thread.join(5.0)
    camera._closing = False
    assert camera.lost == ""
    clock[0] = 1_100 * MS
    assert camera.lost == "camera scripted is silent: no picture for 1 s"
    camera.close()


def test_exception_of_a_camera_driver_loses_the_camera_without_raising():
    class Bad(Scripted):
        def read(self):
            raise cv2.error("VIDIOC_DQBUF: No such device")

    camera = opened(Bad())
    camera._thread.join(5.0)
    assert "camera scripted is gone: VIDIOC_DQBUF: No such device" in camera.lost
    camera.close()


def test_a_camera_without_a_first_picture_is_not_opened():
    with pytest.raises(WireError, match="camera scripted is gone"):
        wait_for_picture(opened(Scripted()))


class FakeDevice:
    """A VideoCapture that grants what it likes."""

    def __init__(self, **granted):
        self.values = {
            cv2.CAP_PROP_FRAME_WIDTH: granted.get("width", 320),
            cv2.CAP_PROP_FRAME_HEIGHT: granted.get("height", 240),
            cv2.CAP_PROP_FPS: granted.get("rate", 50.0),
            cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*granted.get("format", "MJPG")),
        }

    def set(self, what, value):
        return True

    def get(self, what):
        return self.values.get(what, 0.0)


@pytest.mark.parametrize(
    ("granted", "expected"),
    [
        ({"width": 640, "height": 480}, "grants 640x480 at 50 Hz MJPG, asked for was 320x240 at 50 Hz MJPG"),
        ({"rate": 30.0}, "grants 320x240 at 30 Hz"),
        ({"format": "YUYV"}, "YUYV, asked for"),
    ],
)
def test_camera_mode_mismatch_error_names_both_modes(granted, expected):
    set_mode(FakeDevice(), "/dev/video0", MODE, "MJPG")
    with pytest.raises(WireError, match=expected):
        set_mode(FakeDevice(**granted), "/dev/video0", MODE, "MJPG")


def test_missing_camera_error_lists_the_present_ones(tmp_path):
    def opening(device):
        open_v4l2(
            str(device), MODE, pixel_format="MJPG", exposure_ms=2.0, arrival_delay_ms=16.0, stamped=True,
            stamp_offset_ms=0.0,
        )  # fmt: skip

    with pytest.raises(WireError, match="there is no camera /dev/video77; plugged in now: "):
        opening("/dev/video77")
    film = tmp_path / "film.avi"
    film.touch()
    with pytest.raises(WireError, match="is no camera device"):
        opening(film)


def test_missing_gstreamer_error_names_the_missing_program(monkeypatch):
    monkeypatch.setattr(gst, "opencv_has_gstreamer", lambda: False)
    monkeypatch.setattr(gst.shutil, "which", lambda _: None)
    with pytest.raises(WireError, match=r"built without GStreamer.*gst-launch-1\.0 is not installed"):
        gst.open_gstreamer("v4l2src", MODE, arrival_delay_ms=1.0)


def test_error_of_a_pipeline_that_does_not_start_quotes_it(fake_gst):
    with pytest.raises(WireError, match='no element "brokensrc"'):
        gst.open_gstreamer("brokensrc", MODE, arrival_delay_ms=1.0)
    with pytest.raises(WireError, match="leave it out"):
        gst.open_gstreamer("v4l2src ! appsink drop=1", MODE, arrival_delay_ms=1.0)


def test_last_error_of_a_pipeline_is_reported(fake_gst):
    camera = gst.open_gstreamer("fakesrc", MODE, arrival_delay_ms=1.0)
    until = time.monotonic() + 5.0
    while not camera.lost and time.monotonic() < until:
        time.sleep(0.01)
    assert "Device was unplugged" in camera.lost
    camera.close()


def test_recording_without_usable_pictures_raises_with_the_reason(tmp_path):
    with pytest.raises(WireError, match="cannot be read"):
        RecordedCamera(tmp_path / "none.mcap", MODE)
    (tmp_path / "empty").mkdir()
    with pytest.raises(WireError, match="holds no pictures: record them with --pictures all"):
        RecordedCamera(record(tmp_path / "empty", "raw", count=0), MODE)
    (tmp_path / "previews").mkdir()
    with pytest.raises(WireError, match="160x120, asked for was 320x240"):
        RecordedCamera(record(tmp_path / "previews", "preview"), MODE)


def test_a_damaged_picture_is_left_out_and_counted(tmp_path):
    with Recorder(tmp_path / "run.mcap", topics=["camera/image", "event"], view=FoxgloveView(pictures="raw")) as tap:
        for k, size in enumerate((MODE.width * MODE.height, 100, MODE.width * MODE.height)):
            tap(k * MS, "camera/image", Image(k * MS, MODE.width, MODE.height, 2 * MS, bytes([50]) * size, k))
    camera = RecordedCamera(tmp_path / "run.mcap", MODE)
    camera.take(0)
    assert camera.take(10 * MS).pixels.mean() == 50
    assert camera.damaged == 1
