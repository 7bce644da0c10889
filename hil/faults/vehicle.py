"""Faults of the simulated vehicle, software PX4 or Crazyflie: autopilot, battery, motors, wind, magnet."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, ClassVar

from pydantic import Field

from hil.contract.messages import Contact
from hil.faults.fault import FIRMWARE, Fault, Host, Parameters, Setting, Share
from hil.nodes.vehicle_device import VehicleDevice
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.px4.sim.rows import estimate_error
from vehicle.quadrotor import airframe_row, state_row

Speed = Annotated[float, Field(ge=-30, le=30)]
Length = Annotated[float, Field(ge=-20, le=20)]


def _device(host: Host) -> VehicleDevice:
    assert isinstance(host.node, VehicleDevice)
    return host.node


def _sim(host: Host) -> Px4Sim | CrazyflieSim:
    sim = _device(host).sim
    assert isinstance(sim, Px4Sim | CrazyflieSim)  # `device`: no other vehicle gets here
    return sim


class _Vehicle(Fault):
    """`plant_only`: it acts on the body and its surroundings, whatever autopilot flies it."""

    nodes, device = ("vehicle_device",), "vehicle"
    plant_only: ClassVar[bool] = False

    @classmethod
    def complaint(cls, parameters: Any, setting: Setting) -> str:
        if FIRMWARE in setting.simulated:
            return "" if cls.plant_only else "acts on a software autopilot, not on a real firmware"
        return super().complaint(parameters, setting)


class AutopilotReboot(_Vehicle):
    """The autopilot restarts: its motors stop, and it boots where the vehicle is."""

    kind = "autopilot.reboot"

    def begin(self, host: Host) -> None:
        before = _sim(host).row.copy()
        host.rebuild()
        body = slice(state_row.P, state_row.W + 3)
        _sim(host).row[body] = before[body]


class EstimatorJump(_Vehicle):
    """The autopilot's estimate of its position is off by (x, y, z) m, at once."""

    kind = "estimator.jump"

    class Parameters(Parameters):
        x: Length = 2.0
        y: Length = 0.0
        z: Length = 0.0

    def act(self, host: Host) -> None:
        at = estimate_error.POSITION_BIAS
        _sim(host).estimate_error[at : at + 3] = self.p.x, self.p.y, self.p.z


class BatterySag(_Vehicle):
    """The battery is empty, and its voltage sags: the motors give the share `thrust` of their thrust."""

    kind = "battery.sag"

    class Parameters(Parameters):
        thrust: Share = 0.8

    def begin(self, host: Host) -> None:
        _sim(host).params[airframe_row.MOTOR_THRUST] *= self.p.thrust

    def act(self, host: Host) -> None:
        _sim(host).drain()

    def end(self, host: Host) -> None:
        _sim(host).params[airframe_row.MOTOR_THRUST] /= self.p.thrust


class MotorLoss(_Vehicle):
    """One motor (0 to 3) gives only a share of its thrust."""

    kind = "motor.loss"

    class Parameters(Parameters):
        motor: Annotated[int, Field(ge=0, le=3)] = 0
        remaining: Annotated[float, Field(ge=0, lt=1)] = 0.7

    def begin(self, host: Host) -> None:
        _sim(host).fail_motor(self.p.motor, self.p.remaining)

    def end(self, host: Host) -> None:
        _sim(host).fail_motor(self.p.motor, 1.0)


class MotorSlow(_Vehicle):
    """All motors follow their commands `factor` times as slowly."""

    kind = "motor.slow"

    class Parameters(Parameters):
        factor: Annotated[float, Field(gt=1, le=10)] = 2.0

    def begin(self, host: Host) -> None:
        _sim(host).params[airframe_row.MOTOR_LAG] *= self.p.factor

    def end(self, host: Host) -> None:
        _sim(host).params[airframe_row.MOTOR_LAG] /= self.p.factor


class _Gust:
    """The scenario's wind with a gust on top."""

    def __init__(self, wind: Any, gust: tuple[float, float, float]) -> None:
        self.wind, self._gust = wind, gust

    def at(self, now_ns: int) -> tuple[float, float, float]:
        x, y, z = self.wind.at(now_ns) if self.wind is not None else (0.0, 0.0, 0.0)
        return x + self._gust[0], y + self._gust[1], z + self._gust[2]


class WindGust(_Vehicle):
    """A gust of (x, y, z) m/s on top of the scenario's wind."""

    kind, plant_only = "wind.gust", True

    class Parameters(Parameters):
        x: Speed = 6.0
        y: Speed = 0.0
        z: Speed = 0.0

    def begin(self, host: Host) -> None:
        device = _device(host)
        device.wind = _Gust(device.wind, (self.p.x, self.p.y, self.p.z))

    def end(self, host: Host) -> None:
        device = _device(host)
        if isinstance(device.wind, _Gust):
            device.wind = device.wind.wind
        if device.wind is None:
            device.sim.set_wind((0.0, 0.0, 0.0))


class MagnetOff(_Vehicle):
    """The magnet does not hold."""

    kind, plant_only = "magnet.off", True

    def incoming(self, topic: str, message: Any) -> Any | None:
        return replace(message, attached=False) if isinstance(message, Contact) else message


KINDS = (AutopilotReboot, EstimatorJump, BatterySag, MotorLoss, MotorSlow, WindGust, MagnetOff)
