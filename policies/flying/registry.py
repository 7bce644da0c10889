"""Every policy that can fly, by name."""

from __future__ import annotations

from collections.abc import Callable

from policies.flying.guided import GuidedPolicy
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.shipped import FLYABLE, policy_file
from policies.guidance.params import GuidanceParams
from policies.planner.learned_policy import LearnedPlannerPolicy
from policies.planner.policy import GUIDANCE, PlannerPolicy
from policies.task.interface import FlyingPolicy
from vehicle.quadrotor.airframe import Airframe


def policy_factory(name: str, airframe: Airframe, guidance: bool = True) -> Callable[[], FlyingPolicy]:
    """Makes the policy called `name`: `planner` (it predicts by a network), `planner-analytic`, a shipped network
    (`vision`, `state`), or an ONNX file. With `guidance` the laws of the last half second act on what it asks, but for
    a network whose contract does not want them.

    Raises ContractError for a file that cannot be flown, ValueError for a name that is neither.
    """

    def guided(policy: FlyingPolicy, **changes: float) -> FlyingPolicy:
        return GuidedPolicy(policy, airframe, GuidanceParams.of(airframe, **changes)) if guidance else policy

    if name == "planner":
        return lambda: guided(LearnedPlannerPolicy(airframe), **GUIDANCE)
    if name == "planner-analytic":
        return lambda: guided(PlannerPolicy(airframe), **GUIDANCE)
    file = policy_file(name)
    if file is None or file.suffix != ".onnx":
        raise ValueError(f"no policy {name!r}: use {', '.join(FLYABLE)}, or the path of an .onnx file")
    network = OnnxPolicy(file, airframe)
    policy = guided(network) if network.contract.guidance else network
    return lambda: policy
