"""Cameras by OpenCV's VideoCapture: V4L2 devices (and, by the same reader, video files)."""

from __future__ import annotations

import math
import os
import stat
import time
from pathlib import Path

import cv2
import numpy as np

from hil.wires import WireError
from hil.wires.camera import Damaged, Mode, NewestPicture, grey, measured_rate, wait_for_picture

_MANUAL_EXPOSURE = 1  # V4L2_EXPOSURE_MANUAL
_EXPOSURE_UNIT_S = 1e-4  # of V4L2's exposure_time_absolute
_RATE_TOLERANCE = 0.1  # relative, of a rate that is measured over a second


class OpenCvCapture:
    """A VideoCapture. With `stamped`, the buffer's time stamp is read: the V4L2 backend gives it as position in ms."""

    def __init__(self, capture: cv2.VideoCapture, *, stamped: bool, pace_s: float = 0.0) -> None:
        """`pace_s`: interval of the pictures of a video file, which has no clock of its own."""
        self._capture, self._stamped, self._pace_s = capture, stamped, pace_s
        self.trouble = ""

    def read(self) -> tuple[np.ndarray, int | None] | Damaged | None:
        """The next picture, Damaged if it cannot be decoded, None once the device gives no more."""
        if self._pace_s:
            time.sleep(self._pace_s)
        if not self._capture.grab():
            return None
        try:
            there, frame = self._capture.retrieve()
        except cv2.error as error:  # a cut or damaged JPEG; the device itself still gives pictures
            return Damaged(str(error))
        if not there or frame is None or not frame.size:
            return Damaged("the picture cannot be decoded")
        stamp = round(self._capture.get(cv2.CAP_PROP_POS_MSEC) * 1e6) if self._stamped else None
        return grey(frame), stamp

    def stop(self) -> None:
        """OpenCV has no such call: the next picture, or its own time limit, ends a `read`."""

    def close(self) -> None:
        """Release the device."""
        self._capture.release()


def open_v4l2(
    device: str,
    mode: Mode,
    *,
    pixel_format: str,
    exposure_ms: float,
    arrival_delay_ms: float,
    stamped: bool,
    stamp_offset_ms: float,
) -> NewestPicture:
    """The camera at `device`, in exactly `mode`. Raises WireError with the granted mode, or the reason.

    The exposure is set by hand as well; a camera that has no such control keeps its own, which the checklist measures
    by its contrast.
    """
    _check_device(device)
    capture = cv2.VideoCapture(device, cv2.CAP_V4L2)
    if not capture.isOpened():
        raise WireError(f"{device} cannot be opened as a camera: in use by another program, or no capture device")
    try:
        rate_known = set_mode(capture, device, mode, pixel_format)
    except WireError:
        capture.release()
        raise
    capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, _MANUAL_EXPOSURE)
    capture.set(cv2.CAP_PROP_EXPOSURE, round(exposure_ms * 1e-3 / _EXPOSURE_UNIT_S))
    camera = NewestPicture(
        OpenCvCapture(capture, stamped=stamped),
        mode,
        device,
        arrival_delay_ns=round(arrival_delay_ms * 1e6),
        stamp_offset_ns=round(stamp_offset_ms * 1e6),
    )
    wait_for_picture(camera)
    if not rate_known:
        check_rate(camera, device, mode)
    return camera


def check_rate(camera: NewestPicture, device: str, mode: Mode) -> None:
    """Measure the rate of a camera whose driver does not report it. Raises WireError (and closes it) if it is wrong."""
    rate = measured_rate(camera)
    if abs(rate / mode.rate_hz - 1.0) > _RATE_TOLERANCE:
        camera.close()
        raise WireError(
            f"{device} reports no rate and delivers {rate:.1f} Hz, asked for was {mode}: longer exposure than the rate "
            "allows, or a rate that this camera does not have"
        )


def set_mode(capture: cv2.VideoCapture, device: str, mode: Mode, pixel_format: str) -> bool:
    """Set `mode`; a driver may grant another one. True if it reports its rate, False if that must be measured.

    Raises WireError if it granted another mode.
    """
    code = cv2.VideoWriter.fourcc(*pixel_format)
    for what, value in (
        (cv2.CAP_PROP_FOURCC, code),  # first: sizes and rates depend on it
        (cv2.CAP_PROP_FRAME_WIDTH, mode.width),
        (cv2.CAP_PROP_FRAME_HEIGHT, mode.height),
        (cv2.CAP_PROP_FPS, mode.rate_hz),
        (cv2.CAP_PROP_BUFFERSIZE, 2),
    ):
        capture.set(what, value)
    width, height = (round(capture.get(p)) for p in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT))
    granted = Mode(width, height, capture.get(cv2.CAP_PROP_FPS))
    given = int(capture.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little", signed=False).decode("ascii", "replace")
    rate_known = math.isfinite(granted.rate_hz) and granted.rate_hz > 0.0
    right_rate = not rate_known or abs(granted.rate_hz / mode.rate_hz - 1.0) < 0.01
    same = granted[:2] == mode[:2] and right_rate and given == pixel_format
    if not same:
        raise WireError(
            f"{device} grants {granted} {given}, asked for was {mode} {pixel_format}: "
            f"see `v4l2-ctl -d {device} --list-formats-ext`, and choose a format in the rig or another camera"
        )
    return rate_known


def _check_device(device: str) -> None:
    path = Path(device)
    if not path.exists():
        there = ", ".join(sorted(str(p) for p in Path("/dev").glob("video*"))) or "none"
        raise WireError(f"there is no camera {device}; plugged in now: {there}")
    if not stat.S_ISCHR(path.stat().st_mode):
        raise WireError(f"{device} is no camera device (kind mcap plays recordings back)")
    if not os.access(path, os.R_OK | os.W_OK):
        raise WireError(f"{device} may not be opened by this user; join the group that owns it (often video)")
