import dataclasses
import inspect
import math
import struct
import typing
from dataclasses import dataclass

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.contract import messages
from hil.contract.codec import Codec, CodecError, codec, decode, encode
from hil.contract.topics import TOPICS

MESSAGES = [m for m in vars(messages).values() if dataclasses.is_dataclass(m)]

VALUES = {
    int: st.integers(-(2**63), 2**63 - 1),
    float: st.floats(width=64),
    bool: st.booleans(),
    str: st.text(),
    bytes: st.binary(),
}


def _values(hint):
    if typing.get_origin(hint) is tuple:
        kinds = typing.get_args(hint)
        if kinds[-1] is Ellipsis:
            return st.lists(VALUES[kinds[0]], max_size=12).map(tuple)
        return st.tuples(*(VALUES[k] for k in kinds))
    return VALUES[hint]


def any_message():
    def build(kind):
        hints = typing.get_type_hints(kind)
        return st.builds(kind, **{f.name: _values(hints[f.name]) for f in dataclasses.fields(kind)})

    return st.sampled_from(MESSAGES).flatmap(build)


def _bits(value):
    if isinstance(value, float):
        return struct.pack("<d", value)
    return tuple(map(_bits, value)) if isinstance(value, tuple) else value


def bits(message):
    return tuple(_bits(getattr(message, f.name)) for f in dataclasses.fields(message))


def test_every_topics_message_has_a_codec():
    assert {t.message for t in TOPICS.values()} <= set(MESSAGES)
    assert all(codec(m).name == f"perch.{m.__name__}" for m in MESSAGES)


@given(any_message())
@settings(max_examples=300)
def test_round_trip_keeps_every_bit(message):
    data = encode(message)
    assert bits(decode(type(message), data)) == bits(message)
    assert encode(decode(type(message), data)) == data


@given(any_message())
@settings(max_examples=300)
def test_the_bytes_are_those_that_protobuf_writes(message):
    kind = codec(type(message))
    values = {field.name: getattr(message, field.name) for field in dataclasses.fields(message)}
    assert encode(message) == kind.encode_fields(**values) == kind._proto(**values).SerializeToString()


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, -0.0, 5e-324])
def test_unusual_floats_round_trip(value):
    message = messages.CarCommand(0, value, 1.0)
    assert struct.pack("<d", decode(messages.CarCommand, encode(message)).speed) == struct.pack("<d", value)


def test_numpy_scalars_are_numbers():
    sent = messages.CarCommand(np.int64(5), np.float64(1.5), np.float64(2.5))
    assert decode(messages.CarCommand, encode(sent)) == messages.CarCommand(5, 1.5, 2.5)


@dataclass(frozen=True, slots=True)
class Old:
    stamp_ns: int
    position: messages.Vec3


@dataclass(frozen=True, slots=True)
class New:
    stamp_ns: int
    position: messages.Vec3
    heading: float
    text: str
    corner: tuple[float, float]
    ids: tuple[int, ...]


def test_appended_field_keeps_old_and_new_readers_working():
    data = encode(New(1, (1.0, 2.0, 3.0), 0.5, "hello", (4.0, 5.0), (6, 7)))
    assert decode(Old, data) == Old(1, (1.0, 2.0, 3.0))
    old = encode(Old(1, (1.0, 2.0, 3.0)))
    assert decode(New, old) == New(1, (1.0, 2.0, 3.0), 0.0, "", (0.0, 0.0), ())


def test_message_can_be_read_with_its_schema_only():
    kind = codec(messages.Detection)
    files = descriptor_pb2.FileDescriptorSet.FromString(kind.schema)
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    proto = message_factory.GetMessageClass(pool.FindMessageTypeByName(kind.name))
    detection = messages.Detection(
        7, True, (1.0, 2.0, 3.0), (1.0, 0.0, 0.0, 0.0), 0.1, 0.2, (0, 3), (1.5, 2.5), "", 9, 11
    )
    read = proto.FromString(encode(detection))
    assert (read.stamp_ns, list(read.tag_ids), list(read.corners_px), read.image_sequence) == (7, [0, 3], [1.5, 2.5], 9)


@pytest.mark.parametrize("kind", MESSAGES, ids=lambda kind: kind.__name__)
def test_the_schema_says_unit_and_frame_of_every_field(kind):
    [file] = descriptor_pb2.FileDescriptorSet.FromString(codec(kind).schema).file
    said = {tuple(one.path): one for one in file.source_code_info.location}
    assert said[4, 0].leading_comments.strip() == inspect.cleandoc(kind.__doc__)
    comments = {f.name: said[4, 0, 2, i].trailing_comments.strip() for i, f in enumerate(file.message_type[0].field)}
    assert all(comments.values())
    if "orientation" in comments:
        assert comments["orientation"].startswith("w, x, y, z; world")
    if "position" in comments:
        assert comments["position"].startswith("m, world ENU")
    floats = [comments[name] for name, hint in typing.get_type_hints(kind).items() if hint in (float, messages.Vec3)]
    units = {text.split(", ")[0].split("; ")[0] for text in floats}
    assert units <= {"m", "m/s", "m/s^2", "rad", "rad/s", "V", "1"}


@pytest.mark.parametrize(
    ("message", "field"),
    [
        (messages.CarCommand(0, "fast", 1.0), "perch.CarCommand.speed"),
        (messages.CarCommand(2**63, 0.0, 1.0), "perch.CarCommand.stamp_ns"),
        (messages.VehicleState(0, (0.0, 0.0), (0.0,) * 3, (1.0, 0, 0, 0), (0.0,) * 3), "perch.VehicleState.position"),
    ],
)
def test_a_wrong_value_names_its_field(message, field):
    with pytest.raises(CodecError, match=field):
        encode(message)


@given(st.binary(max_size=200))
@settings(max_examples=200)
def test_random_bytes_decode_or_are_refused(data):
    try:
        decode(messages.VehicleState, data)
    except CodecError as error:
        assert "perch.VehicleState" in str(error)


def test_type_without_an_encoding_is_refused_on_definition():
    @dataclass
    class Bad:
        where: dict

    with pytest.raises(TypeError, match=r"Bad\.where"):
        Codec(Bad)


@pytest.mark.parametrize("size", [0, 4095, 4096, 921_600])
def test_a_large_field_is_written_as_protobuf_writes_it(size):
    image = messages.Image(5, 1280, 720, 2_000_000, bytes(range(256)) * (size // 256) + bytes(size % 256), 300)
    by_protobuf = codec(messages.Image)._proto(**dataclasses.asdict(image)).SerializeToString()
    assert encode(image) == by_protobuf
    assert decode(messages.Image, encode(image)) == image


def test_a_large_field_beside_a_wrong_one_names_the_wrong_one():
    with pytest.raises(CodecError, match="sequence"):
        encode(messages.Image(5, 1280, 720, 2_000_000, bytes(5000), "three"))
