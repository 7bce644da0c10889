"""Our plant against a session with a real PX4 firmware: take-off, hover, steps of body rate, landing.

Recorded once: what the firmware asked of the motors in each tick of 4 ms, and now and then what the sensors showed and
where the vehicle was. The same controls must give the same flight.
"""

import numpy as np
import pytest

from tests.paths import ROOT
from tests.unit.vehicle.px4.hitl.test_device import FRAME, TICK, Firmware
from vehicle.px4.hitl import rows
from vehicle.px4.hitl.device import HitlVehicle
from vehicle.px4.hitl.sensors import SensorNoise

SESSION = np.load(ROOT / "tests/data/px4/hitl_session.npz")
NOISE = SensorNoise()


@pytest.fixture(scope="module")
def flown():
    """(truths, readings) at the recorded ticks, flown again under the recorded controls."""
    firmware, wanted = Firmware(), set(SESSION["truth"][:, 0].astype(int))
    body, truths, readings = HitlVehicle(firmware, FRAME, 1, (0.0, 0.0, 0.0), 0.7), [], []
    for tick, motors in enumerate(SESSION["motors"]):
        body.step(tick * TICK)
        body.controls.motors[:] = motors / 1000.0  # exactly, as they were flown
        if tick + 1 in wanted:
            truth = body.truth()
            truths.append((*truth.position, *truth.orientation))
            last = firmware.of("HIL_SENSOR")[-1]
            readings.append(last[1 : 1 + rows.READING_LENGTH])
            firmware.log.clear()
    return np.array(truths), np.array(readings)


def test_recorded_controls_give_the_recorded_flight(flown):
    truths, _ = flown
    assert len(truths) > 100
    assert SESSION["truth"][:, 3].max() > 1.5, "it flew"
    assert np.abs(truths - SESSION["truth"][:, 1:]).max() < 1e-6


def test_sensors_show_what_they_showed(flown):
    _, readings = flown
    assert readings == pytest.approx(SESSION["sensors"], rel=1e-5, abs=1e-5)
