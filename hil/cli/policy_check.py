"""Whether a policy file can be flown with a rig: the checks of a run, one after the other."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np

from hil.assembly.cameras import camera_contract
from hil.assembly.rig import load_rig
from policies.flying.contract import ContractError, check_contract
from policies.flying.onnx_file import OpenedPolicy, open_policy
from policies.flying.shipped import policy_file
from policies.flying.trial import STRIDE, distance, latency, recorded_observations, try_policy
from vehicle.quadrotor.airframe import load_airframe


@dataclass(frozen=True)
class Finding:
    """One check of a policy file: what it found, or why the file is refused."""

    check: str
    ok: bool
    text: str


def check_policy(policy: str, rig_name: str) -> list[Finding]:
    """The findings on a policy file (or a shipped network's name) for a rig. Those that a fault leaves without meaning
    are left out.

    Raises ValueError for a policy without a file, ConfigError for a rig that cannot be read.
    """
    rig = load_rig(rig_name)
    airframe = load_airframe(rig.vehicle.airframe)
    file = policy_file(policy)
    if file is None:
        raise ValueError(f"policy {policy!r} has no file to check: give the path of an .onnx file")
    try:
        network = open_policy(file)
    except ContractError as error:
        return [Finding("file", False, str(error))]
    contract = network.contract
    found = [Finding("file", True, f"{file}: sha256 {network.sha256}")]
    try:
        camera = camera_contract(rig.camera, airframe)
        stage = "state" if rig.policy.knows == "mocap" else "vision"
        check_contract(contract, airframe=airframe, camera=camera, stage=stage)
        text = f"{contract.name}: for {airframe.name} and its camera, by recipe {contract.provenance.recipe}"
        found.append(Finding("contract", True, text))
    except ContractError as error:
        found.append(Finding("contract", False, str(error)))
    try:
        actions = try_policy(network)
    except ContractError as error:
        return [*found, Finding("answers", False, str(error))]
    found.append(Finding("answers", True, f"to {len(actions)} recorded observations: finite, in [-1, 1]"))
    try:
        found.append(Finding("latency", True, f"{1e3 * latency(network, time.perf_counter):.2f} ms an answer"))
    except ContractError as error:
        found.append(Finding("latency", False, str(error)))
    return [*found, Finding("difference", True, _difference(network, actions))]


def _difference(network: OpenedPolicy, actions: np.ndarray) -> str:
    """How far its answers are from the shipped network's, or why that cannot be told."""
    shipped = policy_file("vision")
    assert shipped is not None  # it comes with the project
    other = open_policy(shipped)
    theirs = other.contract
    if network.contract.observation.stride != STRIDE or network.contract.action != theirs.action:
        return "not told: its history or its action limits are not those of the shipped network"
    if other.sha256 == network.sha256:
        return "it is the shipped network"
    apart = distance(actions, other.run(recorded_observations()), theirs.action)
    return (
        f"from the shipped vision, median and most: {apart.rate[0]:.2f} and {apart.rate[1]:.2f} rad/s, "
        f"{apart.thrust[0]:.2f} and {apart.thrust[1]:.2f} m/s^2"
    )
