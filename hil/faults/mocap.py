"""Faults of motion capture, of the vehicle's body, the board's, or both."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, Literal

from pydantic import Field

from hil.contract.node import Inbox, Out
from hil.faults.fault import Fault, Host, Milliseconds, Parameters, Share

Body = Literal["vehicle", "board", "both"]
Length = Annotated[float, Field(ge=-50, le=50)]


class _Mocap(Fault):
    nodes = ("mocap",)

    class Parameters(Parameters):
        body: Body = "both"

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        wanted = out.topic.startswith("mocap/") and self.p.body in ("both", out.topic.removeprefix("mocap/"))
        return self.measured(out) if wanted else [out]

    def measured(self, out: Out) -> list[Out]:
        """What is published in place of a measurement."""
        raise NotImplementedError


class MocapDropout(_Mocap):
    """A share of the poses is missing."""

    kind = "mocap.dropout"

    class Parameters(_Mocap.Parameters):
        share: Share = 1.0

    def measured(self, out: Out) -> list[Out]:
        return [] if self.chance(self.p.share) else [out]


class MocapJump(_Mocap):
    """The poses are off by (x, y, z) m, as after a wrong assignment of markers."""

    kind = "mocap.jump"

    class Parameters(_Mocap.Parameters):
        x: Length = 1.0
        y: Length = 0.0
        z: Length = 0.0

    def measured(self, out: Out) -> list[Out]:
        x, y, z = out.message.position
        moved = (x + self.p.x, y + self.p.y, z + self.p.z)
        return [out._replace(message=replace(out.message, position=moved))]


class MocapSwapped(_Mocap):
    """The axes y and z are exchanged, as by a system whose y axis points up."""

    kind = "mocap.swapped"

    def measured(self, out: Out) -> list[Out]:
        (x, y, z), (u, v, w) = out.message.position, out.message.velocity
        return [out._replace(message=replace(out.message, position=(x, z, y), velocity=(u, w, v)))]


class MocapStale(_Mocap):
    """Poses arrive late, with true stamps."""

    kind = "mocap.stale"

    class Parameters(_Mocap.Parameters):
        delay_ms: Milliseconds = 300.0

    def measured(self, out: Out) -> list[Out]:
        return [out._replace(delay_ns=out.delay_ns + round(self.p.delay_ms * 1e6))]


class MocapFrozen(_Mocap):
    """The system goes on to send one pose of each body, with new stamps."""

    kind = "mocap.frozen"

    def begin(self, host: Host) -> None:
        self._held: dict[str, Any] = {}

    def measured(self, out: Out) -> list[Out]:
        held = self._held.setdefault(out.topic, out.message)
        return [out._replace(message=replace(held, stamp_ns=out.message.stamp_ns))]


KINDS = (MocapDropout, MocapJump, MocapSwapped, MocapStale, MocapFrozen)
