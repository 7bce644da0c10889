"""Damaged pictures, and drivers that report no rate: a camera is lost by its age limit only."""

import time

import cv2
import numpy as np
import pytest

from hil.wires import WireError
from hil.wires.camera import Damaged, NewestPicture, measured_rate
from hil.wires.camera_opencv import OpenCvCapture, check_rate, set_mode
from tests.contract.camera_makers import MODE, MS, picture
from tests.contract.test_camera_troubles import FakeDevice, Scripted, opened


class Device:
    """A VideoCapture: `frames` holds pictures, None for one that cannot be decoded, or an exception."""

    def __init__(self, *frames):
        self.frames, self.now = list(frames), None

    def grab(self):
        self.now = self.frames.pop(0) if self.frames else "gone"
        return not isinstance(self.now, str)

    def retrieve(self):
        if isinstance(self.now, Exception):
            raise self.now
        return self.now is not None, self.now

    def get(self, what):
        return 0.0

    def release(self):
        pass


def test_damaged_picture_differs_from_a_lost_device():
    capture = OpenCvCapture(Device(picture(1), None, cv2.error("bad JPEG"), np.zeros((0, 0), np.uint8)), stamped=False)
    first = capture.read()
    assert isinstance(first, tuple)
    assert np.array_equal(first[0], picture(1))
    assert [type(capture.read()) for _ in range(3)] == [Damaged] * 3
    assert capture.read() is None


def test_damaged_picture_is_counted_and_the_camera_continues():
    camera = opened(Scripted((picture(0), None), Damaged("cut"), (picture(1), None), then=(picture(2), None)))
    until = time.monotonic() + 5.0
    while camera._count < 3 and time.monotonic() < until:
        time.sleep(0.001)
    assert (camera.lost, camera.damaged) == ("", 1)
    assert camera.take(0) is not None
    camera.close()


def test_camera_with_damaged_pictures_only_is_lost_after_the_age_limit():
    clock = [0]
    camera = opened(Scripted((picture(0), None), then=Damaged("cut")), clock=lambda: clock[0])
    until = time.monotonic() + 5.0
    while camera.damaged < 3 and time.monotonic() < until:
        time.sleep(0.001)
    assert camera.lost == ""
    clock[0] = 1_100 * MS
    assert "no picture for 1 s" in camera.lost
    assert "damaged ones came" in camera.lost
    camera.close()


@pytest.mark.parametrize("rate", [0.0, float("nan"), -1.0])
def test_camera_driver_that_reports_no_rate_is_accepted(rate):
    assert set_mode(FakeDevice(), "/dev/video0", MODE, "MJPG") is True
    assert set_mode(FakeDevice(rate=rate), "/dev/video0", MODE, "MJPG") is False
    with pytest.raises(WireError, match="grants 640x240"):
        set_mode(FakeDevice(rate=rate, width=640), "/dev/video0", MODE, "MJPG")


class Paced(Scripted):
    """Gives a picture each `period_s`."""

    def __init__(self, period_s):
        super().__init__()
        self.period_s = period_s

    def read(self):
        time.sleep(self.period_s)
        return picture(0), None


def test_camera_with_a_wrong_measured_rate_is_refused():
    camera = NewestPicture(Paced(0.1), MODE, "paced", arrival_delay_ns=0)
    assert measured_rate(camera) == pytest.approx(10.0, rel=0.15)
    with pytest.raises(WireError, match=r"reports no rate and delivers \d+\.\d Hz, asked for was 320x240 at 50 Hz"):
        check_rate(camera, "/dev/video0", MODE)
    camera = NewestPicture(Paced(0.1), MODE._replace(rate_hz=10.0), "paced", arrival_delay_ns=0)
    check_rate(camera, "/dev/video0", camera.mode._replace(rate_hz=measured_rate(camera)))
    camera.close()
