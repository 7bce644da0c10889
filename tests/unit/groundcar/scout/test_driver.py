import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundcar.scout.codec import encode
from groundcar.scout.driver import Command, ScoutLink, WrongProtocolError
from groundcar.scout.params import load_scout
from hil.contract.wire import memory_pair

MS = 1_000_000
STATE = encode("MotionState", {"speed": 0.5, "turn_rate": -0.1})


def system(mode, **values):
    return encode("SystemState", {"mode": mode, "battery": 26.4, **values})


def ids(end):
    return [frame[0] for frame in end.sent]


def granted(bus):
    """A link that has CAN control, at 100 ms; nothing sent since."""
    link = ScoutLink(bus[0])
    bus[1].send(STATE)
    bus[1].send(system(1))
    link.step(100 * MS)
    bus[0].sent.clear()
    return link


def test_driver_sends_nothing_before_the_first_frame_of_the_car(bus):
    link = ScoutLink(bus[0])
    for k in range(50):
        feedback = link.step(k * 20 * MS, Command(k * 20 * MS, 1.0, 0.0))
    assert bus[0].sent == []
    assert feedback.stamp_ns == 0
    assert "0x221" in feedback.fault
    assert not link.ready


def test_motion_commands_start_when_the_car_grants_control(bus):
    link = ScoutLink(bus[0])
    for k in range(20):
        now = k * 20 * MS
        bus[1].send(STATE)
        bus[1].send(system(0))
        link.step(now, Command(now, 1.0, 0.0))
    assert set(ids(bus[0])) == {0x421}
    assert len(bus[0].sent) == 4  # every 100 ms
    assert bus[0].sent[0][1][0] == 1
    bus[0].sent.clear()
    bus[1].send(STATE)
    bus[1].send(system(1))
    feedback = link.step(400 * MS, Command(400 * MS, 1.0, 0.0))
    assert bus[0].sent == [encode("MotionCommand", {"speed": 1.0})]
    assert link.ready
    assert feedback.mode == "can"
    assert (feedback.speed, feedback.turn_rate, feedback.battery_v) == pytest.approx((0.5, -0.1, 26.4))


def test_protocol_v1_is_refused_with_a_remedy(bus):
    bus[1].send((0x151, bytes(8)))
    with pytest.raises(WrongProtocolError, match=r"V1.*firmware"):
        ScoutLink(bus[0]).step(0)
    assert bus[0].sent == []


@pytest.mark.parametrize("period_ms", [1, 4, 5, 10])
def test_commands_are_sent_at_50_hz_for_any_step_period(bus, period_ms):
    link = granted(bus)
    for k in range(1000 // period_ms):
        now = (100 + k * period_ms) * MS
        bus[1].send(STATE)
        link.step(now, Command(now, 1.0, 0.0))
    assert len(bus[0].sent) == 50


def test_driver_never_resends_an_old_command(bus):
    link = granted(bus)
    for k in range(50):
        bus[1].send(STATE)
        feedback = link.step((100 + 20 * k) * MS, Command(100 * MS, 1.0, 0.0))
    assert len(bus[0].sent) == 6  # while it was younger than 100 ms
    assert feedback.refused_commands == 44
    assert feedback.sent_commands == 6


def test_driver_sends_nothing_without_a_command(bus):
    link = granted(bus)
    for k in range(50):
        link.step((100 + 20 * k) * MS, None)
    assert bus[0].sent == []


@given(
    speed=st.floats(allow_nan=True, allow_infinity=True),
    turn=st.floats(allow_nan=True, allow_infinity=True),
    age_ms=st.integers(-300, 300),
)
def test_only_fresh_finite_commands_reach_the_car_and_within_its_limits(speed, turn, age_ms):
    ours, car = memory_pair(lambda: 0)
    link = ScoutLink(ours)
    car.send(STATE)
    car.send(system(1))
    feedback = link.step(400 * MS, Command((400 - age_ms) * MS, speed, turn))
    good = math.isfinite(speed) and math.isfinite(turn) and 0 <= age_ms <= 100
    asked = {"speed": max(-3.0, min(3.0, speed)), "turn_rate": max(-2.523, min(2.523, turn))} if good else {}
    assert car.receive() == ([encode("MotionCommand", asked)] if good else [])
    assert feedback.refused_commands == (not good)


def test_lower_limits_of_the_rig_apply(bus):
    params = load_scout()
    params = params.model_copy(update={"limits": params.limits.model_copy(update={"speed": 1.0})})
    link = ScoutLink(bus[0], params)
    bus[1].send(STATE)
    bus[1].send(system(1))
    link.step(0, Command(0, 2.0, 0.0))
    assert bus[0].sent == [encode("MotionCommand", {"speed": 1.0})]


def test_invalid_frames_are_counted(bus):
    link = granted(bus)
    for frame in [(0x221, b"\x01\x02\x03"), (0x700, bytes(8)), (0x211, b""), (0x111, bytes(8))]:
        bus[1].send(frame)
    feedback = link.step(120 * MS)
    assert feedback.rejected_frames == 4
    assert feedback.speed == pytest.approx(0.5)
    assert feedback.stamp_ns == 100 * MS


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (system(1, state=1), "e-stop"),
        (system(1, state=2, under_voltage=1), "battery empty"),
        (system(1, state=2), "unknown cause"),
        (system(3), "remote control"),
        (encode("Driver2", {"over_current": 1}), "wheel 2 over current"),
        (encode("Driver4", {"can_lost": 1}), "wheel 4 can lost"),
    ],
)
def test_fault_text_names_each_fault(bus, frame, message):
    link = granted(bus)
    assert link.ready
    bus[1].send(frame)
    assert message in link.step(120 * MS).fault
    assert not link.ready


def test_missing_motion_state_is_a_fault_until_it_returns(bus):
    link = granted(bus)
    assert link.step(290 * MS).fault == ""
    assert "silent" in link.step(310 * MS).fault
    bus[1].send(STATE)
    assert link.step(320 * MS).fault == ""


def test_no_control_request_while_the_remote_control_is_active(bus):
    link = granted(bus)
    for k in range(1, 20):
        now = (100 + 20 * k) * MS
        bus[1].send(STATE)
        bus[1].send(system(3))
        link.step(now, Command(now, 1.0, 0.0))
    assert bus[0].sent == []
    bus[1].send(system(0))
    link.step(520 * MS, Command(520 * MS, 1.0, 0.0))
    assert ids(bus[0]) == [0x421]


def test_driver_sends_brake_clear_light_and_release_frames(bus):
    link = granted(bus)
    link.brake(True)
    link.clear_errors(3)
    link.light(50)
    link.release()
    assert ids(bus[0]) == [0x131, 0x441, 0x121, 0x111, 0x421]
    assert [frame[1][0] for frame in bus[0].sent] == [1, 3, 1, 0, 0]
