"""A Crazyflie flies to the wall on motion capture alone, in lockstep; when it loses what it needs, it is landed."""

import pytest

from hil.assembly.plan import Plan
from hil.host.flight import fly
from hil.host.replay import replay_run
from hil.recording import provenance
from hil.recording.reader import Recording
from hil.scoring.flight_class import ABORTED
from scenarios.faults import FaultTable

pytestmark = pytest.mark.slow
CODE = provenance.Code("git", "0.1.0", "a" * 40)


def flown(out, *faults):
    plan = Plan("crazyflie-wall", "crazyflie-sim", None, None, faults=faults)
    return fly(
        plan.scenario, plan.rig, plan.make_policy(), 0, policy_name=plan.policy_name, rig_name="crazyflie-sim",
        pictures="none", out=out, code=CODE, progress=lambda now_ns, what: None,
    )  # fmt: skip


def test_crazyflie_perches_on_the_wall_by_motion_capture_and_its_run_replays(tmp_path):
    flight = flown(tmp_path)
    assert flight.failure == ""
    assert flight.score.attached
    recording = Recording(flight.run.recording)
    assert not {"board/detection", "camera/image"} & {
        topic.removeprefix("/perch/") for topic, count in recording.counts().items() if count
    }
    sent = [e.message for e in recording.messages(["vehicle/sent"]) if not e.message.tripped]
    assert max(message.thrust for message in sent) <= 12.75
    assert replay_run(flight.run.path).same


@pytest.mark.parametrize(("kind", "why"), [("policy.nan", "command is not finite"), ("mocap.dropout", "")])
def test_crazyflie_that_loses_what_it_needs_is_landed(kind, why, tmp_path):
    found = flown(tmp_path, FaultTable.model_validate({"kind": kind, "at": 1.0})).flight_class
    assert found is not None and found.name == ABORTED, found
    assert any(why in text for text in found.why), found
