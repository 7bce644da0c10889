"""A trained network as a flying policy: an ONNX file with a contract. No torch here."""

from __future__ import annotations

import math

import numpy as np

from policies.estimation.own_state import OwnState
from policies.flying.onnx_file import OpenedPolicy
from policies.task.interface import BoardView, Command, Vec3, VehicleView
from policies.task.observation import ObservationBuilder, action_from_command, command_from_action
from policies.task.unusable import no_command, why_unusable
from vehicle.quadrotor import command_row
from vehicle.quadrotor.airframe import GRAVITY, Airframe


class OnnxPolicy:
    """A trained network; it waits, not engaged, until the belief is valid, then flies to the end."""

    def __init__(self, network: OpenedPolicy, airframe: Airframe) -> None:
        self._network = network
        self._builder = ObservationBuilder(network.contract.observation.stride)
        self._own, self._limits = OwnState(airframe), airframe.limits_row()
        self._action, self._command = np.zeros(command_row.DIM), np.zeros(command_row.DIM)
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Forget history, gain and last action; `now_ns` starts the clock."""
        self._builder.reset()
        self._own.reset(now_ns)
        self._command[:] = 0.0, 0.0, 0.0, GRAVITY
        action_from_command(self._command, self._limits, self._action)
        self._engaged, self._odometry_ns = False, -1

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """One control tick, or, with odometry that it has seen before, between two.

        What cannot be used of odometry, belief or the network's output gives no command (policies/task/unusable.py),
        and enters neither the history nor the fed-back action.
        """
        if why := why_unusable(now_ns, vehicle, board):
            return no_command(self._engaged, why)
        own = self._own
        own.update(now_ns, vehicle, self._command[command_row.THRUST])
        between, self._odometry_ns = vehicle.stamp_ns == self._odometry_ns, vehicle.stamp_ns
        self._engaged = self._engaged or board.valid
        if not self._engaged:
            return Command(False, (0.0, 0.0, 0.0), GRAVITY, "hold", own.gain)
        board_row = np.array(
            [*board.position, board.heading, board.speed, board.turn_rate, board.inclination, 0.0], dtype=np.float64
        )
        if not self._builder.push(now_ns, board_row, between):
            return no_command(True, "the belief cannot be kept")
        observation = self._builder.build(
            now_ns, own.position, own.velocity, own.orientation, board.rho, self._action, own.gain, own.drag,
            board.surface_sigma,
        )  # fmt: skip
        raw = self._network.run(observation[None])[0].tolist()
        if not math.isfinite(sum(raw)):
            return no_command(True, "the network's output is not finite")
        self._action[:] = [min(1.0, max(-1.0, value)) for value in raw]
        command_from_action(self._action, self._limits, self._command)
        p, q, r, thrust = self._command.tolist()
        return Command(True, (p, q, r), thrust, "network", float(own.gain))

    def flown(self, body_rate: Vec3, thrust: float) -> None:
        """Receive the command that was flown (rad/s FLU, m/s^2): the next observation's previous action.

        One that is not finite was not flown, and is ignored.
        """
        if not math.isfinite(sum(body_rate) + thrust):
            return
        self._command[: command_row.THRUST], self._command[command_row.THRUST] = body_rate, thrust
        action_from_command(self._command, self._limits, self._action)
