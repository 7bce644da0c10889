"""Items of the policy: made for this rig, the file that was asked for, or none."""

from dataclasses import replace

import pytest

from hil.assembly.rig import Calibration, CameraSlot
from hil.check.catalogue import checks
from hil.check.judge import Outcome
from tests.unit.hil.check.made_up import context as make_context
from tests.unit.hil.check.preflight import result


class TestPolicy:
    @pytest.fixture
    def policy(self, tmp_path):
        pytest.importorskip("onnx")
        from tests.unit.policies.flying.made_networks import CONTRACT, write

        def make(camera=None, /, weight=0.001, **changes):
            text = CONTRACT.model_copy(update=changes).model_dump_json()
            context = replace(make_context(tmp_path), policy=str(write(tmp_path / "p.onnx", text, weight=weight)))
            return (
                context if camera is None else replace(context, rig=context.rig.model_copy(update={"camera": camera}))
            )

        return make

    def test_a_policy_made_for_this_rig_passes(self, policy):
        assert result(policy(), "policy.contract").outcome is Outcome.PASS

    def test_a_policy_for_another_airframe_fails(self, policy):
        judged = result(policy(airframe="crazyflie"), "policy.contract")
        assert (judged.outcome, "crazyflie" in judged.reason) == (Outcome.FAIL, True)

    def test_a_policy_for_the_true_state_fails(self, policy):
        judged = result(policy(stage="state"), "policy.contract")
        assert (judged.outcome, "stage state" in judged.reason) == (Outcome.FAIL, True)

    def test_a_camera_that_sees_otherwise_than_the_one_trained_with_fails(self, policy):
        lens = Calibration(width=320, height=240, fx=300.0, fy=300.0, cx=159.5, cy=119.5)
        camera = CameraSlot(kind="v4l2", device="/dev/video0", calibration=lens)
        judged = result(policy(camera), "policy.contract")
        assert (judged.outcome, "left edge is at" in judged.reason) == (Outcome.FAIL, True)
        near = CameraSlot(kind="v4l2", device="/dev/video0", calibration=Calibration(fx=731.0, fy=730.5, cx=645.0))
        assert result(policy(near), "policy.contract").outcome is Outcome.PASS

    def test_a_policy_with_answers_that_cannot_be_flown_fails(self, policy):
        judged = result(policy(weight=float("nan")), "policy.contract")
        assert (judged.outcome, "not finite" in judged.reason) == (Outcome.FAIL, True)

    def test_policy_item_compares_the_required_hash(self, policy):
        context = policy()
        found = checks()["policy.hash"].function(context).value
        assert result(context, "policy.hash", sha256=found).outcome is Outcome.PASS
        assert result(context, "policy.hash", sha256="0" * 64).outcome is Outcome.FAIL

    def test_policy_item_fails_on_a_missing_file(self, tmp_path):
        context = replace(make_context(tmp_path), policy=str(tmp_path / "gone.onnx"))
        assert result(context, "policy.contract").outcome is Outcome.FAIL
        assert result(context, "policy.hash").outcome is Outcome.FAIL
