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
from hil.recording.manifest import nested
from hil.recording.recorder import PICTURES, PREFIX
from hil.report.drawing.section import Section
from hil.report.recorded.flight import Recorded

_VIEW, _RAW = "/" + PICTURES, PREFIX + PICTURES
_WIDTH, _QUALITY = 480, 72
_FULL_WIDTH = 1280  # px, of the pictures that corners are measured in, where only previews are recorded


@dataclass(frozen=True)
class _Wanted:
    title: str
    stamp_ns: int
    detection: Detection | None


def build(recorded: Recorded) -> Section:
    section = Section("frames", "Key frames")
    topic = next((t for t in (_RAW, _VIEW) if t in recorded.recording.topics), "")
    stamps = _stamps(recorded, topic) if topic else []
    if not stamps:
        source = nested(recorded.manifest, "rig", "camera").get("source")
        why = "the camera was a model: there were no pictures" if source == "model" else "no pictures were recorded"
        section.lost.append(("key frames", why))
        return section
    wanted = _choose(recorded, [stamp for stamp, _ in stamps])
    if not wanted:
        section.lost.append(("key frames", "no recorded picture lies in the attempt"))
        return section
    figures = []
    by_stamp = {w.stamp_ns: w for w in wanted}
    found = {stamp: image for stamp, image in _pictures(recorded, topic, set(by_stamp))}
    for w in wanted:
        if w.stamp_ns in found:
            figures.append(_figure(recorded, w, found[w.stamp_ns]))
    section.html(Markup('<div class="frames">{}</div>').format(Markup("").join(figures)))
    return section


def _choose(recorded: Recorded, stamps: list[int]) -> list[_Wanted]:
    """The pictures to show: recorded ones, as previews are fewer than exposures."""
    start, end = recorded.window_ns
    stamps = [s for s in stamps if start - 2_000_000_000 <= s <= (recorded.decided_ns or end)]
    detections = recorded.topics.get("board/detection")
    by_stamp = {m.stamp_ns: m for m in detections.messages} if detections else {}
    seen = [s for s in stamps if s in by_stamp and by_stamp[s].found]
    names: list[tuple[str, int]] = []
    if seen:
        names += [("first detection", seen[0]), ("last detection", seen[-1])]
    if stamps:
        names.append(("last picture before contact" if recorded.touched else "last picture", stamps[-1]))
    titles: dict[int, list[str]] = {}
    for name, stamp in names:
        titles.setdefault(stamp, []).append(name)
    return [_Wanted(", ".join(titles[s]), s, by_stamp.get(s)) for s in sorted(titles)]


def _image(data: bytes) -> Image:
    """Our own picture message. Raises CodecError."""
    return cast(Image, codec(Image).decode(data))


def _stamps(recorded: Recorded, topic: str) -> list[tuple[int, int]]:
    """(exposure, publication) of every recorded picture, ns."""
    out = []
    for raw in recorded.recording.raw([topic]):
        stamp = _stamp(topic, raw.data)
        if stamp is not None:
            out.append((stamp, raw.log_ns))
    return out


def _stamp(topic: str, data: bytes) -> int | None:
    try:
        if topic == _VIEW:
            return CompressedImage.FromString(data).timestamp.ToNanoseconds()
        return _image(data).stamp_ns
    except (DecodeError, ValueError):
        return None


def _pictures(recorded: Recorded, topic: str, stamps: set[int]) -> list[tuple[int, np.ndarray]]:
    out = []
    for raw in recorded.recording.raw([topic]):
        stamp = _stamp(topic, raw.data)
        if stamp in stamps:
            pixels = _pixels(topic, raw.data)
            if pixels is not None:
                out.append((stamp, pixels))
    return out


def _pixels(topic: str, data: bytes) -> np.ndarray | None:
    if topic == _VIEW:
        return cv2.imdecode(np.frombuffer(CompressedImage.FromString(data).data, np.uint8), cv2.IMREAD_GRAYSCALE)
    image = _image(data)
    pixels = np.frombuffer(image.data, np.uint8)
    return pixels.reshape(image.height, image.width) if pixels.size == image.height * image.width else None


def _figure(recorded: Recorded, wanted: _Wanted, pixels: np.ndarray) -> Markup:
    height, width = pixels.shape
    full = max(width, _FULL_WIDTH)  # previews are half size, corners are of the full picture
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
