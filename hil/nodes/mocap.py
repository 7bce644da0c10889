"""Simulated motion capture of vehicle and board, at its own rate, noise and delay."""

from __future__ import annotations

import math

from hil.contract.messages import BoardState, Quat, Vec3, VehicleState
from hil.contract.node import Inbox, Node, Out
from vehicle.mocap.system import Mocap


class MocapNode(Node):
    """Measures the newest truth of both bodies each period."""

    name = "mocap"
    inputs = ("truth/vehicle", "truth/board")
    outputs = ("mocap/vehicle", "mocap/board")

    def __init__(self, vehicle: Mocap, board: Mocap, rate_hz: float, delay_ns: int) -> None:
        self.period_ns = round(1e9 / rate_hz)
        self._vehicle, self._board, self._delay_ns = vehicle, board, delay_ns

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        vehicle: VehicleState | None = inbox.latest("truth/vehicle")
        board: BoardState | None = inbox.latest("truth/board")
        outs: list[Out] = []
        if board is not None:
            outs.append(Out("mocap/board", self._seen(board), self._delay_ns))
        if vehicle is not None:
            seen = self._vehicle.measure(vehicle.position, vehicle.velocity, vehicle.orientation, vehicle.body_rate)
            outs.append(Out("mocap/vehicle", VehicleState(vehicle.stamp_ns, *seen), self._delay_ns))
        return outs

    def _seen(self, board: BoardState) -> BoardState:
        rates = (0.0, 0.0, board.turn_rate)
        position, velocity, orientation, rate = self._board.measure(
            board.position, board.velocity, board.orientation, rates
        )
        return board_state(board.stamp_ns, position, velocity, orientation, rate[2])


def board_state(stamp_ns: int, position: Vec3, velocity: Vec3, orientation: Quat, turn_rate: float) -> BoardState:
    """The board's state from its pose and motion: m, m/s (world), wxyz (world from board), rad/s (of the car).

    The car's heading is that of the board's y axis, less a quarter turn: it stays level however the board is inclined.
    """
    w, x, y, z = orientation
    heading = math.atan2(-2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z))
    speed = velocity[0] * math.cos(heading) + velocity[1] * math.sin(heading)
    return BoardState(stamp_ns, position, velocity, orientation, heading, speed, turn_rate)
