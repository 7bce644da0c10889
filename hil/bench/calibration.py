"""A camera's calibration from files of pictures, as the table of a rig."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from vehicle.camera.calibrate import Calibrated, CalibrationError, View, calibrate, find_corners

PICTURES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".pgm")
GOOD_RMS, GOOD_COVERAGE = 0.5, 0.6  # px, share of the picture


@dataclass
class Seen:
    """What was found in the pictures. `unseen`: names of those without the board; `size`: width and height, px."""

    size: tuple[int, int]
    views: list[View] = field(default_factory=list)
    unseen: list[str] = field(default_factory=list)


def look(paths: Iterable[Path]) -> Seen:
    """Look for the ChArUco board in pictures, and folders of them.

    Raises CalibrationError for what is no picture, for none at all, and for pictures of different sizes.
    """
    seen: Seen | None = None
    for path, pixels in _read(paths):
        size = (pixels.shape[1], pixels.shape[0])
        seen = seen or Seen(size)
        if size != seen.size:
            others = "x".join(map(str, seen.size))
            raise CalibrationError(f"{path} is of {size[0]}x{size[1]}, the others of {others}: one camera, one size")
        view = find_corners(pixels)
        if view is None:
            seen.unseen.append(path.name)
        else:
            seen.views.append(view)
    if seen is None:
        raise CalibrationError(f"there is no picture in {', '.join(map(str, paths))}: {', '.join(PICTURES)} are read")
    return seen


def solve(seen: Seen, model: str) -> Calibrated:
    """The calibration of distortion `model`. Raises CalibrationError where the pictures do not determine it."""
    return calibrate(seen.views, seen.size, model)


def table(done: Calibrated) -> str:
    """The rig's `[camera.calibration]` as TOML, with what is known of its quality."""
    fx, fy, cx, cy = done.sigma
    numbers = "\n".join(f"{name} = {getattr(done, name):.3f}" for name in ("fx", "fy", "cx", "cy"))
    return (
        f"# {done.views} pictures, {done.corners} corners: reprojection error {done.rms:.3f} px (rms), coverage "
        f"{100 * done.coverage:.0f} % of the picture\n"
        f"# one-sigma (px): fx {fx:.3f}, fy {fy:.3f}, cx {cx:.3f}, cy {cy:.3f}\n"
        f"[camera.calibration]\nwidth = {done.width}\nheight = {done.height}\n{numbers}\n"
        f'model = "{done.lens.model}"\n'
        f"distortion = [{', '.join(f'{k:.8g}' for k in done.lens.coefficients)}]\n"
    )


def doubts(done: Calibrated) -> list[str]:
    """Why the calibration is not good, a line each; empty if it is."""
    found = []
    if done.rms > GOOD_RMS:
        found.append(
            f"reprojection error {done.rms:.2f} px is above {GOOD_RMS}: "
            "a flat board, sharp pictures, or another --model"
        )
    if done.coverage < GOOD_COVERAGE:
        found.append(
            f"corners cover {100 * done.coverage:.0f} % of the picture, below {100 * GOOD_COVERAGE:.0f} %: "
            "more pictures with the board at the edges"
        )
    return found


def _read(paths: Iterable[Path]) -> Iterator[tuple[Path, np.ndarray]]:
    """Each picture as grey values."""
    for path in paths:
        inner = sorted(file for file in path.iterdir() if file.suffix.lower() in PICTURES) if path.is_dir() else [path]
        for file in inner:
            try:
                data = np.frombuffer(file.read_bytes(), np.uint8)
            except OSError as error:
                raise CalibrationError(f"{file}: cannot be read: {error.strerror}") from None
            pixels = cv2.imdecode(data, cv2.IMREAD_GRAYSCALE) if data.size else None
            if pixels is None:
                raise CalibrationError(f"{file}: is no picture")
            yield file, pixels
