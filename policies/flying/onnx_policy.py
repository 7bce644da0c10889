"""A trained network as a flying policy: an ONNX file with a contract. No torch here."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kernel.rotations import body_z
from policies.estimation import odometry_row, thrust_row
from policies.estimation.odometry import odometry_now
from policies.estimation.thrust_drag import gain_reset, gain_update
from policies.flying.contract import CameraContract, check_contract, open_policy
from policies.task.interface import BoardView, Command, VehicleView
from policies.task.observation import ObservationBuilder, action_from_command, command_from_action
from vehicle.quadrotor.airframe import GRAVITY, Airframe


class OnnxPolicy:
    """A trained network; it waits, not engaged, until the belief is valid, then flies to the end."""

    def __init__(self, path: str | Path, airframe: Airframe, camera: CameraContract | None = None) -> None:
        """Raises ContractError if the file is missing, corrupt or made for something else."""
        self._session, self.contract = open_policy(path)
        check_contract(self.contract, airframe=airframe.name, camera=camera)
        self._input = self._session.get_inputs()[0].name
        self._builder = ObservationBuilder(self.contract.observation.stride)
        self._airframe = airframe
        self._drag = sum(airframe.body.drag[:2]) / 2 / airframe.body.mass
        self._lag = airframe.motors.lag + 0.01
        self._gain = np.zeros(thrust_row.DIM)
        self._action, self._command, self._now = np.zeros(4), np.zeros(4), np.zeros(odometry_row.DIM)
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Forget history, gain and last action; `now_ns` starts the clock."""
        self._builder.reset()
        gain_reset(self._gain, GRAVITY)
        self._command[:] = 0.0, 0.0, 0.0, GRAVITY
        action_from_command(self._command, self._action)
        self._engaged, self._last_ns, self._odometry_ns = False, now_ns, -1

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """One control tick, or, with odometry that it has seen before, between two.

        Raises ValueError if the vehicle's estimate is not finite.
        """
        achieved = self._gain[thrust_row.GAIN] * self._gain[thrust_row.LAGGED]
        position, velocity, orientation = odometry_now(
            now_ns, vehicle, achieved, self._gain[thrust_row.DRAG], self._now
        )
        gain = gain_update(
            self._gain,
            *velocity,
            *body_z(orientation),
            self._command[3],
            (now_ns - self._last_ns) * 1e-9,
            self._lag,
            self._drag,
            GRAVITY,
        )
        between, self._last_ns, self._odometry_ns = vehicle.stamp_ns == self._odometry_ns, now_ns, vehicle.stamp_ns
        self._engaged = self._engaged or board.valid
        if not self._engaged:
            return Command(False, (0.0, 0.0, 0.0), GRAVITY, "hold", gain)
        board_row = np.array(
            [*board.position, board.heading, board.speed, board.turn_rate, board.inclination, 0.0], dtype=np.float64
        )
        self._builder.push(now_ns, board_row, between)
        drag = self._gain[thrust_row.DRAG]
        observation = self._builder.build(
            now_ns, position, velocity, orientation, board.rho, self._action, gain, drag, board.surface_sigma
        )
        raw = self._session.run(None, {self._input: observation[None]})[0][0]
        self._action[:] = np.clip(raw.astype(np.float64), -1.0, 1.0)
        command_from_action(self._action, self._command)
        p, q, r, thrust = (float(value) for value in self._command)
        return Command(True, (p, q, r), thrust, "network", float(gain))
