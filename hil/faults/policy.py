"""Faults of the policy: what it asks is not finite, does not change, or comes late."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from hil.contract.node import Inbox, Out
from hil.faults.fault import Fault, Milliseconds, Parameters, Share


class _Policy(Fault):
    nodes = ("policy",)

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        return self.asked(out) if out.topic == "policy/action" else [out]

    def asked(self, out: Out) -> list[Out]:
        """What is published in place of an action."""
        raise NotImplementedError


class PolicyNan(_Policy):
    """A share of the actions is not finite."""

    kind = "policy.nan"

    class Parameters(Parameters):
        share: Share = 1.0

    def asked(self, out: Out) -> list[Out]:
        if not self.chance(self.p.share):
            return [out]
        return [out._replace(message=replace(out.message, body_rate=(math.nan,) * 3, thrust=math.nan))]


class PolicyFrozen(_Policy):
    """The policy goes on to ask the same, with new stamps."""

    kind = "policy.frozen"
    _held: Any = None

    def asked(self, out: Out) -> list[Out]:
        self._held, new = self._held or out.message, out.message
        return [out._replace(message=replace(self._held, stamp_ns=new.stamp_ns, exposure_ns=new.exposure_ns))]


class PolicyLate(_Policy):
    """Actions come late, with true stamps."""

    kind = "policy.late"

    class Parameters(Parameters):
        delay_ms: Milliseconds = 40.0

    def asked(self, out: Out) -> list[Out]:
        return [out._replace(delay_ns=out.delay_ns + round(self.p.delay_ms * 1e6))]


class PolicyMissed(_Policy):
    """A share of the actions is missing: the policy has missed its deadline."""

    kind = "policy.missed"

    class Parameters(Parameters):
        share: Share = 0.5

    def asked(self, out: Out) -> list[Out]:
        return [] if self.chance(self.p.share) else [out]


KINDS = (PolicyNan, PolicyFrozen, PolicyLate, PolicyMissed)
