"""The planner as a flying policy: belief and odometry in, commands out."""

from __future__ import annotations

import math

import numpy as np

from policies.estimation.odometry import NOW_DIM, odometry_now
from policies.estimation.thrust_drag import G_DRAG, G_GAIN, G_LAGGED, GAIN_DIM
from policies.planner.params import PlannerParams
from policies.planner.planner import (
    E_AGE,
    E_SIGMA,
    E_SPEED_SIGMA,
    E_STREAK,
    E_SURFACE,
    E_VALID,
    ESTIMATE_DIM,
    HOLD,
    PHASES,
    PLANNER_DIM,
    S_ASKED,
    S_GAIN,
    planner_on_estimate,
    planner_reset,
)
from policies.prediction.future import HORIZON, STEP
from policies.task.interface import BoardView, Command, Vec3, VehicleView
from vehicle.quadrotor.airframe import Airframe

# What the planner changes of GuidanceParams: its own law chooses the thrust (`contact_thrust.py`), and its plans end at
# one lean, however well the surface is known. With the laws' defaults fewer of its flights of Hard-I are in tolerance.
GUIDANCE = {"lean_uncertain": 0.0, "impact_within": 0.0}


def planner_params(airframe: Airframe) -> PlannerParams:
    """The planner's defaults with the airframe's drag, thrust lag, camera tilt and contact disc, and its limits."""
    return PlannerParams(
        thrust_min=airframe.command.thrust[0],
        thrust_max=airframe.command.thrust[1],
        rate_max=airframe.command.body_rate,
        drag=sum(airframe.body.drag[:2]) / 2 / airframe.body.mass,
        thrust_lag=airframe.motors.lag,
        camera_tilt=math.radians(airframe.camera.tilt_deg),
        robot_l=airframe.contact.magnet_below,
        robot_r=airframe.contact.footprint_radius,
    )


class PlannerPolicy:
    """One planner; engages once the belief is valid and stays engaged."""

    def __init__(self, airframe: Airframe, params: PlannerParams | None = None) -> None:
        self._params = (params or planner_params(airframe)).row()
        self._state = np.zeros(PLANNER_DIM)
        self._estimate, self._x, self._out = np.zeros(ESTIMATE_DIM), np.zeros(8), np.zeros(4)
        self._now = np.zeros(NOW_DIM)
        self._future = np.zeros((HORIZON, 8))
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Start anew; `now_ns` becomes second 0."""
        self._origin_ns, self._engaged = now_ns, False
        planner_reset(self._state, 0.0, self._params)

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """One control tick."""
        t, position, velocity, orientation = self._look(now_ns, vehicle, board)
        phase = planner_on_estimate(
            self._state, t, position, velocity, orientation, self._x, self._estimate, self._future, STEP, self._params,
            self._out,
        )  # fmt: skip
        return self._command(phase)

    def flown(self, body_rate: Vec3, thrust: float) -> None:
        """What guidance made of the last command: what thrust gives is judged by it."""
        self._state[S_ASKED : S_ASKED + 3], self._state[S_ASKED + 3] = body_rate, thrust

    def _look(
        self, now_ns: int, vehicle: VehicleView, board: BoardView
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Fill what is known of the board; the time (s) and the vehicle's position, velocity, orientation, now."""
        variance, estimate = board.variance, self._estimate
        estimate[E_VALID] = 1.0 if board.valid else 0.0
        estimate[E_SIGMA] = math.sqrt(max(0.0, 0.5 * (variance[0] + variance[1])))
        estimate[E_SPEED_SIGMA] = math.sqrt(max(0.0, variance[4]))
        estimate[E_AGE] = (now_ns - board.last_exposure_ns) * 1e-9
        estimate[E_STREAK] = board.streak
        estimate[E_SURFACE] = board.surface_sigma
        self._x[:3] = board.position
        self._x[3:] = board.heading, board.speed, board.turn_rate, board.inclination, board.acceleration
        gain = self._state[S_GAIN : S_GAIN + GAIN_DIM]
        now = odometry_now(now_ns, vehicle, gain[G_GAIN] * gain[G_LAGGED], gain[G_DRAG], self._now)
        return (now_ns - self._origin_ns) * 1e-9, *now

    def _command(self, phase: int) -> Command:
        self._engaged = self._engaged or phase != HOLD
        p, q, r, thrust = (float(value) for value in self._out)
        gain = float(self._state[S_GAIN + G_GAIN])
        return Command(self._engaged, (p, q, r), thrust, PHASES[int(phase)], gain)
