"""The arming interlock: a real device arms only with a fresh, signed-off go for exactly this (see `hil.check.subject`).

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
from hil.check import records
from hil.check.checklist import load_checklist
from hil.check.crew_key import CrewKeyError, load_public_keys
from hil.check.moment import Moment
from hil.check.records import GO, NO_GO, Record
from hil.check.subject import difference, list_subject, subject
from kernel.toml_errors import ConfigError
from scenarios.spec import Scenario
from vehicle.px4.driver.arming import Arming

FRESH = timedelta(hours=4)
_SKEW = timedelta(minutes=2)  # between this computer's clock and that of the signing one
Keys = Mapping[str, Ed25519PublicKey]


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
    autopilot: Mapping[str, Any] = field(default_factory=dict)  # what the go is bound to, see `Arming.table`
    counts: Mapping[str, int] = field(default_factory=dict)
    marginal: tuple[str, ...] = ()
    override_reason: str = ""
    refused_because: str = ""

    def manifest(self) -> dict[str, Any]:
        """Plain table, without what does not apply."""
        return {name: value for name, value in asdict(self).items() if value not in ("", (), {})}

    @property
    def arming(self) -> Arming:
        """What the vehicle's autopilot must be and hold."""
        return Arming.of(self.autopilot) if self.autopilot else Arming()

    @property
    def remark(self) -> str:
        """What the crew should know before it flies; empty if nothing."""
        if self.kind == "override":
            return f"armed by override: {self.refused_because}"
        if not self.override_reason:
            return ""
        reason = "a simulated rig needs no go" if self.kind == "simulated" else f"there is a go, {self.record}"
        return f"--override-check was not needed: {reason}"


def clear_to_arm(
    rig_name: str,
    rig: Rig,
    policy: str,
    scenario: Scenario,
    *,
    folder: Path,
    now: Moment,
    override: str | None = None,
    fresh: timedelta = FRESH,
) -> Clearance:
    """Whether this run may arm. `folder` holds the checklist records; `override`: a reason to arm without a go.

    A simulated rig is always cleared. The override's reason goes into the manifest, with the refusal that it overrides.
    Raises NotClearedError, ConfigError for an override without a reason, and ProvenanceError if the policy's file or
    the code cannot be read.
    """
    reason = check_override(override)
    if rig.simulated:
        return Clearance("simulated", override_reason=reason)
    try:
        path, record = _fresh_go(rig_name, rig, policy, scenario, folder, now, fresh)
    except NotClearedError as refusal:
        if not reason:
            raise
        return Clearance("override", override_reason=reason, refused_because=str(refusal))
    sign = record.sign_off
    assert sign is not None  # of a go
    return Clearance(
        "checklist",
        record=str(path),
        sha256=sign["sha256"],
        operator=sign["operator"],
        signed_utc=sign["utc"],
        key=sign.get("key", ""),
        autopilot=record.autopilot if _bound(rig) else {},
        counts=record.content()["counts"],
        marginal=tuple(entry.key for entry in record.entries if entry.outcome.value == "MARGINAL"),
        override_reason=reason,
    )


def check_override(override: str | None) -> str:
    """The reason on one line, empty without an override. Raises ConfigError if it is none."""
    if override is None:
        return ""
    words = override.split()
    if len(words) < 2:
        raise ConfigError(
            f'--override-check "{override}": give the reason in words (two or more), it is kept in the run\'s manifest'
        )
    return " ".join(words)


def _fresh_go(
    rig_name: str, rig: Rig, policy: str, scenario: Scenario, folder: Path, now: Moment, fresh: timedelta
) -> tuple[Path, Record]:
    try:
        keys = load_public_keys(rig.crew_keys)
        checklist = load_checklist(rig.preflight)
        wanted = list_subject(checklist, subject(rig_name, rig, policy, scenario))
    except (CrewKeyError, ConfigError, ValueError) as error:
        raise NotClearedError(str(error)) from None
    if checklist.kind != "preflight":
        raise NotClearedError(f'rig "{wanted["rig"]}" names {rig.preflight} as its preflight, whose kind is another')
    preflights = records.find(folder, lambda record: record.subject.get("kind") == "preflight")
    reasons: list[str] = []
    mine = 0
    for path, record in preflights:
        reason = refusal(record, wanted, now, fresh, keys, bound=_bound(rig))
        if not reason:
            return path, record
        ours = record.subject.get("rig") == wanted["rig"]  # the refusal quotes this rig's record first
        reasons.insert(len(reasons) if not ours else mine, f"{path.name}: {reason}")
        mine += ours
    found = f"there is no preflight record in {folder}" if not reasons else f"record {reasons[0]}"
    raise NotClearedError(
        f'rig "{wanted["rig"]}" has a real device and no go: {found}. '
        f"Run: perch-hil check {rig.preflight} --rig {rig_name} --scenario {wanted['scenario']}"
        f"{_policy_option(wanted['policy'])}{' --key FILE' if keys else ''}"
    )


def refusal(
    record: Record,
    wanted: Mapping[str, Any],
    now: Moment,
    fresh: timedelta = FRESH,
    keys: Keys | None = None,
    *,
    bound: bool = False,
) -> str:
    """Why `record` does not clear `wanted` (see `hil.check.subject.list_subject`) at `now`; empty if it does.

    keys: the crew's public keys by fingerprint; with any, the record must be signed with one of them. bound: the
    vehicle is real, so that the record must say which autopilot it is for.
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
    other = difference(record.subject, wanted)
    if other:
        return f"is for {other}"
    if bound and not _names_an_autopilot(record):
        return "does not say which autopilot it is for"
    try:
        signed = datetime.fromisoformat(sign["utc"]).astimezone(UTC)
        age = timedelta(seconds=now.seconds_since(signed, sign["boot"], sign["uptime_ns"]))
    except (ValueError, OverflowError):
        return f"was signed off at an unreadable time ({sign['utc']})"
    if age < -_SKEW:
        return f"was signed off in the future ({sign['utc']}): check this computer's clock"
    if age > fresh:
        return f"is {age.total_seconds() / 3600:.1f} h old, a go lasts {fresh.total_seconds() / 3600:g} h"
    return ""


def _bound(rig: Rig) -> bool:
    """Whether a go is for one autopilot."""
    return not rig.vehicle.simulated


def _names_an_autopilot(record: Record) -> bool:
    try:
        return bool(Arming.of(record.autopilot).identity.uid)
    except ValueError:
        return False


def _policy_option(policy: Mapping[str, Any]) -> str:
    return f" --policy {policy['path']}" if "path" in policy else f" --policy {policy['name']}"
