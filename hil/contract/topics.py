"""The bus contract in one table: what each topic carries, how often, how old it may get, and who may read it.

Both hosts enforce `readers`: the policy can never see the ground car's truth because no graph that lets it is built.
"""

from __future__ import annotations

from dataclasses import dataclass

from hil.contract import messages as m

EVERYONE = ("*",)


@dataclass(frozen=True, slots=True)
class Topic:
    """One row of the contract. `hz` is that of its ticks, between which more may come; 0 means on event only.
    `max_age_ms` 0 means it does not go stale."""

    message: type
    hz: float
    max_age_ms: int
    recorded: bool
    readers: tuple[str, ...]


_TRUTH = ("vehicle_device", "camera", "mocap")

TOPICS: dict[str, Topic] = {
    "truth/vehicle": Topic(m.VehicleState, 250, 20, True, _TRUTH),
    "truth/board": Topic(m.BoardState, 250, 20, True, _TRUTH),
    "mocap/vehicle": Topic(m.VehicleState, 100, 50, True, ("referee", "vehicle_link")),
    "mocap/board": Topic(m.BoardState, 100, 50, True, ("referee", "car_follower")),
    "car/reference": Topic(m.CarReference, 50, 100, True, ()),
    "car/command": Topic(m.CarCommand, 50, 100, True, ("car_link",)),
    "car/sent": Topic(m.CarCommand, 0, 0, True, ()),
    "car/feedback": Topic(m.CarFeedback, 50, 100, True, ()),
    "vehicle/odometry": Topic(m.VehicleState, 100, 50, True, ("detector", "belief", "policy")),
    "vehicle/status": Topic(m.VehicleStatus, 10, 500, True, EVERYONE),
    "vehicle/parameters": Topic(m.VehicleParameters, 0, 0, True, ()),
    "camera/image": Topic(m.Image, 60, 100, True, ("detector",)),
    "board/detection": Topic(m.Detection, 60, 0, True, ("belief",)),
    "belief": Topic(m.Belief, 100, 50, True, ("policy", "detector")),
    "policy/action": Topic(m.Action, 100, 50, True, ("vehicle_link",)),
    "vehicle/sent": Topic(m.Sent, 100, 50, True, ("policy",)),
    "referee/contact": Topic(m.Contact, 100, 50, True, ("vehicle_device", "vehicle_link", "director")),
    "run/stage": Topic(m.Stage, 20, 100, True, EVERYONE),
    "event": Topic(m.Event, 0, 0, True, EVERYONE),
}


def may_read(node: str, topic: str) -> bool:
    """True if the contract lets `node` subscribe to `topic`. Raises KeyError for an unknown topic."""
    readers = TOPICS[topic].readers
    return node in readers or readers == EVERYONE
