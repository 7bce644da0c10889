"""After contact: a vehicle that is held, and one that falls, seen by its odometry only."""

import math

import pytest

from hil.contract.messages import VehicleState
from hil.safety.magnet import MagnetCheck

MS = 1_000_000
ZERO, LEVEL = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


def decided(climb, until_ms=400, late_ms=10):
    """(decision, ms after contact) for odometry of 100 Hz that is `late_ms` old, with vertical speed `climb(s)`."""
    check = MagnetCheck(0)
    for t in range(0, until_ms, 2):
        stamp = max(0, (t - late_ms) // 10 * 10)
        hold = check.judge(t * MS, VehicleState(stamp * MS, ZERO, (2.0, 0.0, climb(stamp * 1e-3)), LEVEL, ZERO))
        if hold != "unknown":
            return hold, t
    return "unknown", until_ms


@pytest.mark.parametrize("speed", [0.0, 0.45, -0.45])
def test_vehicle_that_moves_with_the_board_is_held(speed):
    hold, after_ms = decided(lambda t: speed)
    assert hold == "held" and 80 <= after_ms <= 102


@pytest.mark.parametrize("phase", [0.0, 0.5, 1.0, 1.5])
def test_vehicle_on_a_board_that_heaves_is_held(phase):
    assert decided(lambda t: 0.15 * math.pi * math.cos(math.pi * (t + phase)))[0] == "held"


def falling(start, thrust, tilt_deg):
    """Vertical speed of a vehicle that is not held: `thrust` m/s^2 at contact goes to 2.0 with a lag of 35 ms."""
    upright = math.cos(math.radians(tilt_deg))

    def speed(t):
        lagged = 0.035 * (1.0 - math.exp(-t / 0.035))
        return start - 9.81 * t + upright * (2.0 * t + (thrust - 2.0) * lagged)

    return speed


@pytest.mark.parametrize("start", [-1.2, -0.3, 0.5])
@pytest.mark.parametrize("thrust", [4.8, 9.8, 14.8])
@pytest.mark.parametrize("tilt_deg", [0.0, 30.0, 60.0, 90.0])
def test_vehicle_that_is_not_held_is_seen_to_fall_within_a_tenth_of_a_second(start, thrust, tilt_deg):
    hold, after_ms = decided(falling(start, thrust, tilt_deg))
    assert hold == "falls" and after_ms <= 100


def test_vehicle_without_odometry_counts_as_falling():
    check = MagnetCheck(0)
    assert [check.judge(t * MS, None) for t in (0, 100, 152)] == ["unknown", "unknown", "falls"]


def test_decision_stands():
    check = MagnetCheck(0)
    assert check.judge(200 * MS, None) == "falls"
    assert check.judge(300 * MS, VehicleState(290 * MS, ZERO, ZERO, LEVEL, ZERO)) == "falls"
