"""Guidance around a policy in flight: the same kernel, on the same inputs, as in the training environment."""

from __future__ import annotations

import math

import numpy as np

from groundcar.motion import board_row
from policies.estimation.own_state import OwnState
from policies.guidance.guide import NOT_FINITE, guide
from policies.guidance.params import GuidanceParams
from policies.task.interface import BoardView, Command, FlyingPolicy, VehicleView
from vehicle.quadrotor import command_row
from vehicle.quadrotor.airframe import GRAVITY, Airframe


class GuidedPolicy:
    """Any flying policy with the laws of `policies/guidance/guide.py` on its commands, once it is engaged.

    Guidance has its own estimate of the vehicle, so that it depends only on the policy's command. If guidance has
    changed the last command, the policy receives the changed one by its method `flown`. A command that is not finite
    is passed on as it is, for the gate, and forgotten.
    """

    def __init__(self, policy: FlyingPolicy, airframe: Airframe, params: GuidanceParams | None = None) -> None:
        """`params`: those of the airframe by default."""
        self._policy, self._own = policy, OwnState(airframe)
        self._row = (params or GuidanceParams.of(airframe)).row()
        self._flown, self._command, self._board = (
            np.zeros(command_row.DIM),
            np.zeros(command_row.DIM),
            np.zeros(board_row.DIM),
        )
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Start anew, the policy too."""
        self._policy.reset(now_ns)
        self._own.reset(now_ns)
        self._flown[:] = 0.0, 0.0, 0.0, GRAVITY

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """The policy's command, guided; with what the policy asked. Raises what the policy raises."""
        asked = self._policy.step(now_ns, vehicle, board)
        if not math.isfinite(sum(asked.body_rate) + asked.thrust):
            laws = NOT_FINITE if asked.engaged else 0
            return asked._replace(asked_rate=asked.body_rate, asked_thrust=asked.thrust, laws=laws)
        own, command = self._own, self._command
        own.update(now_ns, vehicle, self._flown[command_row.THRUST])
        command[: command_row.THRUST], command[command_row.THRUST] = asked.body_rate, asked.thrust
        laws = 0
        if asked.engaged:
            self._board[: board_row.U] = *board.position, board.heading, board.speed, board.turn_rate, board.inclination
            laws = guide(
                command, own.position, own.velocity, own.orientation, self._board, board.surface_sigma, self._flown,
                own.gain, own.drag, self._row,
            )  # fmt: skip
        self._flown[:] = command
        guided = asked._replace(asked_rate=asked.body_rate, asked_thrust=asked.thrust, laws=laws)
        if laws in (0, NOT_FINITE):
            return guided
        roll, pitch, yaw, thrust = command.tolist()
        self._policy.flown((roll, pitch, yaw), thrust)
        return guided._replace(body_rate=(roll, pitch, yaw), thrust=thrust)

    def flown(self, body_rate: tuple[float, float, float], thrust: float) -> None:
        """Pass the command that was flown (rad/s FLU, m/s^2) on to the policy; one that is not finite is ignored."""
        if not math.isfinite(sum(body_rate) + thrust):
            return
        self._flown[: command_row.THRUST], self._flown[command_row.THRUST] = body_rate, thrust
        self._policy.flown(body_rate, thrust)
