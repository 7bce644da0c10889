"""A Crazyflie flies to the wall on motion capture alone, in lockstep; when it loses what it needs, it is landed."""

import pytest

from hil.assembly.plan import Plan
from hil.host.flight import fly
from hil.host.replay import replay_run
from hil.recording import provenance
from hil.recording.reader import Recording
from hil.scoring.flight_class import ABORTED, UNSAFE
from scenarios.faults import FaultTable

pytestmark = pytest.mark.slow
CODE = provenance.Code("git", "0.1.0", "a" * 40)


def flown(out, *faults):
    plan = Plan("crazyflie-wall", "crazyflie-sim", None, None, faults=faults)
    return fly(
        plan.scenario, plan.rig, plan.make_policy(), 0, policy_name=plan.policy_name, rig_name="crazyflie-sim",
        pictures="none", out=out, code=CODE, progress=lambda now_ns, what: None,
    )  # fmt: skip


def texts(flight):
    return [entry.message.text for entry in Recording(flight.run.recording).messages(["event"])]


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


@pytest.mark.parametrize(
    ("fault", "told", "why"),
    [
        ({"kind": "policy.nan"}, "", "command is not finite"),
        ({"kind": "mocap.dropout"}, "it no longer knows where it is", "mocap has not published mocap/board"),
        ({"kind": "mavlink.down", "for": 1.0}, "link lost", "no odometry"),
        ({"kind": "battery.sag", "at": 0.3}, "its battery is low", ""),
    ],
)
def test_crazyflie_that_loses_what_it_needs_is_landed(fault, told, why, tmp_path):
    flight = flown(tmp_path, FaultTable.model_validate({"at": 1.0, **fault}))
    found = flight.flight_class
    assert found is not None and found.name == ABORTED, found
    assert any(why in text for text in found.why), found
    assert any(told in text for text in texts(flight)), texts(flight)


def test_crazyflie_whose_radio_stays_lost_falls_as_its_firmware_has_it_and_the_run_says_so(tmp_path):
    """No set-point for 2 s: the firmware stops the motors in the air, whatever this side does."""
    flight = flown(tmp_path, FaultTable.model_validate({"kind": "mavlink.down", "at": 1.0}))
    found = flight.flight_class
    assert found is not None and found.name == UNSAFE and "met the ground" in found.why[0]
    assert any("link lost: no log data" in text for text in texts(flight))
