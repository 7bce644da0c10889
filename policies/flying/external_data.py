"""Finds tensors of an ONNX model that keep their numbers in another file ("external data" of the ONNX format).

The model's file is read as protobuf messages of onnx.proto (field numbers below), without the package onnx, which only
training needs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5  # protobuf's wire types
# Message -> field number -> message, for every way from a model to a tensor.
_INNER: Mapping[str, Mapping[int, str]] = {
    "model": {7: "graph", 20: "training", 25: "function"},
    "training": {1: "graph", 2: "graph"},
    "function": {7: "node", 11: "attribute"},
    "graph": {1: "node", 5: "tensor", 15: "sparse"},
    "node": {5: "attribute"},
    "attribute": {5: "tensor", 6: "graph", 10: "tensor", 11: "graph", 22: "sparse", 23: "sparse"},
    "sparse": {1: "tensor", 2: "tensor"},
    "tensor": {},
}
_EXTERNAL_DATA, _DATA_LOCATION = 13, 14  # of a tensor; the second is 1 for data in another file
_KEY, _VALUE = 1, 2  # of an entry of the first
_DEEPEST = 64  # messages inside each other


def external_files(model: bytes) -> list[str]:
    """Names of the files outside `model` (an ONNX file's bytes) that hold numbers of it, sorted; none: [].

    A file that the model does not name is called "?". Raises ValueError for bytes that are no protobuf message.
    """
    return sorted(set(_files(memoryview(model), "model", 0)))


def _files(data: memoryview, kind: str, depth: int) -> Iterator[str]:
    if depth > _DEEPEST:
        raise ValueError(f"messages are nested more than {_DEEPEST} deep")
    outside, named = False, ""
    for number, value in _fields(data):
        if kind == "tensor":
            if number == _DATA_LOCATION:
                outside |= value == 1
            elif number == _EXTERNAL_DATA and isinstance(value, memoryview):
                entry = dict(_fields(value))
                outside = True
                if _text(entry.get(_KEY)) == "location":
                    named = _text(entry.get(_VALUE))
        elif number in _INNER[kind] and isinstance(value, memoryview):
            yield from _files(value, _INNER[kind][number], depth + 1)
    if outside:
        yield named or "?"


def _text(value: int | memoryview | None) -> str:
    return bytes(value).decode(errors="replace") if isinstance(value, memoryview) else ""


def _fields(data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """(field number, number or content) of each field of one message; fields of fixed size count as content."""
    at = 0
    while at < len(data):
        tag, at = _varint(data, at)
        number, wire = tag >> 3, tag & 7
        if wire == _VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if wire == _BYTES:
            size, at = _varint(data, at)
        elif wire in (_FIXED64, _FIXED32):
            size = 8 if wire == _FIXED64 else 4
        else:
            raise ValueError(f"wire type {wire} at byte {at}")
        if at + size > len(data):
            raise ValueError(f"a field of {size} bytes is cut off at byte {at}")
        yield number, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    """(number, place after it)."""
    value = shift = 0
    while True:
        if at >= len(data) or shift > 63:
            raise ValueError(f"a number is cut off at byte {at}")
        byte = data[at]
        value, shift, at = value | (byte & 0x7F) << shift, shift + 7, at + 1
        if byte < 0x80:
            return value, at
