"""Cameras of every kind for the tests, each showing pictures that are known: one maker a kind."""

import os
import shutil
import stat
import sys
import textwrap
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from hil.assembly.cameras import open_camera
from hil.assembly.rig import CameraSlot
from hil.contract.messages import Image
from hil.recording.foxglove import FoxgloveView
from hil.recording.recorder import Recorder
from hil.wires import camera_gstreamer as gst
from hil.wires.camera import Mode, NewestPicture
from hil.wires.camera_mcap import RecordedCamera
from hil.wires.camera_opencv import OpenCvCapture

MS = 1_000_000
MODE = Mode(320, 240, 50.0)
COUNT = 50  # a second: a busy machine may stall for a while


def picture(number):
    """Its brightness grows with its number, which survives every compression."""
    return np.full((MODE.height, MODE.width), 10 + 4 * number, np.uint8)


def number(pixels):
    return round((float(pixels.mean()) - 10.0) / 4.0)


def record(folder, pictures, size=MODE, count=COUNT):
    """A run's recording: picture k is exposed at 1 s + 20k ms, and came 12 ms later."""
    with Recorder(folder / "run.mcap", topics=["camera/image", "event"], view=FoxgloveView(pictures=pictures)) as tap:
        for k in range(count):
            stamp = 1_000 * MS + 20 * k * MS
            image = Image(stamp, size.width, size.height, 2 * MS, picture(k).tobytes(), k)
            tap(stamp + 12 * MS, "camera/image", image)
    return folder / "run.mcap"


# one maker a kind: (folder) -> a camera that shows picture 0 to 49, one each 20 ms


def video_file(folder):
    """The reader of V4L2 devices, on a file."""
    path = str(folder / "film.avi")
    writer = cv2.VideoWriter(path, cv2.VideoWriter.fourcc(*"MJPG"), MODE.rate_hz, (MODE.width, MODE.height), False)
    for k in range(COUNT):
        writer.write(picture(k))
    writer.release()
    capture = OpenCvCapture(cv2.VideoCapture(path), stamped=False, pace_s=0.02)
    return NewestPicture(capture, MODE, path, arrival_delay_ns=12 * MS)


def mcap_raw(folder):
    return RecordedCamera(record(folder, "raw"), MODE)


def mcap_jpeg(folder):
    return RecordedCamera(record(folder, "all").parent, MODE)


FAKE_GST = f"""\
    #!{sys.executable}
    import sys, time
    assert "videoconvert" in sys.argv and sys.argv[-2:] == ["fdsink", "fd=1"], sys.argv
    if "brokensrc" in sys.argv:
        sys.exit("ERROR: pipeline could not be constructed: no element \\"brokensrc\\".")
    for k in range({COUNT}):
        sys.stdout.buffer.write(bytes([10 + 4 * k]) * {MODE.width * MODE.height})
        sys.stdout.buffer.flush()
        time.sleep(0.02)
    sys.stderr.write("ERROR: from element /GstPipeline:pipeline0/GstV4l2Src: Device was unplugged\\n")
"""


def install_fake_gst(tmp_path, monkeypatch):
    """A gst-launch-1.0 that knows one pipeline."""
    program = tmp_path / "bin" / gst.PROGRAM
    program.parent.mkdir()
    program.write_text(textwrap.dedent(FAKE_GST))
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setattr(gst, "opencv_has_gstreamer", lambda: False)


def pipe(folder):
    """The pipe of kind gstreamer, with a stand-in for the program at its other end."""
    return gst.open_gstreamer("fakesrc", MODE, arrival_delay_ms=12.0)


def real_gstreamer(folder):
    if shutil.which(gst.PROGRAM) is None and not gst.opencv_has_gstreamer():
        pytest.skip("kind gstreamer: neither gst-launch-1.0 nor an OpenCV with GStreamer is installed")
    return gst.open_gstreamer("videotestsrc is-live=true num-buffers=50", MODE, arrival_delay_ms=12.0)


def v4l2(folder):
    device = next(iter(sorted(Path("/dev").glob("video*"))), None)
    if device is None:
        pytest.skip("kind v4l2: no camera is plugged in")
    slot = CameraSlot(kind="v4l2", device=str(device), pixel_format="YUYV")
    return open_camera(slot, Mode(640, 480, 30.0))


def take(camera, limit_s=5.0):
    """The next picture by the wall clock."""
    until = time.monotonic() + limit_s
    while time.monotonic() < until:
        found = camera.take(time.monotonic_ns())
        if found is not None:
            return found
        time.sleep(0.001)
    raise AssertionError(f"no picture within {limit_s} s; {camera.lost}")
