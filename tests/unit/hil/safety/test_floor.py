"""A vehicle that is down, as motion capture sees it, and what is mistaken for one."""

import math

import pytest

from hil.contract.messages import VehicleState
from hil.safety.floor import FloorWatch

MS = 1_000_000
ZERO, LEVEL = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)


def noise(k):
    """m, of one sample: less than a millimetre, and never twice the same in a row."""
    return 5e-4 * math.sin(2.4 * k)


def found_s(place, until_s=15.0, period_ms=10):
    """When it is found to be down, for the positions `place(s, k)`, each sample offered twice; None: never."""
    watch = FloorWatch()
    for k in range(int(until_s * 1000 / period_ms)):
        seconds = k * period_ms / 1000
        position = place(seconds, k)
        if position is None:
            continue
        sample = VehicleState(k * period_ms * MS, position, ZERO, LEVEL, ZERO)
        if watch.add(sample) or watch.add(sample):
            return seconds
    return None


def test_no_sample_is_no_finding():
    assert not FloorWatch().add(None)


@pytest.mark.parametrize(
    "place",
    [
        pytest.param(lambda t, k: (1.0 + noise(k), 2.0, 0.12), id="it lies"),
        pytest.param(lambda t, k: (0.3 * t, 2.0, 0.15 + 0.15 * math.sin(9.0 * t)), id="it hops"),
    ],
)
def test_vehicle_on_the_floor_is_found_after_eight_seconds(place):
    assert found_s(place) == pytest.approx(8.0, abs=0.03)


def test_time_counts_from_the_last_sample_in_the_air():
    assert found_s(lambda t, k: (noise(k), 2.0, max(0.1, 2.0 - 0.7 * t))) == pytest.approx(8.0 + 1.6 / 0.7, abs=0.03)


@pytest.mark.parametrize(
    "place",
    [
        pytest.param(lambda t, k: (1.0 + noise(k), 2.0, 0.6), id="on the board"),
        pytest.param(lambda t, k: (1.0, 2.0, 0.12), id="one pose repeated"),
        pytest.param(lambda t, k: (math.nan, 2.0, math.nan), id="not finite"),
        pytest.param(lambda t, k: (noise(k), 2.0, 0.12) if t % 4.0 < 3.0 else None, id="hidden for a second"),
        pytest.param(lambda t, k: (noise(k), 2.0, 0.12 if t % 4.0 < 3.0 else 0.5), id="off the floor at times"),
        pytest.param(lambda t, k: (noise(k), 2.0, -3.0), id="below the floor"),
    ],
)
def test_vehicle_that_is_not_known_to_be_down_is_not_found(place):
    assert found_s(place) is None
