"""The software PX4 flies a whole attempt on nothing but what motion capture sees of it, through our driver."""

import math

import pytest

from hil.assembly.plan import Plan
from hil.assembly.rig import load_rig
from hil.host.flight import fly
from hil.recording import provenance
from hil.recording.reader import Recording

pytestmark = pytest.mark.slow


def test_flight_with_motion_capture_only_completes(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('title = "motion capture feeds the autopilot"\n[vehicle]\nexternal_pose = true\n')
    plan = Plan("simple-i", str(path), None, "model")
    assert load_rig(str(path)).vehicle.external_pose
    flight = fly(
        plan.scenario, plan.rig, plan.make_policy(), 0, policy_name=plan.policy_name, rig_name="mine", pictures="none",
        out=tmp_path / "runs", code=provenance.code(), progress=lambda now_ns, what: None,
    )  # fmt: skip
    assert flight.failure == ""
    assert flight.score.attached
    recording = Recording(flight.run.path)
    truth = {e.message.stamp_ns: e.message for e in recording.messages(["truth/vehicle"])}
    believed = [e.message for e in recording.messages(["vehicle/odometry"])]
    lead_ns = next(e.log_ns for e in recording.messages(["run/stage"]) if e.message.name != "prepare")
    errors = [
        math.dist(b.position, truth[b.stamp_ns].position)
        for b in believed
        if b.stamp_ns in truth and b.stamp_ns > lead_ns
    ]
    assert len(errors) > 50
    assert sorted(errors)[len(errors) // 2] < 0.05, "the estimate follows motion capture"
