"""The planner as a flying policy: belief and odometry in, commands out."""

from __future__ import annotations

import math

import numpy as np

from policies.estimation import belief_state, odometry_row, thrust_row
from policies.estimation.odometry import odometry_now
from policies.planner import estimate_row, phases, state_row
from policies.planner.groups import Vehicle
from policies.planner.params import PlannerParams
from policies.planner.planner import planner_on_estimate, planner_reset
from policies.prediction.future import HORIZON, STEP
from policies.task.interface import BoardView, Command, Vec3, VehicleView
from policies.task.unusable import no_command, why_unusable
from vehicle.quadrotor import command_row
from vehicle.quadrotor.airframe import Airframe

# What the planner changes of GuidanceParams: its own law chooses the thrust (`contact_thrust.py`), and its plans end at
# one lean, however well the surface is known. With the laws' defaults fewer of its flights of Hard-I are in tolerance.
GUIDANCE = {"lean_uncertain": 0.0, "impact_within": 0.0}

# What flight by motion capture changes of PlannerParams, the last ones for boards that take a run-up. Nothing has to
# stay in a camera's view, so that the run-up may pitch down and is short. The flare turns slower than the vehicle can,
# which leaves a reserve. Found on the Crazyflie and a vertical board.
STATE = {"run_up.acceleration": 5.0, "run_up.rate": 2.8, "contact.lean": 0.03}
STATE_STEEP = {"run_up.coast": 0.1, "weights.visibility": 0.0}


def planner_params(airframe: Airframe, by_state: bool = False) -> PlannerParams:
    """The planner's parameters for an airframe: its drag, lag, camera and contact disc, and the range of an action.

    `by_state`: for flight by motion capture."""
    vehicle = Vehicle(
        drag=sum(airframe.body.drag[:2]) / 2 / airframe.body.mass,
        thrust_min=airframe.command.thrust[0],
        thrust_max=airframe.command.thrust[1],
        rate_max=airframe.command.body_rate,
        thrust_lag=airframe.motors.lag,
        camera_tilt=math.radians(airframe.camera.tilt_deg),
        contact_below=airframe.contact.magnet_below,
        contact_radius=airframe.contact.footprint_radius,
    )
    params = PlannerParams(vehicle)
    return params.changed(STATE, STATE_STEEP) if by_state else params


class PlannerPolicy:
    """One planner; engages once the belief is valid and stays engaged. `by_state`: it flies by motion capture."""

    def __init__(self, airframe: Airframe, by_state: bool = False) -> None:
        self._params = planner_params(airframe, by_state).row()
        self._state = np.zeros(state_row.DIM)
        self._estimate, self._x = np.zeros(estimate_row.DIM), np.zeros(belief_state.PREDICTED_DIM)
        self._out = np.zeros(command_row.DIM)
        self._now = np.zeros(odometry_row.DIM)
        self._future = np.zeros((HORIZON, 8))
        self.reset(0)

    def reset(self, now_ns: int) -> None:
        """Start anew; `now_ns` becomes second 0."""
        self._origin_ns, self._engaged = now_ns, False
        planner_reset(self._state, 0.0)

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command:
        """One control tick. What cannot be used of odometry or belief gives no command (policies/task/unusable.py)."""
        if why := why_unusable(now_ns, vehicle, board):
            return no_command(self._engaged, why)
        t, position, velocity, orientation = self._look(now_ns, vehicle, board)
        phase = planner_on_estimate(
            self._state, t, position, velocity, orientation, self._x, self._estimate, self._future, STEP, self._params,
            self._out,
        )  # fmt: skip
        return self._command(phase)

    def flown(self, body_rate: Vec3, thrust: float) -> None:
        """The command after guidance, rad/s and m/s^2: the thrust gain is estimated from it.

        One that is not finite was not flown, and is ignored.
        """
        if not math.isfinite(sum(body_rate) + thrust):
            return
        asked = state_row.ASKED
        self._state[asked : asked + 3], self._state[asked + 3] = body_rate, thrust

    def _look(
        self, now_ns: int, vehicle: VehicleView, board: BoardView
    ) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
        """Fill what is known of the board; the time (s) and the vehicle's position, velocity, orientation, now."""
        variance, estimate = board.variance, self._estimate
        estimate[estimate_row.VALID] = 1.0 if board.valid else 0.0
        estimate[estimate_row.SIGMA] = math.sqrt(max(0.0, 0.5 * (variance[0] + variance[1])))
        estimate[estimate_row.SPEED_SIGMA] = math.sqrt(max(0.0, variance[4]))
        estimate[estimate_row.AGE] = (now_ns - board.last_exposure_ns) * 1e-9
        estimate[estimate_row.STREAK] = board.streak
        estimate[estimate_row.SURFACE] = board.surface_sigma
        self._x[:3] = board.position
        self._x[3:] = board.heading, board.speed, board.turn_rate, board.inclination, board.acceleration
        gain = self._state[state_row.GAIN : state_row.GAIN + thrust_row.DIM]
        now = odometry_now(
            now_ns, vehicle, gain[thrust_row.GAIN] * gain[thrust_row.LAGGED], gain[thrust_row.DRAG], self._now
        )
        return (now_ns - self._origin_ns) * 1e-9, *now

    def _command(self, phase: int) -> Command:
        self._engaged = self._engaged or phase != phases.HOLD
        p, q, r, thrust = (float(value) for value in self._out)
        gain = float(self._state[state_row.GAIN + thrust_row.GAIN])
        return Command(self._engaged, (p, q, r), thrust, phases.PHASES[int(phase)], gain)
