"""Faults of the car: its CAN bus, its feedback, its drive, and the board that it carries."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated, Any

from pydantic import Field

from groundcar.scout.codec import Decoder, can_id, encode
from groundcar.scout.sim import ScoutSim
from hil.contract.messages import BoardState
from hil.contract.node import Inbox, Out
from hil.faults.fault import Fault, Host, Parameters, Share
from hil.nodes.car import CarDevice
from kernel.rotations import from_rotation_vector, multiply

_COMMAND, _FEEDBACK = "MotionCommand", "MotionState"
Period = Annotated[float, Field(ge=0.2, le=60)]


class CanLoss(Fault):
    """A share of the CAN frames is lost, in both directions."""

    kind, nodes = "can.loss", ("car_link",)

    class Parameters(Parameters):
        share: Share = 0.5

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        return [] if self.chance(self.p.share) else [(0, item)]


class CanBusOff(Fault):
    """The controller is off the bus: it refuses what is sent, and receives nothing."""

    kind, nodes = "can.bus_off", ("car_link",)

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        return []

    @property
    def refuses(self) -> bool:
        return True


class CarStuckSpeed(Fault):
    """The car goes on to report one speed."""

    kind, nodes = "car.stuck_speed", ("car_link",)
    _held: Any = None

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        if outward or item[0] != can_id(_FEEDBACK):
            return [(0, item)]
        self._held = self._held or item
        return [(0, self._held)]


class _CarDevice(Fault):
    nodes, device = ("car_device",), "groundcar"


def _sim(host: Host) -> ScoutSim:
    assert isinstance(host.node, CarDevice)
    return host.node.sim


class CarSlip(_CarDevice):
    """The wheels slip: the car moves with a share of the speed that they report."""

    kind = "car.slip"

    class Parameters(Parameters):
        share: Share = 0.6

    def begin(self, host: Host) -> None:
        self._decoder = Decoder((_COMMAND, _FEEDBACK))

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        factor = {can_id(_COMMAND): self.p.share, can_id(_FEEDBACK): 1.0 / self.p.share}.get(item[0])
        decoded = self._decoder.decode(item) if factor is not None else None
        if decoded is None or factor is None:
            return [(0, item)]
        name, values = decoded
        frame = encode(name, {**values, "speed": values["speed"] * factor, "turn_rate": values["turn_rate"] * factor})
        return [(0, type(item)(*frame))]


class CarEmergencyStop(_CarDevice):
    """The red button at the back of the car is pressed."""

    kind = "car.emergency_stop"

    def begin(self, host: Host) -> None:
        _sim(host).press_estop(True)

    def end(self, host: Host) -> None:
        _sim(host).press_estop(False)


class CarDead(_CarDevice):
    """The car stands still at once, as against an obstacle."""

    kind = "car.dead"

    def act(self, host: Host) -> None:
        _sim(host).place(*_sim(host).pose)


class _Board(_CarDevice):
    """A motion of the board on the car, as a sine from the beginning on."""

    _since_ns = 0

    def begin(self, host: Host) -> None:
        self._since_ns = self.now_ns

    def outgoing(self, out: Out, inbox: Inbox) -> list[Out]:
        if out.topic != "truth/board":
            return [out]
        turns = 2 * math.pi * (self.now_ns - self._since_ns) * 1e-9 / self.p.period
        return [out._replace(message=self.moved(out.message, math.sin(turns), math.cos(turns)))]

    def moved(self, board: BoardState, sine: float, cosine: float) -> BoardState:
        """The board where it is now."""
        raise NotImplementedError


class BoardPitch(_Board):
    """The board pitches on the car."""

    kind = "board.pitch"

    class Parameters(Parameters):
        amplitude_deg: Annotated[float, Field(gt=0, le=45)] = 10.0
        period: Period = 2.0

    def moved(self, board: BoardState, sine: float, cosine: float) -> BoardState:
        pitch = from_rotation_vector(0.0, -math.radians(self.p.amplitude_deg) * sine, 0.0)
        w, x, y, z = (float(value) for value in multiply(board.orientation, pitch))
        return replace(board, orientation=(w, x, y, z))


class BoardHeave(_Board):
    """The board goes up and down on the car."""

    kind = "board.heave"

    class Parameters(Parameters):
        amplitude: Annotated[float, Field(gt=0, le=1)] = 0.15
        period: Period = 2.0

    def moved(self, board: BoardState, sine: float, cosine: float) -> BoardState:
        (x, y, z), (u, v, _) = board.position, board.velocity
        up = self.p.amplitude
        return replace(
            board, position=(x, y, z + up * sine), velocity=(u, v, up * cosine * 2 * math.pi / self.p.period)
        )


KINDS = (CanLoss, CanBusOff, CarStuckSpeed, CarSlip, CarEmergencyStop, CarDead, BoardPitch, BoardHeave)
