"""The driver's parts by themselves: clocks, texts, parameters, the approach, signing."""

import math
import re
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kernel.rotations import from_euler
from tests.unit.vehicle.px4.driver.driver_bench import START, Bench
from vehicle.px4 import protocol as px4
from vehicle.px4.codec import MESSAGES, Packer, Parser
from vehicle.px4.driver.clocks import ClockOffset, LinkTime
from vehicle.px4.driver.goto import Approach, HoverThrust
from vehicle.px4.driver.params import INT32, REAL32, judge, pack_value, unpack_value
from vehicle.px4.driver.signing import Signer
from vehicle.px4.driver.texts import Texts
from vehicle.px4.driver.types import LinkConfig, Odometry, Signing
from vehicle.px4.event_texts import EventTexts

MS, SECOND = 1_000_000, 1_000_000_000
CONFIG = LinkConfig(start=START, hover_thrust=0.44)

# clocks


@given(
    st.integers(-(10**18), 10**18),
    st.lists(st.tuples(st.integers(0, 40 * MS), st.integers(0, 40 * MS)), min_size=1, max_size=60),
)
def test_offset_error_is_at_most_half_the_best_round_trip(offset, trips):
    clock, now = ClockOffset(drift=0.0), 0
    for there, back in trips:
        now += 100 * MS
        clock.add(now, now + there + offset, now + there + back)
    assert clock.offset_ns is not None
    best = min(there + back for there, back in trips[-20:])
    assert abs(clock.offset_ns - offset) <= best // 2 + 1


@pytest.mark.parametrize("drift", [0.0, 0.01, -0.02])
def test_offset_follows_a_lagging_px4(drift):
    clock = ClockOffset(drift=0.03)
    worst = 0
    for i in range(400):
        now = i * 100 * MS
        trip = (2 + 7 * i % 9) * MS
        px4_ns = round((now + trip / 2) * (1.0 + drift))
        clock.add(now, px4_ns, now + trip)
        assert clock.offset_ns is not None
        worst = max(worst, abs(clock.offset_ns - (px4_ns - (now + trip // 2))))
    assert worst < 12 * MS  # 4 s of which would be 80 ms without following


def test_timesync_answers_without_a_request_are_counted():
    clock = ClockOffset()
    clock.add(5 * SECOND, 1, 4 * SECOND)
    clock.add(1 * SECOND, 1, 2 * SECOND)
    assert (clock.offset_ns, clock.rejected, clock.ours(5)) == (None, 2, None)


def test_known_clock_offset_is_kept():
    clock = ClockOffset(fixed_ns=-7)
    clock.add(0, 500, 10)
    clock.forget()
    assert (clock.offset_ns, clock.ours(3)) == (-7, 10)


def test_link_time_is_px4_time_or_host_time_without_stamps():
    time, now = LinkTime(), 0
    for _ in range(20):  # no stamp received: our time
        time.advance(now := now + 50 * MS)
    assert time.ns == 950 * MS
    for i in range(100):  # at a quarter of our speed
        time.receive(1000 * SECOND + i * 25 * MS)
        time.advance(now := now + 100 * MS)
    assert time.ns == pytest.approx((950 + 99 * 25) * MS, abs=101 * MS)
    before = time.ns
    for _ in range(30):  # silent: ours again after a second
        time.advance(now := now + 100 * MS)
    assert time.ns - before == 2000 * MS


def test_decreasing_px4_time_is_a_reboot():
    time = LinkTime()
    assert not time.receive(100 * SECOND)
    assert not time.receive(100 * SECOND - 400 * MS), "frames may overtake each other"
    assert time.receive(3 * SECOND)
    assert time.reboots == 1


# texts


def send_text(texts, text, severity=6, id=1, now=0):
    for i in range(0, max(1, len(text)), 50):
        texts.receive(SimpleNamespace(id=id, severity=severity, chunk_seq=i // 50, text=text[i : i + 50]), now)


def taken(texts):
    return [(note.severity, note.text) for note in texts.take()]


@given(st.lists(st.text("abc defg", min_size=1, max_size=160).filter(lambda t: t.strip() and len(t) % 50), max_size=6))
def test_texts_are_assembled_from_chunks(reported):
    texts = Texts()
    for i, text in enumerate(reported):
        send_text(texts, text + "\t", id=i)
    assert [text for _, text in taken(texts)] == [f"autopilot: {text.strip()}" for text in reported]


def test_text_that_fills_its_chunk_waits_for_more_up_to_a_limit():
    texts = Texts()
    send_text(texts, "x" * 50)
    texts.flush(400 * MS)
    assert taken(texts) == []
    texts.flush(600 * MS)
    assert taken(texts) == [("info", "autopilot: " + "x" * 50)]


def test_chunks_without_a_beginning_are_dropped():
    texts = Texts()
    texts.receive(SimpleNamespace(id=4, severity=2, chunk_seq=1, text="t\t"), 0)
    assert taken(texts) == []


@pytest.fixture
def texts_and_events():
    """Texts that read EVENTs: 5 a plain one, 6 an error of the checks before arming, 7 the begin of such a report."""
    group = {"message": "No estimate", "name": "x"}
    begin = {"message": "summary", "name": "commander_arming_check_summary"}
    groups = {
        "default": {"events": {"5": {"message": "Takeoff detected", "name": "takeoff"}}},
        "arming_check": {"events": {"6": group, "7": begin}},
    }
    return Texts(EventTexts({"components": {"1": {"namespace": "px4", "event_groups": groups}}}))


def event(texts, number, level):
    texts.event(SimpleNamespace(id=1 << 24 | number, log_levels=0xF0 | level, arguments=(0,) * 40), 0)


def test_events_are_texts_and_their_copies_are_left_out(texts_and_events):
    event(texts_and_events, 5, 6)
    event(texts_and_events, 5, 8)  # meant for no reader
    event(texts_and_events, 99, 2)
    send_text(texts_and_events, "Takeoff detected\t", 6)
    send_text(texts_and_events, "of its own", 4)
    assert taken(texts_and_events) == [("info", "autopilot: Takeoff detected"), ("warning", "autopilot: of its own")]


def test_errors_of_the_newest_checks_before_arming_are_quoted(texts_and_events):
    for number, level in ((7, 8), (6, 3), (6, 3), (6, 6)):
        event(texts_and_events, number, level)
    assert texts_and_events.quote() == "; the autopilot reports: No estimate"
    assert taken(texts_and_events) == []
    event(texts_and_events, 7, 8)
    assert texts_and_events.quote() == ""


def test_texts_have_their_severity_and_errors_are_quoted():
    texts = Texts()
    for severity, text in ((2, "bad"), (4, "hm"), (6, "fine"), (2, "bad")):
        send_text(texts, text, severity)
    assert [severity for severity, _ in taken(texts)] == ["error", "warning", "info", "error"]
    assert texts.quote() == "; the autopilot reports: bad / hm"


# parameters


@given(st.integers(-(2**31), 2**31 - 1))
def test_integers_survive_the_float_field(value):
    assert unpack_value(pack_value(value, INT32), INT32) == value


@given(st.floats(width=32, allow_nan=False))
def test_floats_survive_the_float_field(value):
    assert unpack_value(pack_value(value, REAL32), REAL32) == value
    assert unpack_value(bytes(4), 5) is None


SOUND = {"COM_OF_LOSS_T": 0.3, "COM_OBL_RC_ACT": 4, "CBRK_FLIGHTTERM": 121212, "FD_FAIL_P": 60, "FD_FAIL_R": 60}
SOUND |= {"MPC_THR_HOVER": 0.45, "EKF2_EV_CTRL": 15, "EKF2_HGT_REF": 3, "SYS_HAS_MAG": 0, "EKF2_MAG_TYPE": 5}


def test_valid_parameters_pass():
    assert judge(SOUND, CONFIG) == []
    assert judge(SOUND, LinkConfig(start=START, hover_thrust=0.44, external_vision=True)) == []


@pytest.mark.parametrize(
    ("changed", "advice"),
    [
        ({"COM_OF_LOSS_T": 1.0}, "0.2 to 0.3 s is advisable"),
        ({"COM_OF_LOSS_T": 0.2}, "set gap_limit below it"),
        ({"COM_OBL_RC_ACT": 0}, "4 \\(land\\) or 5 \\(hold\\)"),
        ({"CBRK_FLIGHTTERM": 0}, "FD_FAIL_P 60, FD_FAIL_R 60 deg.*CBRK_FLIGHTTERM 121212"),
        ({"CBRK_FLIGHTTERM": 0, "FD_FAIL_R": 0}, "FD_FAIL_P 60 deg"),
        ({"MPC_THR_HOVER": 0.6}, "MPC_THR_HOVER is 0.600, the airframe file gives 0.440"),
        ({"EKF2_EV_CTRL": 1}, "11 or 15"),
        ({"EKF2_HGT_REF": 1}, "reboot"),
        ({"SYS_HAS_MAG": 1}, "motion capture"),
    ],
)
def test_each_bad_parameter_is_named_with_advice(changed, advice):
    config = LinkConfig(start=START, hover_thrust=0.44, external_vision=any("EKF2" in n or "MAG" in n for n in changed))
    (text,) = judge(SOUND | changed, config)
    assert re.search(advice, text)


def test_raised_or_switched_off_attitude_limits_pass():
    assert judge(SOUND | {"CBRK_FLIGHTTERM": 0, "FD_FAIL_P": 85, "FD_FAIL_R": 0}, CONFIG) == []


@pytest.mark.parametrize(
    ("steepest", "limit", "warned"), [(70, 79, True), (70, 80, False), (45, 60, False), (0, 9, True)]
)
def test_failure_detector_limits_are_compared_with_the_inclination(steepest, limit, warned):
    config = LinkConfig(start=START, hover_thrust=0.44, steepest=math.radians(steepest))
    reported = judge(SOUND | {"CBRK_FLIGHTTERM": 0, "FD_FAIL_P": limit, "FD_FAIL_R": limit}, config)
    assert len(reported) == warned
    assert all(f"raise them to {steepest + 10} or more" in text for text in reported)


def test_parameters_missing_in_px4_are_not_judged():
    assert judge({}, CONFIG) == []


# the approach


@given(
    st.tuples(*[st.floats(-20, 20)] * 3),
    st.tuples(*[st.floats(-3, 3)] * 3),
    st.lists(st.floats(0.0, 0.2), min_size=300, max_size=300),
)
def test_the_set_point_arrives_within_its_limits(position, velocity, steps):
    approach = Approach(CONFIG)
    approach.begin(position, velocity)
    here, speed = position, None
    for seconds in [*steps, *[0.05] * 2000]:
        there, ahead = approach.advance(seconds)
        assert math.dist(here, there) <= CONFIG.goto_speed * seconds + 0.0021
        assert math.hypot(*ahead) <= CONFIG.goto_speed
        assert math.dist(there, START[:3]) <= math.dist(here, START[:3]) + 1e-9
        here, speed = there, math.hypot(*ahead)
    assert (here, speed) == (START[:3], 0.0)


def at_start(stamp_ns, turning):
    yaw = from_euler(0.0, 0.0, START[3])
    return Odometry(stamp_ns, START[:3], (0.0, 0.0, 0.0), yaw, turning)


def settles(turning):
    """Whether the hover is reached within 3 s of body rates `turning(i)`, 10 ms apart."""
    approach = Approach(CONFIG)
    approach.begin(START[:3], (0.0, 0.0, 0.0))
    return any(approach.settled(i * 10_000_000, at_start(i * 10_000_000, turning(i))) for i in range(1, 300))


def test_hover_is_reached_in_spite_of_a_frames_vibrations_but_not_while_it_turns():
    noise = np.random.default_rng(1).normal(0.0, (0.08, 0.04, 0.016), (300, 3))
    assert settles(lambda i: tuple(noise[i]))
    assert not settles(lambda i: (0.2, 0.0, 0.0))
    assert not settles(lambda i: (0.5 * math.sin(0.01 * i * 2 * math.pi), 0.0, 0.0))


def test_hover_thrust_is_an_average_that_follows():
    learned = HoverThrust(0.44, 0.35)
    learned.add([0.4, 0.5])
    assert not learned.known
    learned.add([0.4, 0.5] * 20)
    assert learned.known
    assert learned.value == pytest.approx(0.45)
    assert learned.complaint() == ""
    learned.add([0.9] * 500)
    assert learned.value == pytest.approx(0.9, abs=0.01)
    assert "0.440" in learned.complaint()


# signing

KEY = bytes(range(32))
SIGNING = Signing(KEY, epoch_ns=1_790_000_000 * SECOND, link_id=3)
MESSAGE = MESSAGES["PING"]


def pymavlink_signer():
    mav = px4.mavlink.MAVLink(None, srcSystem=245, srcComponent=190)
    mav.signing.secret_key, mav.signing.link_id, mav.signing.sign_outgoing = KEY, 3, True
    mav.signing.timestamp = (SIGNING.epoch_ns + 7 * SECOND - 1_420_070_400 * SECOND) // 10_000
    return mav


def test_signed_frames_equal_pymavlink_s():
    theirs, ours, signer = pymavlink_signer(), Packer(245, 190), Signer(SIGNING)
    for i in range(5):
        expected = bytes(px4.mavlink.MAVLink_ping_message(5 + i, 6, 0, 0).pack(theirs))
        theirs.seq += 1
        assert signer.sign(ours.pack(MESSAGE, 5 + i, 6, 0, 0), MESSAGE.crc_extra, 7 * SECOND) == expected


def test_pymavlink_accepts_signed_frames_and_refuses_a_replay():
    mav, signer = pymavlink_signer(), Signer(SIGNING)
    frame = signer.sign(Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0), MESSAGE.crc_extra, 7 * SECOND)
    assert [m.get_type() for m in mav.parse_buffer(frame) or []] == ["PING"]
    assert mav.signing.goodsig_count == 1
    with pytest.raises(px4.mavlink.MAVError, match="signature"):
        mav.parse_buffer(frame)


def signed(stamp_ns=7 * SECOND, key=KEY):
    signer = Signer(Signing(key, epoch_ns=SIGNING.epoch_ns))
    return signer.sign(Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0), MESSAGE.crc_extra, stamp_ns)


def frames(data):
    return Parser().feed(data)


def test_validly_signed_frames_are_accepted_once():
    signer, (frame,) = Signer(SIGNING), frames(signed())
    assert signer.accepts(frame, 7 * SECOND)
    assert not signer.accepts(frame, 7 * SECOND), "the same frame again is a replay"
    (later,) = frames(signed(8 * SECOND))
    assert signer.accepts(later, 8 * SECOND)
    assert signer.refused == 1


@pytest.mark.parametrize(
    "data",
    [
        signed(key=bytes(range(1, 33))),
        signed()[:-1] + bytes((signed()[-1] ^ 1,)),
        signed(stamp_ns=-90 * SECOND),  # recorded long ago
        Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0),
    ],
    ids=["other key", "changed", "old", "unsigned"],
)
def test_invalidly_signed_frames_are_refused(data):
    signer, (frame,) = Signer(SIGNING), frames(data)
    assert not signer.accepts(frame, 7 * SECOND)
    assert signer.refused == 1


def test_unsigned_frames_may_be_allowed():
    (frame,) = frames(Packer(1, 1).pack(MESSAGE, 5, 6, 0, 0))
    assert Signer(Signing(KEY, 0, require=False)).accepts(frame, 0)


def test_a_key_has_32_bytes_and_is_not_printed():
    with pytest.raises(ValueError, match="32 bytes"):
        Signing(b"short", 0)
    assert KEY.hex() not in repr(SIGNING) and "\\x1f" not in repr(SIGNING)


def test_a_driver_that_demands_signatures_does_not_fly_with_an_unsigned_px4():
    bench = Bench(signing=SIGNING)
    bench.run(6.0)
    assert bench.link.phase == "connect"
    assert bench.link.counters["unsigned_frames"] > 100
    assert all(frame[2] == 1 for frame in bench.uplink)


def test_signed_commands_to_a_px4_that_does_not_sign():
    bench = Bench(signing=Signing(KEY, SIGNING.epoch_ns, require=False)).to("arm")
    assert all(frame[2] == 1 for frame in bench.uplink)
