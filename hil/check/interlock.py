"""The arming interlock: a real device arms only with a fresh, signed-off go for this rig, policy and scenario class.

A rig that names keys of its crew (`crew_keys`) accepts only records that are signed with one of them. Without keys a
record is sealed by a digest: that shows accidental changes, not forgery."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PublicKey

from hil.assembly.rig import Rig
from hil.bench.devices import subject
from hil.check import records
from hil.check.crew_key import CrewKeyError, load_public_keys
from hil.check.records import GO, NO_GO, Record
from scenarios.spec import Scenario

FRESH = timedelta(hours=4)
_SKEW = timedelta(minutes=2)  # between this computer's clock and that of the signing one
Keys = Mapping[str, Ed25519PublicKey]
_SAME = ("rig", "rig_sha256", "simulated", "policy", "scenario_class")


class NotClearedError(RuntimeError):
    """Arming is refused; the message states why and what to do."""


@dataclass(frozen=True)
class Clearance:
    """Why a run may arm; `manifest()` belongs into the run's manifest, under "clearance"."""

    kind: str  # simulated, checklist, override
    record: str = ""
    sha256: str = ""
    operator: str = ""
    signed_utc: str = ""
    key: str = ""  # fingerprint of the crew's key; empty: the record is only sealed
    counts: Mapping[str, int] = field(default_factory=dict)
    marginal: tuple[str, ...] = ()
    override_reason: str = ""
    refused_because: str = ""

    def manifest(self) -> dict[str, Any]:
        """Plain table, without what does not apply."""
        return {name: value for name, value in asdict(self).items() if value not in ("", (), {})}


def clear_to_arm(
    rig_name: str,
    rig: Rig,
    policy: str,
    scenario: Scenario,
    *,
    folder: Path,
    now: datetime,
    override: str | None = None,
    fresh: timedelta = FRESH,
) -> Clearance:
    """Whether this run may arm. `folder` holds the checklist records; `override`: a reason to arm without a go.

    A simulated rig is always cleared. The override's reason goes into the manifest, with the refusal that it overrides.
    Raises NotClearedError, and ProvenanceError if the policy's file cannot be read.
    """
    wanted = subject(rig_name, rig, policy, scenario)
    if rig.simulated:
        return Clearance("simulated")
    try:
        path, record = _fresh_go(wanted, rig_name, folder, now, fresh, rig.crew_keys)
    except NotClearedError as refusal:
        if override is None:
            raise
        if len(override.split()) < 2:
            raise NotClearedError(
                "an override needs a reason in words, which is kept in the run's manifest; " + str(refusal)
            ) from None
        return Clearance("override", override_reason=" ".join(override.split()), refused_because=str(refusal))
    sign = record.sign_off
    assert sign is not None  # of a go
    return Clearance(
        "checklist",
        record=str(path),
        sha256=sign["sha256"],
        operator=sign["operator"],
        signed_utc=sign["utc"],
        key=sign.get("key", ""),
        counts=record.content()["counts"],
        marginal=tuple(entry.key for entry in record.entries if entry.outcome.value == "MARGINAL"),
    )


def _fresh_go(
    wanted: dict[str, Any], rig_name: str, folder: Path, now: datetime, fresh: timedelta, key_files: tuple[str, ...]
) -> tuple[Path, Record]:
    try:
        keys = load_public_keys(key_files)
    except CrewKeyError as error:
        raise NotClearedError(str(error)) from None
    preflights = records.find(folder, lambda record: record.subject.get("kind") == "preflight")
    reasons: list[str] = []
    mine = 0
    for path, record in preflights:
        reason = refusal(record, wanted, now, fresh, keys)
        if not reason:
            return path, record
        ours = record.subject.get("rig") == wanted["rig"]  # the refusal quotes this rig's record first
        reasons.insert(len(reasons) if not ours else mine, f"{path.name}: {reason}")
        mine += ours
    found = f"there is no preflight record in {folder}" if not reasons else f"record {reasons[0]}"
    raise NotClearedError(
        f'rig "{wanted["rig"]}" has a real device and no go: {found}. '
        f"Run: perch-hil check preflight --rig {rig_name} --scenario {wanted['scenario']}"
        f"{_policy_option(wanted['policy'])}{' --key FILE' if keys else ''}"
    )


def refusal(
    record: Record, wanted: Mapping[str, Any], now: datetime, fresh: timedelta = FRESH, keys: Keys | None = None
) -> str:
    """Why `record` does not clear `wanted` (see `hil.bench.devices.subject`) at `now`; empty if it does.

    keys: the crew's public keys by fingerprint; with any, the record must be signed with one of them.
    """
    sign = record.sign_off
    if sign is None:
        return "is incomplete: it is not signed off"
    if not record.genuine():
        return "was changed after it was signed off"
    if keys and not record.signed_by(keys):
        key = sign.get("key")
        if key:
            return f"is not signed by its key {key}, or not by a key of this rig's crew"
        return "is only sealed: this rig demands the signature of a crew key"
    if record.exit_code() != GO:
        return "is a no-go" if record.exit_code() == NO_GO else "is incomplete: not every item is known"
    for name in _SAME:
        if record.subject.get(name) != wanted[name]:
            return f"is for another {name.removesuffix('_sha256').replace('_', ' ')}{_difference(record, wanted, name)}"
    try:
        age = now - datetime.fromisoformat(sign["utc"]).astimezone(UTC)
    except (ValueError, OverflowError):
        return f"was signed off at an unreadable time ({sign['utc']})"
    if age < -_SKEW:
        return f"was signed off in the future ({sign['utc']}): check this computer's clock"
    if age > fresh:
        return f"is {age.total_seconds() / 3600:.1f} h old, a go lasts {fresh.total_seconds() / 3600:g} h"
    return ""


def _difference(record: Record, wanted: Mapping[str, Any], name: str) -> str:
    if name == "rig_sha256":
        return " file: it was changed since"
    has, needs = record.subject.get(name), wanted[name]
    if isinstance(has, dict) and isinstance(needs, dict):
        has, needs = (f"{p.get('name')} {str(p.get('sha256', ''))[:12]}".strip() for p in (has, needs))
    return f": {has}, not {needs}"


def _policy_option(policy: Mapping[str, Any]) -> str:
    return f" --policy {policy['path']}" if "path" in policy else f" --policy {policy['name']}"
