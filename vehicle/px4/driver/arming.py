"""Which autopilot it is, and what it must be and hold so that it may be armed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple


class Identity(NamedTuple):
    """An autopilot's UID (hex) and firmware, from AUTOPILOT_VERSION; empty where it gives none."""

    uid: str = ""
    firmware: str = ""

    @property
    def text(self) -> str:
        return f"UID {self.uid or 'unknown'}, firmware {self.firmware or 'unknown'}"


@dataclass(frozen=True)
class Arming:
    """The autopilot's identity and parameters (name: value) as they were checked; what is empty may be anything."""

    identity: Identity = field(default_factory=Identity)
    parameters: Mapping[str, float] = field(default_factory=dict)

    def table(self) -> dict[str, Any]:
        """Plain table, see `of`."""
        return {**self.identity._asdict(), "parameters": dict(self.parameters)}

    @classmethod
    def of(cls, table: Any) -> Arming:
        """From a plain table. Raises ValueError for one that is none: nothing may be armed by it."""
        if not isinstance(table, Mapping):
            raise ValueError(f"no conditions for arming: {table!r}")
        uid, firmware, parameters = (table.get(name) for name in ("uid", "firmware", "parameters"))
        held: Mapping[str, Any] = parameters if isinstance(parameters, Mapping) else {"": None}
        if isinstance(uid, str) and isinstance(firmware, str) and all(map(_number, held.values())):
            return cls(Identity(uid, firmware), {str(name): value for name, value in held.items()})
        raise ValueError(f"no conditions for arming: {dict(table)!r}")

    def faults(self, identity: Identity, held: Mapping[str, float]) -> list[str]:
        """In what an autopilot that is `identity` and holds the parameters `held` differs; empty if in nothing."""
        found = []
        if self.identity.uid and identity.uid != self.identity.uid:
            found.append(f"its UID is {identity.uid or 'unknown'}, the checked autopilot's was {self.identity.uid}")
        if self.identity.firmware and identity.firmware != self.identity.firmware:
            found.append(f"its firmware is {identity.firmware or 'unknown'}, checked was {self.identity.firmware}")
        for name, value in self.parameters.items():
            if name not in held:
                found.append(f"it does not tell its {name}, checked was {value:g}")
            elif not same_value(held[name], value):
                found.append(f"{name} is {held[name]:g}, checked was {value:g}")
        return found


def identity_of(version: Any) -> Identity:
    """From the fields of AUTOPILOT_VERSION: `uid2` where it is not zero, else `uid`; version and commit."""
    long, short = bytes(version.uid2), int(version.uid)
    uid = long.hex() if any(long) else f"{short:016x}" if short else ""
    number = version.flight_sw_version
    release = f"{number >> 24 & 255}.{number >> 16 & 255}.{number >> 8 & 255}"
    commit = bytes(version.flight_custom_version)
    return Identity(uid, f"{release} {commit.hex()}" if any(commit) else release)


def same_value(a: float, b: float) -> bool:
    """Equal as PX4 keeps them: whole numbers exactly, others in single precision."""
    if isinstance(a, int) and isinstance(b, int):
        return a == b
    return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-9)


def _number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
