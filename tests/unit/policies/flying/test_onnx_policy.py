"""Policies as a flight steps them."""

import pytest

from hil.contract.messages import Belief, VehicleState
from policies.flying.onnx_file import open_policy
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.registry import policy_factory
from policies.flying.shipped import SHIPPED, policy_file
from policies.task import history_row
from tests.unit.policies.flying.made_networks import made_for
from vehicle.quadrotor.airframe import load_airframe

MS = 1_000_000
AIRFRAME = load_airframe("paper_quad")


def test_policy_acts_on_a_picture_between_ticks_and_history_keeps_its_stride():
    policy = OnnxPolicy(open_policy(policy_file("vision")), AIRFRAME)
    policy.reset(0)

    def act(now_ms, tick_ms, ahead):
        odometry = VehicleState(tick_ms * MS, (0.0, 0.0, 2.0), (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3)
        board = Belief(
            now_ms * MS, True, (ahead, 0.0, 1.0), 0.0, 1.0, 0.0, 1.0, 1.0, 0, 9, 0, (0.0,) * 8, 0.0, 9, 0.01
        )  # fmt: skip
        return policy.step(now_ms * MS, odometry, board)

    act(10, 10, 3.0)
    late = act(16, 10, 2.5)
    assert late != act(16, 10, 3.0)  # the picture changes the command
    act(20, 20, 2.5)
    assert policy._builder._row[history_row.FILL] == 2.0


@pytest.mark.parametrize("name", [*SHIPPED, "planner", "planner-analytic"])
def test_shipped_policy_opens_by_name_from_any_folder(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    policy = policy_factory(name, made_for(name))()
    policy.reset(0)
