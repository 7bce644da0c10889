"""What a fault is: one small decorator around a node's messages, its wire, or the simulated device in it.

A kind overrides the few methods it needs. While its fault is not active none of them is called, and the node behaves
as without it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, Protocol

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from hil.contract.node import Inbox, Node, Out
from kernel.random import uniform

Share = Annotated[float, Field(gt=0, le=1)]
Milliseconds = Annotated[float, Field(gt=0, le=60_000)]


class Host(Protocol):
    """The decorator in which a fault acts; see `hil.faults.node.FaultyNode`."""

    @property
    def node(self) -> Node: ...

    def rebuild(self) -> None: ...


class Parameters(BaseModel):
    """Parameters of a kind; SI units where a name says no other."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


FIRMWARE = "firmware"
"""In `Setting.simulated`: the vehicle is our plant, flown by a real firmware."""


@dataclass(frozen=True)
class Setting:
    """What a kind must know of the run: which nodes it has by service, which slots are simulated, whether there are
    pictures, and whether it keeps real time."""

    services: dict[str, tuple[str, ...]]
    simulated: Collection[str]
    pictures: bool
    live: bool

    @property
    def nodes(self) -> tuple[str, ...]:
        """The run's nodes."""
        return tuple(node for nodes in self.services.values() for node in nodes)


class Fault:
    """Base of every kind. `rng`: the fault's own random stream.

    `kind`: its name; `nodes`: the first of them that a run has is decorated; `pictures`: it changes pictures and is
    nothing without them; `device`: the slot whose simulated device it acts on; `live_only`: it acts on a process;
    `final`: nothing ends it.
    """

    kind: ClassVar[str] = ""
    nodes: ClassVar[tuple[str, ...]] = ()
    pictures: ClassVar[bool] = False
    device: ClassVar[str] = ""
    live_only: ClassVar[bool] = False
    final: ClassVar[bool] = False
    Parameters: ClassVar[type[Parameters]] = Parameters

    stalls = False  # while it is active the node is not stepped, and what arrives for it waits
    dead = False  # the node is not stepped, and does not obey an order to abort
    clock_ns = 0  # what the node's clock is ahead of the run's
    live = False  # it may strike its process: the run is live, and this is the first of its nodes there
    lasts_s: float | None = None  # how long it acts; None: to the end of the run

    def __init__(self, parameters: Any, rng: np.ndarray) -> None:
        self.p, self.rng = parameters, rng
        self.now_ns = 0

    @classmethod
    def places(cls, parameters: Any, setting: Setting) -> tuple[str, ...]:
        """The nodes that it decorates in this run."""
        return tuple(name for name in cls.nodes if name in setting.nodes)[:1]

    @classmethod
    def complaint(cls, parameters: Any, setting: Setting) -> str:
        """Why it cannot act in this run; empty if it can."""
        if cls.pictures and not setting.pictures:
            return 'changes pictures, and camera "model" has none: give --camera pictures'
        if cls.device and cls.device not in setting.simulated:
            return f"acts on the simulated {cls.device}, and this rig has a real one"
        if cls.live_only and not setting.live:
            return "acts on a process, which only a live run has: fly with --live"
        return "" if cls.places(parameters, setting) else f"acts on {' or '.join(cls.nodes)}, which this rig has not"

    def chance(self, share: float) -> bool:
        """True for `share` of the calls, at random."""
        return share >= 1.0 or float(uniform(self.rng, 0.0, 1.0)) < share

    def begin(self, host: Host) -> None:
        """It begins to act on `host.node`."""

    def act(self, host: Host) -> None:
        """Before each step of the node."""

    def end(self, host: Host) -> None:
        """It ceases to act."""

    def incoming(self, topic: str, message: Any) -> Any | None:
        """What the node gets in place of `message`; None: nothing."""
        return message

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        """What is published in place of `out`. `inbox`: the newest messages that the node has got."""
        return [out]

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        """What the node's wire carries in place of `item` (a datagram, a CAN frame): (ns later, item). `outward`: sent
        by the node, not received."""
        return [(0, item)]

    @property
    def refuses(self) -> bool:
        """Whether the wire refuses what the node sends."""
        return False
