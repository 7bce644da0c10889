"""Events of a live run: which error is reported as its failure."""

import time

import pytest

from hil.bus.leaf import Bus, open_hub
from hil.contract.messages import Event
from hil.live.run_events import RunEvents
from tests.unit.hil.bus.test_leaf import free_endpoint

LIMIT_S = 10.0
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
    events.stage = stage
    for error in errors:
        source, _, text = error.partition(": ")
        events.note(Event(0, "error", source, text))
    assert events.failure(troubled) == failure


def test_event_under_the_name_of_another_service_is_no_cause_of_a_failure():
    endpoint = free_endpoint()
    with open_hub(endpoint), Bus(endpoint) as bus, Bus(endpoint, identity="brain") as brain:
        events, until = RunEvents(bus, lambda now_ns, stage: None), time.monotonic() + LIMIT_S
        while not events.errors:
            assert time.monotonic() < until
            brain.publish(1, "event", Event(1, "error", "director", "not hovering"))
            time.sleep(0.02)
            events.take()
        events.stage = "ended"
        assert events.errors[0] == 'brain: (gave "director" as its name) not hovering'
        assert events.failure(troubled=False) == ""
        events.close()
