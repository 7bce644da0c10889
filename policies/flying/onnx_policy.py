"""What can fly: the planner, or an ONNX file with the house's contract, behind one small interface. No torch here."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from kernel.rotations import body_z
from policies.estimation.odometry import NOW_DIM, VehicleView, odometry_now
from policies.estimation.thrust_drag import G_DRAG, G_GAIN, G_LAGGED, GAIN_DIM, gain_reset, gain_update
from policies.flying.contract import CameraContract, check_contract, open_policy
from policies.flying.shipped import SHIPPED, policy_file
from policies.task.observation import ObservationBuilder, action_from_command, command_from_action
from vehicle.quadrotor.airframe import GRAVITY, Airframe

Vec3 = tuple[float, float, float]


class BoardView(Protocol):
    """The belief about the board, predicted to now (hil.contract.messages.Belief has these)."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def valid(self) -> bool: ...
    @property
    def position(self) -> Vec3: ...
    @property
    def heading(self) -> float: ...
    @property
    def speed(self) -> float: ...
    @property
    def turn_rate(self) -> float: ...
    @property
    def inclination(self) -> float: ...
    @property
    def acceleration(self) -> float: ...
    @property
    def rho(self) -> float: ...
    @property
    def last_exposure_ns(self) -> int: ...
    @property
    def streak(self) -> int: ...
    @property
    def variance(self) -> tuple[float, ...]: ...
    @property
    def surface_sigma(self) -> float: ...


class Command(NamedTuple):
    """One tick's answer: body rate rad/s (FLU), collective thrust m/s^2; not `engaged`: the driver keeps its hover."""

    engaged: bool
    body_rate: Vec3
    thrust: float
    phase: str
    thrust_gain: float


class FlyingPolicy(Protocol):
    """Anything that turns belief and odometry into commands, at ticks of 100 Hz.

    It is stepped between ticks too, as soon as a picture has told something new, with the odometry of the last tick.
    """

    def reset(self, now_ns: int) -> None: ...

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command: ...


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
        self._gain = np.zeros(GAIN_DIM)
        self._action, self._command, self._now = np.zeros(4), np.zeros(4), np.zeros(NOW_DIM)
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
        achieved = self._gain[G_GAIN] * self._gain[G_LAGGED]
        position, velocity, orientation = odometry_now(now_ns, vehicle, achieved, self._gain[G_DRAG], self._now)
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
        platform = np.array(
            [*board.position, board.heading, board.speed, board.turn_rate, board.inclination, 0.0], dtype=np.float64
        )
        self._builder.push(now_ns, platform, between)
        drag = self._gain[G_DRAG]
        observation = self._builder.build(
            now_ns, position, velocity, orientation, board.rho, self._action, gain, drag, board.surface_sigma
        )
        raw = self._session.run(None, {self._input: observation[None]})[0][0]
        self._action[:] = np.clip(raw.astype(np.float64), -1.0, 1.0)
        command_from_action(self._action, self._command)
        p, q, r, thrust = (float(value) for value in self._command)
        return Command(True, (p, q, r), thrust, "network", float(gain))


def policy_factory(name: str, airframe: Airframe, camera: CameraContract | None = None) -> Callable[[], FlyingPolicy]:
    """Makes the policy called `name`: `planner` (it predicts by a network), `planner-analytic`, a shipped network
    (`vision`, `state`), or an ONNX file.

    Raises ContractError for a file that cannot be flown, ValueError for a name that is neither.
    """
    if name == "planner":
        from policies.planner.learned_policy import LearnedPlannerPolicy

        return lambda: LearnedPlannerPolicy(airframe)
    if name == "planner-analytic":
        from policies.planner.policy import PlannerPolicy

        return lambda: PlannerPolicy(airframe)
    file = policy_file(name)
    if file is None or file.suffix != ".onnx":
        known = ", ".join((*SHIPPED, "planner", "planner-analytic"))
        raise ValueError(f"no policy {name!r}: use {known}, or the path of an .onnx file")
    policy = OnnxPolicy(file, airframe, camera)
    return lambda: policy
