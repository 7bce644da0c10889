"""The bus contract in one table: what each topic carries, how often, how old it may get, and which nodes publish and
read it.

Every host enforces `readers`: the policy can never see the ground car's truth because no graph that lets it is built.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Literal

from hil.contract import messages as m

EVERYONE = ("*",)
Knows = Literal["camera", "mocap"]  # by what the policy may know of the board: a rig's `[policy] knows`


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the contract. `hz` is the rate of its periodic messages, between which more may come; 0 means on event
    only. `max_age_ms` 0 means it does not go stale. `writers` in order of precedence: the first that a run has
    publishes. `on_mocap`: who reads it too where the policy may know the board by motion capture."""

    message: type
    hz: float
    max_age_ms: int
    recorded: bool
    writers: tuple[str, ...]
    readers: tuple[str, ...]
    on_mocap: tuple[str, ...] = ()


_TRUTH = ("vehicle_device", "camera", "mocap")

TOPICS: dict[str, Topic] = {
    "truth/vehicle": Topic(m.VehicleState, 250, 20, True, ("vehicle_device", "vehicle_link"), _TRUTH),
    "truth/board": Topic(m.BoardState, 250, 20, True, ("car_device", "car_link"), _TRUTH),
    "mocap/vehicle": Topic(m.VehicleState, 100, 50, True, ("mocap",), ("referee", "vehicle_link", "director")),
    "mocap/board": Topic(
        m.BoardState,
        100,
        50,
        True,
        ("mocap",),
        ("referee", "car_follower", "vehicle_link", "director"),
        on_mocap=("belief",),
    ),
    "car/reference": Topic(m.CarReference, 50, 100, True, ("car_follower",), ()),
    "car/command": Topic(m.CarCommand, 50, 100, True, ("car_follower",), ("car_link",)),
    "car/sent": Topic(m.CarCommand, 0, 0, True, ("car_link",), ()),
    "car/feedback": Topic(m.CarFeedback, 50, 100, True, ("car_link",), ("mocap", "car_follower")),
    "vehicle/odometry": Topic(m.VehicleState, 100, 50, True, ("vehicle_link",), ("detector", "belief", "policy")),
    "vehicle/status": Topic(m.VehicleStatus, 10, 500, True, ("vehicle_link",), EVERYONE),
    "vehicle/parameters": Topic(m.VehicleParameters, 0, 0, True, ("vehicle_link",), ()),
    "camera/image": Topic(m.Image, 60, 100, True, ("camera",), ("detector",)),
    "board/detection": Topic(m.Detection, 60, 0, True, ("detector", "camera"), ("belief", "director")),
    "belief": Topic(m.Belief, 100, 50, True, ("belief",), ("policy", "detector", "vehicle_link")),
    "policy/action": Topic(m.Action, 100, 50, True, ("policy",), ("vehicle_link",)),
    "vehicle/sent": Topic(m.Sent, 100, 50, True, ("vehicle_link",), ("policy",)),
    "referee/contact": Topic(m.Contact, 100, 50, True, ("referee",), ("vehicle_device", "vehicle_link", "director")),
    "run/stage": Topic(m.Stage, 20, 100, True, ("director",), EVERYONE),
    "run/fault": Topic(m.Faults, 20, 0, True, ("director",), EVERYONE),
    "event": Topic(m.Event, 0, 0, True, EVERYONE, EVERYONE),
}


def readers_of(topic: str, knows: Knows) -> tuple[str, ...]:
    """Nodes that may read `topic` in a run whose policy `knows` the board by camera or motion capture. Raises KeyError
    for an unknown topic."""
    row = TOPICS[topic]
    return row.readers + (row.on_mocap if knows == "mocap" else ())


def may_read(node: str, topic: str, knows: Knows = "camera") -> bool:
    """True if the contract lets `node` subscribe to `topic`. Raises KeyError for an unknown topic."""
    readers = readers_of(topic, knows)
    return node in readers or readers == EVERYONE


def published_by(node: str, present: Collection[str]) -> set[str]:
    """Topics that `node` publishes in a run of the nodes `present`; "event", which every node may publish, not among
    them."""
    first = {topic: next((w for w in row.writers if w in present), None) for topic, row in TOPICS.items()}
    return {topic for topic, writer in first.items() if writer == node}
