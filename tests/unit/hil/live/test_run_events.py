"""Events of a live run: which error is reported as its failure."""

import pytest

from hil.bus.leaf import Bus, open_hub
from hil.live.run_events import RunEvents
from tests.unit.hil.bus.test_leaf import free_endpoint

DIRECTOR, GATE = "director: not hovering after 90 s", "gate: gate tripped: age"
ARMED, LATER = "vehicle_link: the vehicle is already armed", "vehicle_link: link lost"


@pytest.fixture
def events():
    endpoint = free_endpoint()
    with open_hub(endpoint), Bus(endpoint) as bus:
        one = RunEvents(bus, lambda now_ns, stage: None)
        yield one
        one.close()


@pytest.mark.parametrize(
    ("errors", "stage", "troubled", "failure"),
    [
        ([], "ended", False, ""),
        ([GATE], "ended", False, ""),  # an attempt that failed, not a run that did
        ([GATE, DIRECTOR], "ended", False, "not hovering after 90 s"),
        ([ARMED, DIRECTOR, LATER], "ended", False, "not hovering after 90 s: the vehicle is already armed"),
        ([GATE], "lead", False, GATE),
        ([DIRECTOR, GATE, GATE, GATE], "attempt", True, f"{GATE}; {GATE}; {GATE}"),
    ],
)
def test_failure_of_a_run_follows_from_errors_and_stage(events, errors, stage, troubled, failure):
    events.errors, events.stage = errors, stage
    assert events.failure(troubled) == failure
