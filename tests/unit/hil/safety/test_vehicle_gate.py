import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from hil.contract.messages import Action, VehicleState
from hil.safety.limits import GateLimits
from hil.safety.vehicle_gate import VehicleGate
from vehicle.quadrotor.airframe import CommandLimits

NOW = 5_000_000_000
MS = 1_000_000
LIMITS = GateLimits()


def action(rate=(0.1, -0.2, 0.3), thrust=9.8, age_ms=0.0, seen_ms=40.0):
    return Action(NOW - round(age_ms * MS), True, rate, thrust, "network", NOW - round(seen_ms * MS), 1.0)


def vehicle(position=(0.0, 0.0, 2.0), velocity=(1.0, 0.0, 0.0), age_ms=10.0):
    return VehicleState(NOW - round(age_ms * MS), position, velocity, (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def test_vehicle_gate_passes_a_valid_command_unchanged():
    gate = VehicleGate(LIMITS)
    sent = gate.check(NOW, action(), vehicle())
    assert sent is not None
    assert (sent.body_rate, sent.thrust, sent.limited, sent.tripped) == ((0.1, -0.2, 0.3), 9.8, False, "")
    assert sent.stamp_ns == NOW
    assert (gate.tripped, gate.refused) == ("", 0)


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_vehicle_gate_clips_each_rate_and_marks_it(axis, sign):
    rate = [0.0, 0.0, 0.0]
    rate[axis] = sign * (LIMITS.rate + 0.5)
    sent = VehicleGate(LIMITS).check(NOW, action(tuple(rate)), vehicle())
    assert sent is not None
    assert sent.limited
    assert sent.body_rate[axis] == sign * LIMITS.rate
    assert [sent.body_rate[other] for other in range(3) if other != axis] == [0.0, 0.0]


@pytest.mark.parametrize(("asked", "sent_thrust"), [(0.0, 2.0), (-3.0, 2.0), (25.0, 18.0), (1e9, 18.0)])
def test_vehicle_gate_clips_thrust_and_marks_it(asked, sent_thrust):
    sent = VehicleGate(LIMITS).check(NOW, action(thrust=asked), vehicle())
    assert sent is not None
    assert (sent.thrust, sent.limited) == (sent_thrust, True)


@given(st.tuples(*[st.floats(-50, 50)] * 3), st.floats(-50, 50))
def test_vehicle_gate_output_is_within_the_limits_and_marked_when_changed(rate, thrust):
    sent = VehicleGate(LIMITS).check(NOW, action(rate, thrust), vehicle())
    assert sent is not None
    assert all(abs(r) <= LIMITS.rate for r in sent.body_rate)
    assert LIMITS.thrust[0] <= sent.thrust <= LIMITS.thrust[1]
    assert sent.limited == ((sent.body_rate, sent.thrust) != (rate, thrust))


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize("field", range(4))
def test_gate_trips_on_a_non_finite_command(bad, field):
    numbers = [0.0, 0.0, 0.0, 9.8]
    numbers[field] = bad
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(tuple(numbers[:3]), numbers[3]), vehicle()) is None
    assert gate.tripped == "command is not finite"


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        (None, "no odometry younger than 200 ms"),
        (vehicle(age_ms=200.1), "no odometry younger than 200 ms"),
        (vehicle(velocity=(5.0, -5.0, 4.0)), "vehicle at 8.1 m/s, limit 8"),
        (replace(vehicle(), body_rate=(-8.0, 8.0, 5.0)), "turns at 12.4 rad/s, limit 12"),
        (vehicle((-25.1, 0.0, 2.0)), "outside its fence: x = -25.10 m"),
        (vehicle((0.0, 25.1, 2.0)), "outside its fence: y = 25.10 m"),
        (vehicle((0.0, 0.0, 0.2)), "outside its fence: z = 0.20 m, allowed 0.3 to 9"),
        (vehicle((0.0, 0.0, 9.1)), "outside its fence: z = 9.10 m"),
        (vehicle((0.0, 0.0, 2.0), (0.0, 0.0, -3.7)), "sinks at 3.7 m/s, 1.70 m above the floor of its fence"),
        (vehicle((0.0, 0.0, 0.4), (0.0, 0.0, -0.9)), "sinks at 0.9 m/s, 0.10 m above the floor of its fence"),
        (vehicle((math.nan, 0.0, 2.0)), "odometry is not finite"),
        (vehicle(velocity=(0.0, math.inf, 0.0)), "odometry is not finite"),
        (replace(vehicle(), orientation=(math.nan, 0.0, 0.0, 0.0)), "odometry is not finite"),
        (replace(vehicle(), body_rate=(0.0, 0.0, math.nan)), "odometry is not finite"),
        (vehicle(age_ms=-5.1), "odometry is stamped 5.1 ms later than now"),
        (vehicle(age_ms=-3_600_000.0), "odometry is stamped 3600000.0 ms later than now"),
        (replace(vehicle(), orientation=(0.0, 0.0, 0.0, 0.0)), "odometry has no unit quaternion"),
    ],
)
def test_gate_trips_on_an_unsafe_vehicle_state_and_latches(state, reason):
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(), state) is None
    assert reason in gate.tripped
    first = gate.tripped
    assert gate.check(NOW, action(), vehicle()) is None, "all is well again, and still nothing may be sent"
    assert gate.tripped == first


def test_gate_trips_when_the_board_was_not_detected_for_seconds():
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(seen_ms=3000.0), vehicle()) is not None
    assert gate.check(NOW, action(seen_ms=3060.0), vehicle()) is None
    assert gate.tripped == "board not seen for 3.1 s, limit 3"
    assert gate.check(NOW, action(), vehicle()) is None, "the trip latches"


@pytest.mark.parametrize("seen_ms", [-5.1, -3_600_000.0])
def test_gate_trips_on_a_picture_stamped_later_than_now(seen_ms):
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(seen_ms=seen_ms), vehicle()) is None
    assert gate.tripped == f"the command's picture is stamped {-seen_ms:.1f} ms later than now"


def test_gate_passes_stamps_within_the_clock_error():
    assert VehicleGate(LIMITS).check(NOW, action(seen_ms=-4.9), vehicle(age_ms=-4.9)) is not None


@pytest.mark.parametrize(
    ("moved", "angle", "after_ms", "reason"),
    [
        (24.0, 0.0, 10.0, "odometry jumped by 24.00 m within 10 ms"),
        (0.59, 0.0, 10.0, "odometry jumped by 0.59 m within 10 ms"),
        (0.57, 0.0, 10.0, ""),  # 8 m/s for 10 ms, and 0.5 m
        (1.2, 0.0, 100.0, ""),
        (0.0, 0.63, 10.0, "odometry turned by 0.63 rad within 10 ms"),
        (0.0, 0.61, 10.0, ""),  # 12 rad/s for 10 ms, and 0.5 rad
        (0.0, math.pi, 10.0, "odometry turned by 3.14 rad within 10 ms"),
    ],
)
def test_gate_trips_on_odometry_that_moves_faster_than_the_vehicle_can(moved, angle, after_ms, reason):
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(), vehicle(age_ms=after_ms)) is not None
    turned = (math.cos(angle / 2), 0.0, math.sin(angle / 2), 0.0)
    sent = gate.check(NOW, action(), replace(vehicle((moved, 0.0, 2.0), age_ms=0.0), orientation=turned))
    assert (sent is None) == bool(reason)
    assert gate.tripped == reason


def test_quaternion_sign_flip_does_not_trip_the_gate():
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(), vehicle()) is not None
    assert gate.check(NOW, action(), replace(vehicle(age_ms=0.0), orientation=(-1.0, 0.0, 0.0, 0.0))) is not None


@pytest.mark.parametrize(("height", "climb"), [(2.0, -2.9), (2.0, 7.9), (0.4, -0.7), (0.3, 0.0), (1.5, -2.4)])
def test_gate_passes_a_descent_that_can_end_above_the_floor(height, climb):
    assert VehicleGate(LIMITS).check(NOW, action(), vehicle((0.0, 0.0, height), (0.0, 0.0, climb))) is not None


def test_gate_passes_commands_at_the_limits():
    state = replace(vehicle((25.0, -25.0, 0.3), (8.0, 0.0, 0.0), age_ms=200.0), body_rate=(12.0, 0.0, 0.0))
    sent = VehicleGate(LIMITS).check(NOW, action((4.0, -4.0, 4.0), 18.0, age_ms=50.0), state)
    assert sent is not None
    assert not sent.limited


@pytest.mark.parametrize("age_ms", [50.1, 1000.0, -0.1])
def test_gate_drops_a_late_command_without_a_trip(age_ms):
    gate = VehicleGate(LIMITS)
    assert gate.check(NOW, action(age_ms=age_ms), vehicle()) is None
    assert (gate.tripped, gate.refused) == ("", 1)
    assert gate.check(NOW, action(), vehicle()) is not None
    assert gate.refused == 1


@pytest.mark.parametrize(
    "wrong",
    [
        {"z": (9.0, 0.3)},
        {"x": (1.0, 1.0)},
        {"thrust": (-1.0, 18.0)},
        {"rate": 0.0},
        {"speed": math.nan},
        {"y": (-math.inf, 1.0)},
        {"command_age_ms": 0.0},
        {"blind": 0.0},
        {"heighth": 3.0},
    ],
)
def test_invalid_gate_limits_are_refused(wrong):
    with pytest.raises(ValidationError):
        GateLimits(**wrong)


def test_vehicle_gate_clips_negative_thrust_to_a_zero_lower_limit():
    sent = VehicleGate(GateLimits(thrust=(0.0, 18.0))).check(NOW, action(thrust=-1.0), vehicle())
    assert sent is not None
    assert (sent.thrust, sent.limited) == (0.0, True)


def repeated(command, times_ms, moving=True, gate=None):
    """(ms of the trip or None, its reason) of a gate that is given `command(ms)` at `times_ms`."""
    gate = gate or VehicleGate(LIMITS, CommandLimits(thrust=(4.8, 14.8), body_rate=3.5, rate_lag=0.04))
    for t in times_ms:
        now, rate, thrust = NOW + t * MS, *command(t)
        state = replace(vehicle((1e-3 * t if moving else 0.0, 0.0, 2.0)), stamp_ns=now)
        gate.check(now, Action(now, True, rate, thrust, "network", now, 1.0), state)
        if gate.tripped:
            return t, gate.tripped
    return None, ""


def test_gate_trips_on_a_command_that_repeats_while_the_odometry_changes():
    t, why = repeated(lambda t: ((0.1, -0.2, 0.3), 9.8), range(0, 1000, 10))
    assert (t, why) == (200, "command has not changed for 0.20 s, and the odometry has")


@pytest.mark.parametrize(
    "command",
    [
        lambda t: ((0.1, -0.2, 0.3), math.nextafter(9.8, 10.0) if t % 20 else 9.8),  # a bit of one number changes
        lambda t: ((0.1, -0.2, 0.001 * (t // 150)), 9.8),  # a policy of 7 Hz
        lambda t: ((3.5, -3.5, 0.0), 14.8),  # at its bounds, and no yaw
        lambda t: ((3.4999, 4.2, 0.0), 4.8001),
        lambda t: ((5.0, 0.0, 0.0), 20.0),  # clipped
    ],
)
def test_gate_passes_a_command_that_changes_or_is_at_its_bounds(command):
    assert repeated(command, range(0, 1000, 10)) == (None, "")


@pytest.mark.parametrize("command", [((3.5, 0.2, 0.0), 14.8), ((3.5, -3.5, 3.5), 9.8), ((0.0, 0.0, 0.0), 9.81)])
def test_gate_trips_on_a_command_that_repeats_with_one_number_within_its_bounds(command):
    assert repeated(lambda t: command, range(0, 1000, 10))[0] == 200


def test_gate_passes_a_repeated_command_while_the_odometry_repeats_too():
    assert repeated(lambda t: ((0.1, -0.2, 0.3), 9.8), range(0, 1000, 10), moving=False) == (None, "")
