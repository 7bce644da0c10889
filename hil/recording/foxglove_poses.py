"""Poses and transforms in Foxglove's schemas, as bytes: two hundred a second, so without protobuf's own classes.

Message and field numbers are those of the package `foxglove-schemas-protobuf`.
"""

from __future__ import annotations

from hil.contract.encoder import Field, encoder, varint
from hil.contract.messages import Quat, Vec3

_FIRST_S, _LAST_S = -62_135_596_800, 253_402_300_799  # of protobuf's times: the years 1 to 9999


def _writer(kind: type, count: int):
    found = encoder([Field(number, kind, None) for number in range(1, count + 1)])
    assert found is not None
    return found


_time, _vector, _quaternion = _writer(int, 2), _writer(float, 3), _writer(float, 4)  # s, ns; x, y, z; x, y, z, w


def transform(stamp_ns: int, parent: str, child: str, translation: Vec3, rotation: Quat) -> bytes:
    """One FrameTransform, as FrameTransforms holds it. Raises ValueError for a time that protobuf does not have."""
    w, x, y, z = rotation
    return _part(
        1,
        _part(1, _stamp(stamp_ns)),
        _part(2, parent.encode()),
        _part(3, child.encode()),
        _part(4, _vector(translation)),
        _part(5, _quaternion((x, y, z, w))),
    )


def pose(stamp_ns: int, position: Vec3, orientation: Quat) -> bytes:
    """A PoseInFrame in the world. Raises ValueError as `transform`."""
    w, x, y, z = orientation
    inner = _part(3, _part(1, _vector(position)), _part(2, _quaternion((x, y, z, w))))
    return b"".join((_part(1, _stamp(stamp_ns)), _part(2, b"world"), inner))


def _stamp(stamp_ns: int) -> bytes:
    seconds, ns = divmod(stamp_ns, 1_000_000_000)
    if not _FIRST_S <= seconds <= _LAST_S:
        raise ValueError(f"a time of {stamp_ns} ns cannot be shown")
    return _time((seconds, ns))


def _part(number: int, *content: bytes) -> bytes:
    """A field that holds bytes: a text or a message."""
    size = sum(map(len, content))
    return b"".join((varint(number << 3 | 2), varint(size), *content))
