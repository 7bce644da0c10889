"""What a go is for: rig, airframe, policy, scenario, checklist and code, by their content and not by name alone."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hil.assembly.rig import Rig
from hil.check.checklist import Checklist
from hil.recording.provenance import code_digests, content_sha256
from hil.recording.runs import policy_identity
from hil.wires.signing_key import read_signing_key
from scenarios.spec import Scenario, list_scenarios, load
from vehicle.quadrotor.airframe import load_airframe

_CLASSES = ("simple", "normal", "hard")


def subject(rig_name: str, rig: Rig, policy: str, scenario: Scenario) -> dict[str, Any]:
    """What a record clears, without its list.

    Raises ProvenanceError if the policy's file or the code cannot be read, ValueError for a signing key or an airframe
    that cannot be used.
    """
    name, content = _scenario_class(scenario)
    return {
        "rig": Path(rig_name).stem,
        "rig_sha256": content_sha256(rig.model_dump(mode="json")),
        "simulated": rig.simulated,
        "airframe": rig.vehicle.airframe,
        "airframe_sha256": content_sha256(load_airframe(rig.vehicle.airframe).model_dump(mode="json")),
        "signing_key": _fingerprint(rig.vehicle.signing_key),
        "policy": policy_identity(policy),
        "scenario": scenario.name,
        "scenario_class": name,
        "scenario_sha256": content_sha256(content),
        "code": code_digests(),
    }


def list_subject(checklist: Checklist, about: Mapping[str, Any]) -> dict[str, Any]:
    """`about` with the list's title, kind and digest."""
    return {**about, "list": checklist.title, "kind": checklist.kind, "list_sha256": checklist.sha256()}


def difference(has: Mapping[str, Any], wants: Mapping[str, Any]) -> str:
    """What a record with the subject `has` is for, where it is not for `wants`; empty if it is."""
    compared = (
        "rig", "rig_sha256", "airframe_sha256", "signing_key", "policy", "scenario_class", "scenario_sha256",
        "list_sha256", "code",
    )  # fmt: skip
    name = next((name for name in compared if has.get(name) != wants[name]), "")
    one, other = has.get(name), wants.get(name)
    texts = {
        "": "",
        "rig": f"another rig: {one}, not {other}",
        "rig_sha256": "another rig: its file was changed since",
        "airframe_sha256": f"another airframe: {wants['airframe']} was changed since",
        "signing_key": f"another MAVLink signing key: {one or 'none'}, not {other or 'none'}",
        "policy": f"another policy: {_policy(one)}, not {_policy(other)}",
        "scenario_class": f"another scenario class: {one}, not {other}",
        "scenario_sha256": f"another scenario: the content of {wants['scenario']} was changed since",
        "list_sha256": f'another checklist: the rig wants "{wants["list"]}" as its file is now',
        "code": f"other code: {', '.join(_changed(one, wants['code']))} changed since",
    }
    return texts[name]


def _scenario_class(scenario: Scenario) -> tuple[str, Any]:
    """What scenarios have in common if one preflight clears them all, and the content of all of them.

    The published ones fall into their own classes (simple, normal, hard): how steep the board is and how fast it goes.
    Every other scenario stands for itself, whatever its name.
    """
    own = scenario.model_dump(mode="json")
    head, _, tail = scenario.name.rpartition("-")
    if head in _CLASSES and tail and scenario.name in list_scenarios():
        family = {name: load(name).model_dump(mode="json") for name in list_scenarios() if name.startswith(f"{head}-")}
        if family[scenario.name] == own:
            return head, family
    return scenario.name, own


def _fingerprint(signing_key: str) -> str:
    """A digest by which two MAVLink signing keys differ; empty without one."""
    if not signing_key:
        return ""
    return hashlib.sha256(b"perch-hil signing key\n" + read_signing_key(signing_key)).hexdigest()[:16]


def _changed(has: Any, wants: Mapping[str, str]) -> list[str]:
    """The packages whose digests differ."""
    known = has if isinstance(has, Mapping) else {}
    return [name for name, digest in wants.items() if known.get(name) != digest]


def _policy(identity: Any) -> str:
    """Name and the beginnings of its digests."""
    if not isinstance(identity, Mapping):
        return str(identity)
    digests = {name.removesuffix("sha256").rstrip("_"): v for name, v in identity.items() if name.endswith("sha256")}
    return " ".join([str(identity.get("name")), *(f"{part} {str(v)[:12]}".strip() for part, v in digests.items())])
