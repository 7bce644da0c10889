"""Key frames: the first and the last picture with a detected board, and the last one before contact."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from typing import cast

import cv2
import numpy as np
from foxglove_schemas_protobuf.CompressedImage_pb2 import CompressedImage
from google.protobuf.message import DecodeError
from markupsafe import Markup

from hil.contract.codec import codec
from hil.contract.messages import Detection, Image
from hil.recording.manifest import board_known_by, nested
from hil.recording.recorder import PICTURES, PREFIX
from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded

_VIEW, _RAW = "/" + PICTURES, PREFIX + PICTURES
_NO_PICTURES = {
    "model": "the camera was a model: there were no pictures",
    "mocap": "the board was known by motion capture: there was no camera",
}
_WIDTH, _QUALITY = 480, 72
_BEFORE_NS, _LATE_NS = 2_000_000_000, 5_000_000_000  # pictures before the attempt; publication after exposure at most
_FULL_WIDTH = 1280  # px, of the pictures that corners are measured in, where the manifest does not tell


@dataclass(frozen=True)
class _Wanted:
    title: str
    stamp_ns: int
    log_ns: int
    detection: Detection | None


def build(recorded: Recorded) -> Section:
    section = Section("frames", "Key frames")
    topic = next((t for t in (_RAW, _VIEW) if t in recorded.recording.topics), "")
    wanted = _choose(recorded, _stamps(recorded, topic)) if topic else []
    if not wanted:
        known = board_known_by(recorded.manifest.get("rig"))
        section.lost.append(("key frames", _NO_PICTURES.get(known, "no picture of the attempt was recorded")))
        return section
    figures = []
    for w in wanted:
        pixels = _picture(recorded, topic, w)
        if pixels is not None:
            figures.append(_figure(recorded, w, pixels))
    section.html(Markup('<div class="frames">{}</div>').format(Markup("").join(figures)))
    return section


def _choose(recorded: Recorded, stamps: list[tuple[int, int]]) -> list[_Wanted]:
    """The pictures to show, of (exposure, publication): recorded ones, as previews are fewer than exposures."""
    exposed = np.array([stamp for stamp, _ in stamps], dtype=np.int64)
    detections = recorded.topics.get("board/detection")
    looked = detections.nanoseconds() if detections else np.empty(0, dtype=np.int64)
    found = detections["found"] > 0 if detections else np.empty(0, dtype=bool)
    seen = np.flatnonzero(np.isin(exposed, looked[found])).tolist()
    names: list[tuple[str, int]] = []
    if seen:
        names += [("first detection", seen[0]), ("last detection", seen[-1])]
    if stamps:
        names.append(("last picture before contact" if recorded.touched else "last picture", len(stamps) - 1))
    titles: dict[int, list[str]] = {}
    for name, index in names:
        titles.setdefault(index, []).append(name)
    wanted = []
    for index in sorted(titles):
        of = np.flatnonzero(looked == exposed[index]).tolist()
        detection = detections.messages[of[-1]] if detections and of else None
        wanted.append(_Wanted(", ".join(titles[index]), *stamps[index], detection))
    return wanted


def _image(data: bytes) -> Image:
    """Our own picture message. Raises CodecError."""
    return cast(Image, codec(Image).decode(data))


def _stamps(recorded: Recorded, topic: str) -> list[tuple[int, int]]:
    """(exposure, publication) of the pictures from two seconds before the attempt to its end, ns."""
    start, end = recorded.window_ns
    start, end = start - _BEFORE_NS, recorded.decided_ns or end
    raws = recorded.recording.raw([topic], start_ns=start, end_ns=end + _LATE_NS)
    stamps = ((_stamp(topic, raw.data), raw.log_ns) for raw in raws)
    return [(stamp, log_ns) for stamp, log_ns in stamps if stamp is not None and start <= stamp <= end]


def _stamp(topic: str, data: bytes) -> int | None:
    try:
        if topic == _VIEW:
            return CompressedImage.FromString(data).timestamp.ToNanoseconds()
        return _image(data).stamp_ns
    except (DecodeError, ValueError):
        return None


def _picture(recorded: Recorded, topic: str, wanted: _Wanted) -> np.ndarray | None:
    for raw in recorded.recording.raw([topic], start_ns=wanted.log_ns, end_ns=wanted.log_ns):
        if _stamp(topic, raw.data) == wanted.stamp_ns:
            return _pixels(topic, raw.data)
    return None


def _pixels(topic: str, data: bytes) -> np.ndarray | None:
    if topic == _VIEW:
        return cv2.imdecode(np.frombuffer(CompressedImage.FromString(data).data, np.uint8), cv2.IMREAD_GRAYSCALE)
    image = _image(data)
    pixels = np.frombuffer(image.data, np.uint8)
    return pixels.reshape(image.height, image.width) if pixels.size == image.height * image.width else None


def _figure(recorded: Recorded, wanted: _Wanted, pixels: np.ndarray) -> Markup:
    height, width = pixels.shape
    known = nested(recorded.manifest, "rig", "camera", "calibration").get("width")
    full = (
        known if isinstance(known, int) and known >= width else max(width, _FULL_WIDTH)
    )  # corners are of the full picture
    shown = (_WIDTH, round(_WIDTH * height / width))
    ok, jpeg = cv2.imencode(
        ".jpg", cv2.resize(pixels, shown, interpolation=cv2.INTER_AREA), [cv2.IMWRITE_JPEG_QUALITY, _QUALITY]
    )
    data = base64.b64encode(jpeg.tobytes()).decode("ascii") if ok else ""
    tags, words = [], "not looked at"
    if wanted.detection is not None:
        d = wanted.detection
        words = f"{len(d.tag_ids)} tags" if d.found else f"not found: {d.reason or 'no reason given'}"
        corners = np.asarray(d.corners_px, dtype=np.float64).reshape(-1, 4, 2) if len(d.corners_px) % 8 == 0 else []
        for quad in corners:
            points = " ".join(f"{x + 0.5:.1f},{y + 0.5:.1f}" for x, y in quad)
            tags.append(Markup('<polygon points="{}"/>').format(points))
    overlay = Markup('<svg viewBox="0 0 {} {}">{}</svg>').format(
        full, round(full * height / width), Markup("").join(tags)
    )
    time = f"{recorded.seconds(wanted.stamp_ns):+.3f} s"
    return Markup(
        '<figure class="frame"><div><img alt="{0}" src="data:image/jpeg;base64,{1}">{2}</div>'
        "<figcaption><b>{0}</b> {3}, {4}</figcaption></figure>"
    ).format(wanted.title, data, overlay, time, words)
