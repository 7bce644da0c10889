"""What is to be flown: scenario, rig and policy as they were asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hil.assembly.cameras import camera_contract
from hil.assembly.node_table import fault_setting
from hil.assembly.recorded_motion import identified
from hil.assembly.rig import Rig, chosen_rig, load_rig
from hil.faults.kinds import check_faults
from hil.recording.runs import RunError, policy_identity
from kernel.toml_errors import ConfigError
from policies.flying.registry import POLICY, PolicyFactory, policy_factory
from policies.flying.trial import latency
from scenarios.faults import FaultTable
from scenarios.spec import Scenario, load
from vehicle.quadrotor.airframe import Airframe, load_airframe


def rig_policy(name: str, rig: Rig) -> PolicyFactory:
    """The policy called `name`, checked against the rig: its airframe, by what it knows of the board, and its camera as
    calibrated and mounted.

    Raises what `policy_factory` raises.
    """
    airframe = load_airframe(rig.vehicle.airframe)
    camera = None if rig.policy.knows == "mocap" else camera_contract(rig.camera, airframe)
    stage = "state" if camera is None else "vision"
    return policy_factory(name, airframe, guidance=rig.policy.guidance, camera=camera, stage=stage)


class Plan:
    """What was asked for, read and checked: nothing is written before this succeeds."""

    def __init__(
        self,
        scenario: str,
        rig: str | None,
        policy: str | None,
        camera: str | None,
        *,
        faults: Sequence[FaultTable] = (),
        live: bool = False,
        policy_of: Callable[[str, Rig], PolicyFactory] = rig_policy,
    ) -> None:
        """`rig`: a name or a path, None for the scenario's own. `faults` are flown besides the scenario's own.
        `policy_of`: opens the policy, so that many plans can share one.

        Raises ConfigError, ContractError or ValueError: one line each.
        """
        self.scenario: Scenario = load(scenario)
        self.rig_name = chosen_rig(self.scenario, rig)
        if faults:
            self.scenario = self.scenario.model_copy(update={"fault": (*self.scenario.fault, *faults)})
        self.rig: Rig = load_rig(self.rig_name)
        if camera is not None:
            source = self.rig.camera.model_copy(update={"source": camera})
            self.rig = self.rig.model_copy(update={"camera": source})
        if live and self.rig.vehicle.deterministic:
            raise ConfigError("[vehicle] deterministic = true is for flights in lockstep: fly without --live")
        self.scenario = identified(self.scenario)
        check_faults(self.scenario.fault, fault_setting(self.rig, live=live))
        self.policy_name = policy or self.rig.policy.kind
        self.airframe: Airframe = load_airframe(self.rig.vehicle.airframe)
        self.make_policy: PolicyFactory = policy_of(self.policy_name, self.rig)

    def check_latency(self, stopwatch: Callable[[], float]) -> None:
        """Raise ContractError if the policy is too slow for this computer, by `stopwatch` (s); in real time only."""
        if self.make_policy.network is not None:
            latency(self.make_policy.network, stopwatch)

    def check_unchanged(self) -> None:
        """Raise RunError if the policy's file is not what it was when it was read: a run's manifest holds its digest.

        Raises ProvenanceError if it cannot be read.
        """
        read = self.make_policy.digests.get(POLICY)
        if read not in (None, policy_identity(self.policy_name).get("sha256")):
            raise RunError(f"policy {self.policy_name} was changed since it was read: start again")
