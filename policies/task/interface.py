"""Interface of a policy: views of vehicle and board in, one command out."""

from __future__ import annotations

from typing import NamedTuple, Protocol

Vec3 = tuple[float, float, float]


class VehicleView(Protocol):
    """The vehicle's own estimate (fields of hil.contract.messages.VehicleState); world ENU, body FLU."""

    @property
    def stamp_ns(self) -> int: ...
    @property
    def position(self) -> Vec3: ...
    @property
    def velocity(self) -> Vec3: ...
    @property
    def orientation(self) -> tuple[float, float, float, float]: ...
    @property
    def body_rate(self) -> Vec3: ...


class BoardView(Protocol):
    """The belief about the board, predicted to now (fields of hil.contract.messages.Belief)."""

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
    """Output of one step: body rate rad/s (FLU), collective thrust m/s^2; the driver hovers unless `engaged`."""

    engaged: bool
    body_rate: Vec3
    thrust: float
    phase: str
    thrust_gain: float


class FlyingPolicy(Protocol):
    """A policy: belief and odometry in, commands out, at control steps of 100 Hz.

    It is also stepped between control steps, when a detection has updated the belief, with the last step's odometry.
    """

    def reset(self, now_ns: int) -> None: ...

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command: ...
