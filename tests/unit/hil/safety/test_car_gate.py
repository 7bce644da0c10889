import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hil.contract.messages import CarCommand, CarFeedback
from hil.safety.car_gate import CarGate
from hil.safety.limits import CarGateLimits

MS = 1_000_000
NOW = 10_000 * MS
any_float = st.floats(allow_nan=True, allow_infinity=True)


def car(speed=0.0, turn_rate=0.0, stamp=NOW - 20 * MS):
    return CarFeedback(stamp, speed, turn_rate, "can", 26.0, "", 0)


def command(speed=1.0, turn_rate=0.5, stamp=NOW):
    return CarCommand(stamp, speed, turn_rate)


def test_car_gate_passes_commands_within_the_limits_unchanged():
    gate = CarGate(CarGateLimits())
    assert gate.check(NOW, command(), car()) == command()
    assert gate.check(NOW, command(), None) == command(), "no feedback yet; the driver waits for it"


@given(any_float, any_float)
def test_car_gate_never_passes_a_command_outside_the_limits(speed, turn_rate):
    limits = CarGateLimits(speed=2.0, turn_rate=1.0)
    gate = CarGate(limits)
    passed = gate.check(NOW, command(speed, turn_rate), car())
    if passed is None:
        assert gate.tripped == "command is not finite"
        assert not (math.isfinite(speed) and math.isfinite(turn_rate))
    else:
        assert abs(passed.speed) <= 2.0
        assert abs(passed.turn_rate) <= 1.0
        if abs(speed) <= 2.0:
            assert passed.speed == speed


@pytest.mark.parametrize(
    ("asked", "feedback", "why"),
    [
        (command(math.nan), car(), "command is not finite"),
        (command(1.0, math.inf), car(), "command is not finite"),
        (command(), car(speed=-3.6), "car at -3.6 m/s, limit 3.5"),
        (command(), car(turn_rate=4.1), "car turns at 4.1 rad/s, limit 4"),
        (command(), car(stamp=NOW + 6 * MS), "feedback of the car is stamped 6.0 ms later than now"),
        (command(), car(speed=math.nan), "feedback of the car is not finite"),
        (command(), car(turn_rate=math.inf), "feedback of the car is not finite"),
        (command(), car(stamp=NOW - 600 * MS), "no feedback of the car for 500 ms"),
    ],
)
def test_trip_of_the_car_gate_latches(asked, feedback, why):
    gate = CarGate(CarGateLimits())
    assert gate.check(NOW, asked, feedback) is None
    assert gate.tripped == why
    assert gate.check(NOW + MS, command(stamp=NOW + MS), car(stamp=NOW)) is None, "for good"
    assert gate.tripped == why


@pytest.mark.parametrize("age_ms", [101, 5_000, -1])
def test_car_gate_drops_old_and_future_commands_without_a_trip(age_ms):
    gate = CarGate(CarGateLimits())
    assert gate.check(NOW, command(stamp=NOW - age_ms * MS), car()) is None
    assert (gate.tripped, gate.refused) == ("", 1)
    assert gate.check(NOW, command(stamp=NOW - 99 * MS), car()) is not None
