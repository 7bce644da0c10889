"""Automatic checks of the policy's file."""

from __future__ import annotations

import math

from hil.bench.devices import Context
from hil.bench.reading import NotApplicable
from hil.check.judge import Reading
from hil.check.registry import check
from hil.recording.provenance import ProvenanceError, file_sha256
from policies.flying.contract import CameraContract, ContractError, check_contract, open_policy
from policies.flying.shipped import policy_file

_BUILT_IN = "the policy is built in: it has no file"


@check("policy.contract")
def contract(context: Context) -> Reading:
    """The policy's contract against this program, the rig's airframe and camera, and the scenario."""
    file = policy_file(context.policy)
    if file is None:
        raise NotApplicable(_BUILT_IN)
    mount = context.airframe.camera
    camera = CameraContract(offset=mount.offset, tilt=math.radians(mount.tilt_deg))
    try:
        found = open_policy(file)[1]
        check_contract(found, airframe=context.airframe.name, camera=camera)
    except ContractError as error:
        return Reading("does not fit", str(error), context.policy, ok=False)
    origin = f"{found.stage}, airframe {found.airframe}, recipe {found.provenance.recipe}"
    return Reading(found.name, origin, context.policy, ok=True)


@check("policy.hash")
def digest(context: Context, *, sha256: str = "") -> Reading:
    """sha256 of the policy's file (its first 16 digits); `sha256` in the list requires a certain one."""
    file = policy_file(context.policy)
    if file is None:
        raise NotApplicable(_BUILT_IN)
    try:
        found = file_sha256(file)
    except ProvenanceError as error:
        return Reading(None, str(error), context.policy, ok=False)
    same = not sha256 or found.startswith(sha256.lower())
    return Reading(found[:16], "" if same else f"the list requires {sha256}", context.policy, ok=same)
