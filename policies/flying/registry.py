"""Every policy that can fly, by name."""

from __future__ import annotations

from collections.abc import Callable

from policies.flying.contract import CameraContract
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.shipped import FLYABLE, policy_file
from policies.planner.learned_policy import LearnedPlannerPolicy
from policies.planner.policy import PlannerPolicy
from policies.task.interface import FlyingPolicy
from vehicle.quadrotor.airframe import Airframe


def policy_factory(name: str, airframe: Airframe, camera: CameraContract | None = None) -> Callable[[], FlyingPolicy]:
    """Makes the policy called `name`: `planner` (it predicts by a network), `planner-analytic`, a shipped network
    (`vision`, `state`), or an ONNX file.

    Raises ContractError for a file that cannot be flown, ValueError for a name that is neither.
    """
    if name == "planner":
        return lambda: LearnedPlannerPolicy(airframe)
    if name == "planner-analytic":
        return lambda: PlannerPolicy(airframe)
    file = policy_file(name)
    if file is None or file.suffix != ".onnx":
        raise ValueError(f"no policy {name!r}: use {', '.join(FLYABLE)}, or the path of an .onnx file")
    policy = OnnxPolicy(file, airframe, camera)
    return lambda: policy
