import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.scout.codec import COMMANDS, Decoder, Frame, can_id, database, encode, feedback_names

EVERYTHING = [m.name for m in database().messages]


def test_golden_vectors_of_the_manual():
    assert encode("MotionCommand", {"speed": 0.15}) == (0x111, bytes.fromhex("0096000000000000"))
    assert encode("MotionCommand", {"turn_rate": 0.05}) == (0x111, bytes.fromhex("0000003200000000"))


def test_frames_written_out_by_hand():
    assert encode("ControlMode", {"mode": 1}) == (0x421, bytes.fromhex("0100000000000000"))
    assert encode("MotionState", {"speed": -1.0, "turn_rate": -0.001}) == (0x221, bytes.fromhex("fc18ffff00000000"))
    assert encode("Odometry", {"left": 1.0, "right": -0.001}) == (0x311, bytes.fromhex("000003e8ffffffff"))
    system = {"state": 2, "mode": 3, "battery": 25.6, "under_voltage": 1, "rc_lost": 1, "count": 9}
    assert encode("SystemState", system) == (0x211, bytes.fromhex("0203010005000009"))
    motor = {"rpm": 300, "current": -1.5, "pulses": -2}
    assert encode("Motor3", motor) == (0x253, bytes.fromhex("012cfff1fffffffe"))
    driver = {"voltage": 24.0, "driver_temperature": 40, "motor_temperature": -5, "motor_hot": 1, "can_lost": 1}
    assert encode("Driver4", driver) == (0x264, bytes.fromhex("00f00028fb120000"))
    bms = {"charge": 80, "health": 99, "voltage": 26.5, "current": -2.0, "temperature": 25.0}
    assert encode("Bms", bms) == (0x361, bytes.fromhex("50630109ffec00fa"))
    rc = {"switch_a": 1, "switch_b": 2, "switch_c": 3, "right_h": -100, "left_h": 100, "count": 255}
    assert encode("RcState", rc) == (0x241, bytes.fromhex("399c0000640000ff"))


def test_can_identifiers_agree_with_the_manual():
    ids = {name: can_id(name) for name in EVERYTHING}
    assert [ids[name] for name in COMMANDS] == [0x111, 0x121, 0x131, 0x421, 0x441]
    assert [ids[f"Motor{k}"] for k in (1, 2, 3, 4)] == [0x251, 0x252, 0x253, 0x254]
    assert [ids[f"Driver{k}"] for k in (1, 2, 3, 4)] == [0x261, 0x262, 0x263, 0x264]
    assert len(set(ids.values())) == len(EVERYTHING)
    assert not set(COMMANDS) & set(feedback_names())


@given(speed=st.floats(-1e6, 1e6), turn=st.floats(-1e6, 1e6))
def test_motion_is_clamped_before_encoding(speed, turn):
    _, values = Decoder(COMMANDS).decode(encode("MotionCommand", {"speed": speed, "turn_rate": turn}))
    assert values["speed"] == pytest.approx(max(-3.0, min(3.0, speed)), abs=0.00051)
    assert values["turn_rate"] == pytest.approx(max(-2.523, min(2.523, turn)), abs=0.00051)


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_non_finite_values_are_refused(bad):
    with pytest.raises(ValueError, match=r"MotionCommand\.speed"):
        encode("MotionCommand", {"speed": bad})


def test_unknown_names_are_refused_with_the_known_ones():
    with pytest.raises(ValueError, match="turn_rate"):
        encode("MotionCommand", {"omega": 1.0})
    with pytest.raises(ValueError, match="MotionCommand"):
        encode("Motion", {})


@settings(max_examples=150)
@given(name=st.sampled_from(EVERYTHING), seed=st.integers(0, 2**32))
def test_decode_inverts_encode(name, seed):
    rng, values = random.Random(seed), {}
    for s in database().get_message_by_name(name).signals:
        low, high = (-(1 << s.length - 1), (1 << s.length - 1) - 1) if s.is_signed else (0, (1 << s.length) - 1)
        if s.maximum is not None:
            low, high = round(s.minimum / s.scale), round(s.maximum / s.scale)
        values[s.name] = rng.randint(low, high) * s.scale
    got = Decoder(EVERYTHING).decode(encode(name, values))
    assert got is not None
    assert got[0] == name
    assert got[1] == pytest.approx(values)


@pytest.mark.parametrize("name", EVERYTHING)
def test_message_that_repeats_and_one_that_differs_are_decoded_as_cantools_does(name):
    message, rng, decoder = database().get_message_by_name(name), random.Random(name), Decoder(EVERYTHING)
    for data in (rng.randbytes(8) for _ in range(10)):
        for _ in range(2):
            assert decoder.decode((message.frame_id, data)) == (name, message.decode(data, decode_choices=False))


@given(frame=st.tuples(st.integers(0, 0x7FF), st.binary(max_size=8)))
def test_invalid_frames_are_counted_without_an_error(frame):
    decoder = Decoder(feedback_names())
    known = frame[0] in {can_id(name) for name in feedback_names()}
    got = decoder.decode(frame)
    assert (got is not None) == (known and len(frame[1]) == 8)
    assert decoder.rejected == (got is None)
    assert decoder.unknown_ids == (not known)


def test_a_three_byte_frame_is_rejected_and_a_one_byte_mode_is_not():
    decoder = Decoder(COMMANDS)
    assert decoder.decode((0x111, b"\x00\x96\x00")) is None
    assert decoder.decode((0x111, b"\x00")) is None
    assert decoder.decode(Frame(0x421, b"\x01")) == ("ControlMode", {"mode": 1})
    assert (decoder.wrong_lengths, decoder.unknown_ids) == (2, 0)
