"""What is to be flown: scenario, rig and policy as they were asked for."""

from __future__ import annotations

from collections.abc import Callable

from hil.assembly.rig import Rig, load_rig
from policies.flying.registry import policy_factory
from policies.task.interface import FlyingPolicy
from scenarios.spec import Scenario, load
from vehicle.quadrotor.airframe import load_airframe


class Plan:
    """What was asked for, read and checked: nothing is written before this succeeds."""

    def __init__(self, scenario: str, rig: str, policy: str | None, camera: str | None) -> None:
        """Raises ConfigError, ContractError or ValueError: one line each."""
        self.scenario: Scenario = load(scenario)
        self.rig: Rig = load_rig(rig)
        if camera is not None:
            source = self.rig.camera.model_copy(update={"source": camera})
            self.rig = self.rig.model_copy(update={"camera": source})
        self.policy_name = policy or self.rig.policy.kind
        airframe = load_airframe(self.rig.vehicle.airframe)
        self.make_policy: Callable[[], FlyingPolicy] = policy_factory(
            self.policy_name, airframe, guidance=self.rig.policy.guidance
        )
