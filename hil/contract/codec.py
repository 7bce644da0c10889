"""Messages to bytes and back: a protobuf schema derived from each dataclass of `hil/contract/messages.py`.

Fields are numbered in the order they stand, so a field appended later neither breaks an old reader (it skips the
unknown number) nor an old recording (the field reads as zero). int is int64, float is double, a tuple is repeated.
Every bit pattern of a float survives, NaN and infinity included. The schema travels in the recording, so that any
protobuf reader understands it without this code; what `messages.py` says of a field is the field's comment in it.
"""

from __future__ import annotations

import dataclasses
import inspect
import typing
from collections.abc import Callable
from functools import cache
from operator import attrgetter
from typing import Any, Generic, TypeVar

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError

Message = TypeVar("Message")

_Field, _Files = descriptor_pb2.FieldDescriptorProto, descriptor_pb2.FileDescriptorProto
_SCALARS = {
    int: _Field.TYPE_INT64,
    float: _Field.TYPE_DOUBLE,
    bool: _Field.TYPE_BOOL,
    str: _Field.TYPE_STRING,
    bytes: _Field.TYPE_BYTES,
}
_PACKAGE = "perch"
_LENGTH_DELIMITED = 2  # protobuf's wire type of bytes
_LARGE = 4096  # bytes from which a field is put between the others by hand: protobuf takes 1.4 ms for a picture


class CodecError(ValueError):
    """A message that cannot be written, or bytes that are no such message."""


class Codec(Generic[Message]):
    """Encodes and decodes one dataclass. `name` and `schema` (a FileDescriptorSet) identify it in a recording."""

    def __init__(self, message: type[Message]) -> None:
        if not dataclasses.is_dataclass(message):
            raise TypeError(f"{message!r} is no dataclass")
        self.message = message
        self.name = f"{_PACKAGE}.{message.__name__}"
        file = _describe(message)
        self.schema = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
        pool = descriptor_pool.DescriptorPool()
        pool.Add(file)
        self._proto = message_factory.GetMessageClass(pool.FindMessageTypeByName(self.name))
        self._names = [field.name for field in dataclasses.fields(message)]
        self._get = attrgetter(*self._names) if len(self._names) > 1 else _single(self._names[0])
        hints = typing.get_type_hints(message)
        self._lengths = [(i, n) for i, name in enumerate(self._names) if (n := _length(hints[name])) is not None]
        self._repeated = [i for i, name in enumerate(self._names) if _is_tuple(hints[name])]
        self._blob = next((i for i, name in enumerate(self._names) if hints[name] is bytes), None)
        self._quick = self._one_call() if self._blob is None else None
        self._absent = {i: (0.0 if _element(hints[self._names[i]]) is float else 0,) * n for i, n in self._lengths}

    def encode(self, message: Message) -> bytes:
        """The message as protobuf bytes. Raises CodecError naming the field whose value has a wrong type or length."""
        if self._quick is not None:
            try:
                data = self._quick(message)
            except (TypeError, ValueError, AttributeError):
                data = None
            if data is not None:
                return data
        values = self._get(message)
        for index, length in self._lengths:
            if len(values[index]) != length:
                raise CodecError(f"{self.name}.{self._names[index]}: {length} numbers expected, got {values[index]!r}")
        try:
            blob = self._blob
            if blob is not None and isinstance(values[blob], bytes) and len(values[blob]) >= _LARGE:
                key = _varint((blob + 1) << 3 | _LENGTH_DELIMITED) + _varint(len(values[blob]))
                head, tail = self._serialise(values, 0, blob), self._serialise(values, blob + 1, len(values))
                return b"".join((head, key, values[blob], tail))
            return self._serialise(values, 0, len(values))
        except (TypeError, ValueError, AttributeError):
            raise CodecError(self._find_fault(values)) from None

    def encode_fields(self, **values: Any) -> bytes:
        """`encode` without a message around its values, for what is written thousands of times a second."""
        return self._proto(**values).SerializeToString()

    def _one_call(self) -> Callable[[Message], bytes | None]:
        """What encodes a message in one call without a table in between, in half the time; None for one of wrong
        lengths. Its text is made as `dataclasses` makes that of `__init__`."""
        fields = ", ".join(f"{name}=m.{name}" for name in self._names)
        lengths = " and ".join(f"len(m.{self._names[index]}) == {length}" for index, length in self._lengths)
        text = f"lambda m: Proto({fields}).SerializeToString() if {lengths or True} else None"
        return eval(text, {"Proto": self._proto, "len": len})

    def _serialise(self, values: tuple[Any, ...], first: int, end: int) -> bytes:
        """Fields `first` to `end` (exclusive)."""
        return self._proto(**dict(zip(self._names[first:end], values[first:end], strict=True))).SerializeToString()

    def decode(self, data: bytes) -> Message:
        """Bytes as a message; a field the writer did not know is zero. Raises CodecError if they are none."""
        try:
            proto = self._proto.FromString(data)
        except DecodeError as error:
            raise CodecError(f"{len(data)} bytes are no {self.name}: {error}") from None
        values = list(self._get(proto))
        for index in self._repeated:
            values[index] = tuple(values[index])
        for index, length in self._lengths:
            if len(values[index]) != length:
                if values[index]:
                    raise CodecError(f"{self.name}.{self._names[index]}: {length} numbers expected in the recording")
                values[index] = self._absent[index]
        return self.message(*values)

    def _find_fault(self, values: tuple[Any, ...]) -> str:
        for name, value in zip(self._names, values, strict=True):
            try:
                self._proto(**{name: value}).SerializeToString()
            except (TypeError, ValueError, AttributeError) as error:
                return f"{self.name}.{name}: cannot be written as {value!r}: {error}"
        return f"{self.name}: cannot be written"


def _varint(number: int) -> bytes:
    """A number as protobuf writes it: seven bits a byte, the lowest first."""
    out = bytearray()
    while number > 0x7F:
        out.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*out, number])


@cache
def codec(message: type[Message]) -> Codec[Message]:
    """The one codec of a dataclass."""
    return Codec(message)


def encode(message: Any) -> bytes:
    """`message` as bytes, by the codec of its type."""
    return codec(type(message)).encode(message)


def decode(message: type[Message], data: bytes) -> Message:
    """`data` as a `message`."""
    return codec(message).decode(data)


def _describe(message: type) -> descriptor_pb2.FileDescriptorProto:
    file = descriptor_pb2.FileDescriptorProto(
        name=f"{_PACKAGE}/{message.__name__}.proto", package=_PACKAGE, syntax="proto3"
    )
    proto = file.message_type.add(name=message.__name__)
    hints = typing.get_type_hints(message)
    for number, field in enumerate(dataclasses.fields(message), start=1):
        hint = hints[field.name]
        element = _element(hint) if _is_tuple(hint) else hint
        if element not in _SCALARS:
            raise TypeError(f"{message.__name__}.{field.name}: {hint} has no wire type")
        label = _Field.LABEL_REPEATED if _is_tuple(hint) else _Field.LABEL_OPTIONAL
        proto.field.add(name=field.name, number=number, type=_SCALARS[element], label=label)
    _comment(file, message)
    return file


def _comment(file: descriptor_pb2.FileDescriptorProto, message: type) -> None:
    """Comments of the message (its docstring) and of its fields (unit, frame), as protobuf's compiler keeps them."""
    at = [_Files.MESSAGE_TYPE_FIELD_NUMBER, 0]
    locations = file.source_code_info.location
    locations.add(path=at, span=[0, 0, 0], leading_comments=f" {inspect.cleandoc(message.__doc__ or '')}\n")
    hints = typing.get_type_hints(message, include_extras=True)
    for index, field in enumerate(dataclasses.fields(message)):
        words = [word for word in getattr(hints[field.name], "__metadata__", ()) if isinstance(word, str)]
        if words:
            path = [*at, descriptor_pb2.DescriptorProto.FIELD_FIELD_NUMBER, index]
            locations.add(path=path, span=[index + 1, 0, 0], trailing_comments=f" {'; '.join(words)}\n")


def _is_tuple(hint: Any) -> bool:
    return typing.get_origin(hint) is tuple


def _element(hint: Any) -> Any:
    kinds = {kind for kind in typing.get_args(hint) if kind is not Ellipsis}
    return kinds.pop() if len(kinds) == 1 else None


def _length(hint: Any) -> int | None:
    """How many numbers a fixed tuple holds; None for anything else."""
    kinds = typing.get_args(hint)
    return len(kinds) if _is_tuple(hint) and Ellipsis not in kinds else None


def _single(name: str) -> Any:
    return lambda message: (getattr(message, name),)
