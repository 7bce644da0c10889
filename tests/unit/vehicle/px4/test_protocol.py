"""Modes, masks and framing: against pymavlink, against frames recorded from a real PX4, against garbage."""

import math
import random
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.paths import PX4_DATA
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES, Packer, Parser

RECORDED = (PX4_DATA / "frames.bin").read_bytes()
# What the simulator and the link put on the wire through the fast codec.
# fmt: off
USED = [
    "HEARTBEAT", "SYS_STATUS", "SYSTEM_TIME", "PING", "GPS_RAW_INT", "SCALED_PRESSURE", "ATTITUDE",
    "ATTITUDE_QUATERNION", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT", "SERVO_OUTPUT_RAW", "MISSION_CURRENT",
    "VFR_HUD", "ATTITUDE_TARGET", "POSITION_TARGET_LOCAL_NED", "POSITION_TARGET_GLOBAL_INT", "HIGHRES_IMU",
    "DISTANCE_SENSOR", "ALTITUDE", "BATTERY_STATUS", "ESTIMATOR_STATUS", "VIBRATION",
    "HOME_POSITION", "EXTENDED_SYS_STATE", "ODOMETRY", "CURRENT_MODE", "GNSS_INTEGRITY",
    "OPEN_DRONE_ID_LOCATION", "OPEN_DRONE_ID_SYSTEM", "STATUSTEXT", "COMMAND_ACK", "COMMAND_LONG",
    "COMMAND_INT", "PARAM_VALUE", "PARAM_SET", "PARAM_REQUEST_READ", "PARAM_REQUEST_LIST",
    "AUTOPILOT_VERSION", "MESSAGE_INTERVAL", "HIL_STATE_QUATERNION", "SET_ATTITUDE_TARGET", "SET_MODE",
    "SET_POSITION_TARGET_LOCAL_NED", "VISION_POSITION_ESTIMATE", "ATT_POS_MOCAP",
]
# fmt: on


def sample(kind, length, rng):
    if kind == "char":
        return "".join(rng.choice("ABCxyz_019") for _ in range(rng.randint(1, length)))

    def one():
        if kind in ("float", "double"):
            return rng.choice([0.0, 1.5, -2.25, math.nan, rng.randint(-(2**20), 2**20) / 64])
        bits = {"8": 8, "1": 16, "3": 32, "6": 64}[kind.removeprefix("u").removeprefix("int")[0]]
        value = rng.getrandbits(bits - 1)
        return value if kind.startswith("u") or rng.random() < 0.5 else -value

    return tuple(one() for _ in range(length)) if length else one()


@pytest.mark.parametrize("name", USED)
def test_framing_equals_pymavlink_byte_for_byte(name):
    cls: Any = px4.mavlink.mavlink_map[MESSAGES[name].id]
    lengths = dict(zip(cls.ordered_fieldnames, cls.array_lengths, strict=True))
    theirs = px4.mavlink.MAVLink(None, srcSystem=7, srcComponent=9)
    ours = Packer(7, 9)
    rng = random.Random(name)
    for _ in range(30):
        values = [sample(k, lengths[f], rng) for f, k in zip(cls.fieldnames, cls.fieldtypes, strict=True)]
        encoded = [v.encode() if isinstance(v, str) else v for v in values]
        expected = bytes(cls(*encoded).pack(theirs))
        theirs.seq = (theirs.seq + 1) % 256
        frame = ours.pack(MESSAGES[name], *values)
        assert frame == expected
        (parsed,) = Parser().feed(frame)
        assert parsed.name == name and (parsed.system, parsed.component) == (7, 9)
        again = Packer(7, 9)
        again.sequence = parsed.sequence
        assert again.pack(parsed.message, *parsed.fields) == frame


def test_a_real_px4s_frames_are_read_and_written_back_the_same():
    parser = Parser()
    frames = parser.feed(RECORDED)
    assert (parser.garbage_bytes, parser.bad_frames, parser.unknown_frames) == (0, 0, 0)
    assert len({f.name for f in frames}) >= 40
    rebuilt = []
    for frame in frames:
        packer = Packer(frame.system, frame.component)
        packer.sequence = frame.sequence
        rebuilt.append(packer.pack(frame.message, *frame.fields))
    assert b"".join(rebuilt) == RECORDED


def test_frames_survive_any_cutting_of_the_stream():
    whole = len(Parser().feed(RECORDED))
    parser, count, rng, at = Parser(), 0, random.Random(3), 0
    while at < len(RECORDED):
        step = rng.randint(1, 97)
        count += len(parser.feed(RECORDED[at : at + step]))
        at += step
    assert count == whole and parser.garbage_bytes == 0


@given(st.binary(max_size=300).filter(lambda b: 0xFD not in b and 0xFE not in b))
def test_garbage_between_frames_is_counted_and_dropped(noise):
    frame = Packer(1, 1).send_name("PING", 5, 6, 0, 0)
    parser = Parser()
    frames = parser.feed(noise + frame + noise + frame)
    assert [f.fields.time_usec for f in frames] == [5, 5]
    assert parser.garbage_bytes == 2 * len(noise)


@given(st.binary(max_size=600))
def test_parser_neither_raises_nor_loses_frames_after_arbitrary_bytes(noise):
    frame = Packer(1, 1).send_name("PING", 5, 6, 0, 0)
    parser = Parser()
    parser.feed(noise)
    frames = parser.feed(frame * 40)
    assert sum(f.name == "PING" for f in frames) >= 1


def test_a_flipped_bit_is_a_bad_frame_and_the_next_one_is_still_read():
    frame = Packer(1, 1).send_name("PING", 5, 6, 0, 0)
    broken = bytearray(frame)
    broken[12] ^= 4
    parser = Parser()
    assert len(parser.feed(bytes(broken) + frame)) == 1
    assert parser.bad_frames == 1


def test_mavlink_1_is_read_too():
    message = px4.mavlink.MAVLink_ping_message(11, 12, 0, 0)
    frame = bytes(message.pack(px4.mavlink.MAVLink(None, 3, 4), force_mavlink1=True))
    assert frame[0] == 0xFE
    (parsed,) = Parser().feed(frame)
    assert (parsed.system, parsed.fields.time_usec, parsed.fields.seq) == (3, 11, 12)


def test_unknown_messages_are_skipped_whole():
    known = Packer(1, 1).send_name("PING", 5, 6, 0, 0)
    unknown = bytes.fromhex("fd01000000010130750e55aabb")
    parser = Parser()
    assert len(parser.feed(unknown + known)) == 1
    assert (parser.unknown_frames, parser.garbage_bytes) == (1, 0)


@pytest.mark.parametrize(
    ("custom", "number", "name"),
    [
        (px4.HOLD, 0x03040000, "AUTO.LOITER"),
        (px4.TAKEOFF, 0x02040000, "AUTO.TAKEOFF"),
        (px4.RTL, 0x05040000, "AUTO.RTL"),
        (px4.LAND, 0x06040000, "AUTO.LAND"),
        (px4.OFFBOARD, 0x00060000, "OFFBOARD"),
        (px4.ALTCTL, 0x00020000, "ALTCTL"),
        (px4.custom_mode(99), 99 << 16, "UNKNOWN(99.0)"),
        (px4.custom_mode(4, 99), 0x63040000, "AUTO.99"),
    ],
)
def test_modes_are_numbered_as_px4_numbers_them(custom, number, name):
    assert custom == number
    assert px4.mode_name(custom) == name
    assert px4.custom_mode(*px4.split_custom_mode(custom)) == custom


@pytest.mark.parametrize("mask", [0x80, 0x84, 0xC0, 0xA0])
def test_rate_setpoint_masks_are_recognised(mask):
    assert px4.counts_as_rates(mask) and not px4.counts_as_attitude(mask)


@pytest.mark.parametrize("mask", [0x81, 0x82, 0x87])
def test_masks_that_do_not_count_as_a_stream(mask):
    assert not px4.counts_as_rates(mask) and not px4.counts_as_attitude(mask)


@pytest.mark.parametrize("mask", [0x00, 0x07])
def test_masks_in_which_attitude_overrides_rates(mask):
    assert px4.counts_as_attitude(mask) and not px4.counts_as_rates(mask)


def test_position_setpoint_masks_are_recognised():
    assert px4.counts_as_position(px4.POSITION_YAW)
    assert px4.counts_as_position(0x1C7)
    assert not px4.counts_as_position(0x1FF)
