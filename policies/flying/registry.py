"""Every policy that can fly, by name."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from policies.flying.contract import CameraContract, ContractError, check_contract
from policies.flying.guided import GuidedPolicy
from policies.flying.onnx_file import OpenedPolicy, open_policy
from policies.flying.onnx_policy import OnnxPolicy
from policies.flying.shipped import FLYABLE, policy_file
from policies.flying.trial import try_policy
from policies.guidance.params import GuidanceParams
from policies.planner.learned_policy import LearnedPlannerPolicy
from policies.planner.policy import GUIDANCE, PlannerPolicy
from policies.prediction.learned import CHECKPOINT, read_predictor
from policies.task.interface import FlyingPolicy
from vehicle.quadrotor.airframe import Airframe

POLICY, PREDICTOR = "policy file", "motion predictor"  # what a policy may read from a file


@dataclass(frozen=True)
class PolicyFactory:
    """Makes one policy, which was read and checked. `digests`: sha256 of what was read from a file, by what it is
    (POLICY, PREDICTOR); `network`: the file's, None for a planner."""

    make: Callable[[], FlyingPolicy]
    digests: Mapping[str, str]
    network: OpenedPolicy | None = None

    def __call__(self) -> FlyingPolicy:
        """The policy, to be reset before it is stepped."""
        return self.make()


def policy_factory(
    name: str,
    airframe: Airframe,
    guidance: bool = True,
    camera: CameraContract | None = None,
    stage: Literal["state", "vision"] | None = None,
) -> PolicyFactory:
    """Makes the policy called `name`: `planner` (it predicts by a network), `planner-analytic`, the shipped network
    `vision`, or an ONNX file. With `guidance` the laws of the last half second act on what it asks, but for a network
    whose contract does not want them.

    `camera`: as the rig has it; the policy must then be one for that camera. `stage`: how it must know of the board, by
    motion capture (state) or a camera (vision); None: by either.

    Raises ContractError for a file that cannot be flown, ValueError for a name that is neither.
    """

    by_state = stage == "state"

    def guided(policy: FlyingPolicy, **fields: float) -> FlyingPolicy:
        return GuidedPolicy(policy, airframe, GuidanceParams.of(airframe, by_state, **fields)) if guidance else policy

    if name == "planner":
        try:
            data = CHECKPOINT.read_bytes()
        except OSError as error:
            raise ContractError(
                f"the motion predictor {CHECKPOINT} cannot be read: {error.strerror}; train one with python -m "
                "policies.prediction.learned_training, or fly planner-analytic"
            ) from None
        net, digests = read_predictor(data, CHECKPOINT), {PREDICTOR: hashlib.sha256(data).hexdigest()}
        return PolicyFactory(lambda: guided(LearnedPlannerPolicy(airframe, net, by_state), **GUIDANCE), digests)
    if name == "planner-analytic":
        return PolicyFactory(lambda: guided(PlannerPolicy(airframe, by_state), **GUIDANCE), {})
    file = policy_file(name)
    if file is None or file.suffix != ".onnx":
        raise ValueError(f"no policy {name!r}: use {', '.join(FLYABLE)}, or the path of an .onnx file")
    network = open_policy(file)
    check_contract(network.contract, airframe=airframe, camera=camera, stage=stage)
    try_policy(network)
    policy = OnnxPolicy(network, airframe)
    made = guided(policy) if network.contract.guidance else policy
    return PolicyFactory(lambda: made, {POLICY: network.sha256}, network)
