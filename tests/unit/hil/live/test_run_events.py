"""What a live run says about itself when it ends: whose words are its failure."""

import pytest

from hil.bus.leaf import Bus, open_hub
from hil.live.run_events import RunEvents
from tests.unit.hil.bus.test_leaf import free_endpoint

DIRECTOR, GATE = "director: not hovering after 90 s", "gate: gate tripped: age"


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
        ([GATE, DIRECTOR], "ended", False, DIRECTOR),
        ([GATE], "lead", False, GATE),
        ([DIRECTOR, GATE, GATE, GATE], "attempt", True, f"{GATE}; {GATE}; {GATE}"),
    ],
)
def test_the_failure_of_a_run(events, errors, stage, troubled, failure):
    events.errors, events.stage = errors, stage
    assert events.failure(troubled) == failure
