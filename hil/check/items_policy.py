"""Automatic checks of the policy's file."""

from __future__ import annotations

import time

from hil.assembly.plan import rig_policy
from hil.bench.devices import Context
from hil.bench.reading import NotApplicable
from hil.check.judge import Reading
from hil.check.registry import check
from hil.recording.provenance import ProvenanceError, file_sha256
from policies.flying.shipped import policy_file
from policies.flying.trial import latency

_BUILT_IN = "the policy is built in: it has no file"


@check("policy.contract")
def contract(context: Context) -> Reading:
    """The policy's contract against this program, the rig's airframe and its camera as calibrated and mounted; its
    answers to recorded observations, and how long one takes."""
    if policy_file(context.policy) is None:
        raise NotApplicable(_BUILT_IN)
    try:
        network = rig_policy(context.policy, context.rig).network
        assert network is not None  # of a file
        seconds = latency(network, time.perf_counter)
    except ValueError as error:
        return Reading("does not fit", str(error), context.policy, ok=False)
    found = network.contract
    origin = f"{found.stage}, airframe {found.airframe}, recipe {found.provenance.recipe}, {1e3 * seconds:.2f} ms"
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
