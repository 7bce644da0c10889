"""Cameras by a GStreamer pipeline: by OpenCV where it was built with GStreamer, else through a pipe of gst-launch-1.0.

The wheel of OpenCV on PyPI has no GStreamer in it.
"""

from __future__ import annotations

import fcntl
import re
import shlex
import shutil
import subprocess
import tempfile
from contextlib import suppress
from fractions import Fraction

import cv2
import numpy as np

from hil.wires import WireError
from hil.wires.camera import Mode, NewestPicture, wait_for_picture
from hil.wires.camera_opencv import OpenCvCapture

PROGRAM = "gst-launch-1.0"
_PIPE = 1 << 20  # bytes: a picture in one piece instead of sixteen


def opencv_has_gstreamer() -> bool:
    """Whether this build of OpenCV reads GStreamer pipelines."""
    return re.search(r"GStreamer:\s*YES", cv2.getBuildInformation()) is not None


def backend() -> str:
    """How pipelines are read here: "opencv" or "pipe". Raises WireError if neither is installed."""
    if opencv_has_gstreamer():
        return "opencv"
    if shutil.which(PROGRAM):
        return "pipe"
    raise WireError(
        "kind gstreamer: this OpenCV was built without GStreamer (opencv-python-headless from PyPI is), and "
        f"{PROGRAM} is not installed; apt install gstreamer1.0-tools gstreamer1.0-plugins-good, or use kind v4l2"
    )


class PipeCapture:
    """Raw mono8 pictures from the standard output of a gst-launch-1.0 process."""

    def __init__(self, pipeline: str, mode: Mode) -> None:
        self._shape = (mode.height, mode.width)
        self._size = mode.height * mode.width
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115 (closed with the process)
        command = [PROGRAM, "-q", *shlex.split(pipeline), "!", *shlex.split(_caps(mode)), "!", "fdsink", "fd=1"]
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            bufsize=self._size,
        )

        assert self._process.stdout is not None
        with suppress(OSError):  # not every user has the right
            fcntl.fcntl(self._process.stdout, fcntl.F_SETPIPE_SZ, _PIPE)

    @property
    def trouble(self) -> str:
        """The last error that GStreamer wrote."""
        with suppress(OSError, ValueError):
            self._errors.seek(0)
            lines = self._errors.read().decode("utf-8", "replace").splitlines()
            errors = [line for line in lines if "ERROR" in line or "WARNING: erroneous" in line]
            return (errors or lines or [""])[-1].strip()
        return ""

    def read(self) -> tuple[np.ndarray, int | None] | None:
        """The next picture, None once the pipeline has ended."""
        assert self._process.stdout is not None
        data = self._process.stdout.read(self._size)
        if len(data) < self._size:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(0.5)  # its errors come after its last picture
            return None
        return np.frombuffer(data, np.uint8).reshape(self._shape), None

    def stop(self) -> None:
        """End the process, and with it the pipe."""
        self._process.terminate()
        try:
            self._process.wait(1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def close(self) -> None:
        """Close the pipe; comes after `stop`."""
        if self._process.stdout is not None:
            self._process.stdout.close()
        self._errors.close()


def open_gstreamer(pipeline: str, mode: Mode, *, arrival_delay_ms: float) -> NewestPicture:
    """The camera at the end of `pipeline`, which is given without a sink. Raises WireError.

    A pipeline that cannot deliver `mode` is refused by GStreamer itself, whose error is quoted.
    """
    how = backend()
    if re.search(r"!\s*(app|fd|fake|auto\w*|file)sink", pipeline):
        raise WireError(f'the pipeline "{pipeline}" ends in a sink: leave it out, the program puts its own there')
    source = f"pipeline {pipeline}"
    if how == "opencv":
        text = f"{pipeline} ! {_caps(mode)} ! appsink drop=1 max-buffers=1 sync=false"
        opened = cv2.VideoCapture(text, cv2.CAP_GSTREAMER)
        if not opened.isOpened():
            raise WireError(f"{source} does not start: try {PROGRAM} {text}")
        capture = OpenCvCapture(opened, stamped=False)
    else:
        capture = PipeCapture(pipeline, mode)
    camera = NewestPicture(capture, mode, source, arrival_delay_ns=round(arrival_delay_ms * 1e6))
    return wait_for_picture(camera, limit_s=10.0)


def _caps(mode: Mode) -> str:
    """Grey pictures of just this size and rate; the rate is the source's own, so no converter may invent pictures."""
    rate = Fraction(mode.rate_hz).limit_denominator(1001)
    frame = f"width={mode.width},height={mode.height},framerate={rate.numerator}/{rate.denominator}"
    return f"videoconvert ! video/x-raw,format=GRAY8,{frame}"
