"""What is measured of an attempt that the gate cut off."""

from types import SimpleNamespace

import numpy as np

from hil.campaign.quantities import Attempt, quantities
from hil.contract.messages import Sent, Stage, VehicleState

MS = 1_000_000
START, TRIPPED, END = 1_000 * MS, 2_000 * MS, 3_000 * MS


def recording():
    """A hovering vehicle: commands until the gate trips at 2 s, the stage attempt until 3 s."""
    found = [(START, "run/stage", Stage(START, "attempt", START, 0))]
    for t in range(START, END, 10 * MS):
        still = VehicleState(t, (0.0, 0.0, 2.0), (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        found.append((t, "vehicle/odometry", still))
        if t < TRIPPED:
            found.append((t, "vehicle/sent", Sent(t, (0.1, 0.0, 0.0), 9.80665, 0.4, False, "")))
    found.append((TRIPPED, "vehicle/sent", Sent(TRIPPED, (0.0, 0.0, 0.0), 0.0, 0.0, False, "too fast")))
    found.append((END, "run/stage", Stage(END, "ended", START, 0)))
    topics = {f"/perch/{topic}" for _, topic, _ in found}
    return SimpleNamespace(topics=topics, messages=lambda wanted: iter(sorted(found, key=lambda one: one[0])))


def test_attempt_ends_when_the_gate_trips():
    attempt = Attempt(recording())
    assert attempt.end_ns == TRIPPED
    assert attempt.track("vehicle/sent", lambda m: m.thrust).t[-1] < TRIPPED * 1e-9


def test_thrust_is_measured_by_the_commands_that_were_sent():
    found = {one.name: one.samples for one in quantities(Attempt(recording()))}
    thrust = found["thrust, achieved over asked"]
    assert len(thrust) > 10
    assert np.allclose(thrust, 1.0, atol=1e-3)
