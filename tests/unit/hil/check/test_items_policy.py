"""Items of the policy: made for this rig, the file that was asked for, or none."""

from dataclasses import replace

import pytest

from hil.check.catalogue import checks
from hil.check.judge import Outcome
from tests.unit.hil.check.made_up import context as make_context
from tests.unit.hil.check.preflight import result


class TestPolicy:
    @pytest.fixture
    def policy(self, tmp_path):
        onnx = pytest.importorskip("onnx")
        import numpy as np

        from policies.flying.contract import METADATA_KEY, Contract, Provenance
        from policies.task.observation import OBS_DIM
        from vehicle.quadrotor.airframe import load_airframe

        def make(**changes):
            h = onnx.helper
            weight = onnx.numpy_helper.from_array(np.zeros((OBS_DIM, 4), dtype=np.float32), "w")
            kind = onnx.TensorProto.FLOAT
            graph = h.make_graph(
                [h.make_node("MatMul", ["observation", "w"], ["action"])],
                "g",
                [h.make_tensor_value_info("observation", kind, [1, OBS_DIM])],
                [h.make_tensor_value_info("action", kind, [1, 4])],
                [weight],
            )
            model = h.make_model(graph, opset_imports=[h.make_opsetid("", 17)], ir_version=8)
            origin = Provenance(recipe="r", seed=1, samples=2)
            airframe = load_airframe("paper_quad")
            described = Contract.of(airframe, name="p", stage="vision", provenance=origin).model_copy(update=changes)
            h.set_model_props(model, {METADATA_KEY: described.model_dump_json()})
            onnx.save(model, tmp_path / "p.onnx")
            return replace(make_context(tmp_path), policy=str(tmp_path / "p.onnx"))

        return make

    def test_a_policy_made_for_this_rig_passes(self, policy):
        assert result(policy(), "policy.contract").outcome is Outcome.PASS

    def test_a_policy_for_another_airframe_fails(self, policy):
        judged = result(policy(airframe="crazyflie"), "policy.contract")
        assert (judged.outcome, "crazyflie" in judged.reason) == (Outcome.FAIL, True)

    def test_policy_item_compares_the_required_hash(self, policy):
        context = policy()
        found = checks()["policy.hash"].function(context).value
        assert result(context, "policy.hash", sha256=found).outcome is Outcome.PASS
        assert result(context, "policy.hash", sha256="0" * 64).outcome is Outcome.FAIL

    def test_policy_item_fails_on_a_missing_file(self, tmp_path):
        context = replace(make_context(tmp_path), policy=str(tmp_path / "gone.onnx"))
        assert result(context, "policy.contract").outcome is Outcome.FAIL
        assert result(context, "policy.hash").outcome is Outcome.FAIL
