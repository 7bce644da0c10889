"""The interface of everything that flies: views of vehicle and board in, one command out."""

from __future__ import annotations

from typing import NamedTuple, Protocol

Vec3 = tuple[float, float, float]


class VehicleView(Protocol):
    """The vehicle's own estimate (hil.contract.messages.VehicleState has these)."""

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
    """One tick's answer: body rate rad/s (FLU), collective thrust m/s^2; not `engaged`: the driver keeps its hover.

    `asked_*`: what the policy asked before guidance, `laws` which laws of guidance acted (bits of
    `policies/guidance/guide.py`); without guidance they are absent.
    """

    engaged: bool
    body_rate: Vec3
    thrust: float
    phase: str
    thrust_gain: float
    asked_rate: Vec3 | None = None
    asked_thrust: float | None = None
    laws: int = 0


class FlyingPolicy(Protocol):
    """A policy: it turns belief and odometry into commands, at ticks of 100 Hz.

    It is also stepped between two ticks, when a detection has updated the belief, with the odometry of the last tick.
    """

    def reset(self, now_ns: int) -> None: ...

    def step(self, now_ns: int, vehicle: VehicleView, board: BoardView) -> Command: ...

    def flown(self, body_rate: Vec3, thrust: float) -> None:
        """Receive the command that guidance put in place of the last one returned (rad/s FLU, m/s^2)."""
        ...
