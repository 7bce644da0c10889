import pytest

from hil.contract.messages import Contact, Stage, VehicleStatus
from hil.nodes.director import Director
from tests.unit.hil.contract.node_fakes import filled

MS = 1_000_000
LEAD, LIMIT, AFTER = 2_000 * MS, 60_000 * MS, 400 * MS


def status(phase):
    return VehicleStatus(0, True, True, False, False, "AUTO.LOITER", phase, 15.0, 0.0)


def verdict(outcome):
    return Contact(0, outcome, "", False, False, 0.0, 0.0, 0.0, 0.0, 0.0)


class Run:
    """A director and what it has published."""

    def __init__(self):
        self.director = Director(LEAD, LIMIT, AFTER)
        self.inbox = filled(self.director)
        self.stages, self.events = [], []

    def at(self, ms, **given):
        for topic, message in given.items():
            self.inbox.put(topic.replace("_", "/"), message)
        outs = self.director.step(ms * MS, self.inbox)
        self.inbox.clear()
        self.events += [out.message for out in outs if out.topic == "event"]
        (stage,) = [out.message for out in outs if out.topic == "run/stage"]
        self.stages.append(stage.name)
        return stage


def test_run_passes_its_stages_at_the_right_times():
    run = Run()
    assert run.at(0) == Stage(0, "prepare", 0, 0)
    run.at(5_000, vehicle_status=status("takeoff"))
    hover = run.at(9_000, vehicle_status=status("hover"))
    assert hover == Stage(9_000 * MS, "lead", 11_000 * MS, 9_000 * MS)
    assert run.at(10_990).name == "lead"
    assert run.at(11_000) == Stage(11_000 * MS, "attempt", 11_000 * MS, 9_000 * MS)
    assert run.at(12_000, referee_contact=verdict("ongoing")).name == "attempt"
    assert run.at(13_000, referee_contact=verdict("success")).name == "attempt"
    assert run.at(13_390).name == "attempt", "what follows the verdict is recorded too"
    assert run.at(13_400).name == "ended"
    assert run.at(20_000).name == "ended"
    assert run.director.failure == ""
    assert [event.text for event in run.events] == ["stage lead", "stage attempt", "stage ended"]
    assert {event.severity for event in run.events} == {"info"}


def test_a_stage_is_published_at_once_and_then_again_twenty_times_a_second():
    director = Director(LEAD, LIMIT, AFTER)
    inbox = filled(director)
    stages = []
    for ms in range(0, 200, 10):
        if ms == 120:
            inbox.put("vehicle/status", status("hover"))
        stages += [(ms, out.message.name) for out in director.step(ms * MS, inbox) if out.topic == "run/stage"]
    assert stages == [(0, "prepare"), (50, "prepare"), (100, "prepare"), (120, "lead"), (170, "lead")]


def test_run_ends_after_a_failed_attempt_as_after_a_success():
    run = Run()
    run.at(0, vehicle_status=status("hover"))
    run.at(2_000)
    run.at(3_000, referee_contact=verdict("fail"))
    assert run.at(3_400).name == "ended"
    assert run.director.failure == "", "a miss is a result, not a failure to run"


def test_a_verdict_before_the_attempt_is_ignored():
    run = Run()
    run.at(0, vehicle_status=status("hover"), referee_contact=verdict("ongoing"))
    assert [run.at(t).name for t in (100, 1_000, 1_990)] == ["lead"] * 3


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (status("failed"), "the vehicle did not reach its start (failed)"),
        (status("interrupted"), "the vehicle did not reach its start (interrupted)"),
        (status("killed"), "the vehicle did not reach its start (killed)"),
        (status("takeoff"), "not hovering at its start after 60 s (phase takeoff)"),
        (None, "not hovering at its start after 60 s (phase unknown)"),
    ],
)
def test_attempt_does_not_start_without_a_hover(given, words):
    run = Run()
    run.at(0, **({"vehicle_status": given} if given else {}))
    run.at(60_000)
    assert run.stages[-1] == ("ended" if given and given.phase != "takeoff" else "prepare")
    run.at(60_050)
    assert run.stages[-1] == "ended"
    assert words in run.director.failure
    assert run.events[-1].severity == "error"
    assert words in run.events[-1].text


@pytest.mark.parametrize("phase", ["failed", "interrupted", "killed"])
def test_vehicle_lost_before_the_attempt_is_not_a_miss(phase):
    run = Run()
    run.at(0, vehicle_status=status("hover"))
    run.at(1_000, vehicle_status=status(phase))
    assert run.stages[-1] == "ended"
    assert run.director.failure == f"the vehicle was lost before the attempt ({phase})"
    assert run.events[-1].severity == "error"


def test_once_the_attempt_has_begun_only_the_verdict_ends_it():
    run = Run()
    run.at(0, vehicle_status=status("hover"))
    run.at(2_000)
    run.at(2_500, vehicle_status=status("interrupted"))
    assert run.stages[-1] == "attempt"
    run.at(3_000, vehicle_status=status("killed"), referee_contact=verdict("success"))
    assert run.at(3_400).name == "ended"
    assert run.director.failure == ""
