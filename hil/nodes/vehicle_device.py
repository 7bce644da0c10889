"""The simulated quadrotor: autopilot and airframe behind the wire."""

from __future__ import annotations

from typing import Protocol

from hil.contract.messages import BoardState, Contact, VehicleState
from hil.contract.node import Inbox, Node, Out
from vehicle.px4.sim.truth import Quat, Truth, Vec3


class Body(Protocol):
    """A simulated vehicle with its autopilot. `attach`: the magnet holds it to the board of that pose."""

    def step(self, now_ns: int, /) -> None: ...

    def truth(self) -> Truth: ...

    def set_wind(self, velocity: Vec3, /) -> None: ...

    def attach(self, position: Vec3, orientation: Quat, stamp_ns: int, velocity: Vec3, turn_rate: float, /) -> None: ...


class Air(Protocol):
    """What moves the air; see `vehicle.quadrotor.wind.Wind`."""

    def at(self, now_ns: int, /) -> tuple[float, float, float]: ...


class VehicleDevice(Node):
    """A simulated vehicle with its autopilot; when the magnet holds, the vehicle rides on the board."""

    name = "vehicle_device"
    inputs = ("referee/contact", "truth/board")
    outputs = ("truth/vehicle",)
    period_ns = 4_000_000

    def __init__(self, sim: Body, wind: Air | None = None) -> None:
        self.sim: Body = sim
        self.wind: Air | None = wind

    @property
    def safe(self) -> bool:
        """Whether it is disarmed: until then its driver needs it."""
        return not self.sim.truth().armed

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        contact: Contact | None = inbox.latest("referee/contact")
        board: BoardState | None = inbox.latest("truth/board")
        if contact is not None and contact.attached and board is not None:
            self.sim.attach(board.position, board.orientation, board.stamp_ns, board.velocity, board.turn_rate)
        if self.wind is not None:
            self.sim.set_wind(self.wind.at(now_ns))
        self.sim.step(now_ns)
        truth = self.sim.truth()
        state = VehicleState(now_ns, truth.position, truth.velocity, truth.orientation, truth.body_rate)
        return [Out("truth/vehicle", state)]
