"""Faults that only a real firmware shows, made at our side of its sensors, its battery and its power.

Each names its safe end: what the flight must come to. A firmware that has no sensor left to fly by has none.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from hil.faults.fault import FIRMWARE, Fault, Host, Parameters, Setting
from hil.nodes.vehicle_firmware import FirmwareVehicle
from vehicle.px4.codec import Packer, Parser
from vehicle.px4.hitl.device import HitlVehicle
from vehicle.px4.protocol import Command

Length = Annotated[float, Field(ge=-500, le=500)]
_BATTERY, _OFF = 100.0, 1.0  # MAVLink's FAILURE_UNIT_SYSTEM_BATTERY and FAILURE_TYPE_OFF
_STATION = (255, 190)  # ids of a ground station


def _body(host: Host) -> HitlVehicle:
    assert isinstance(host.node, FirmwareVehicle)
    return host.node.body


class _Firmware(Fault):
    nodes = ("vehicle_device",)

    @classmethod
    def complaint(cls, parameters: Any, setting: Setting) -> str:
        if FIRMWARE not in setting.simulated:
            return "acts on a real firmware whose sensors are simulated: fly the rig px4-firmware"
        return super().complaint(parameters, setting)


class SensorStuck(_Firmware):
    """A sensor repeats its last reading. Safe end: perched, missed or aborted, on the ground; none of gyro and
    accelerometer, of which the firmware has one each."""

    kind = "sensor.stuck"

    class Parameters(Parameters):
        sensor: Literal["accelerometer", "gyro", "magnetometer", "barometer", "gps"] = "magnetometer"

    def begin(self, host: Host) -> None:
        _body(host).sensors.stuck.add(self.p.sensor)

    def end(self, host: Host) -> None:
        _body(host).sensors.stuck.discard(self.p.sensor)


class GpsLoss(_Firmware):
    """The receiver is silent. Safe end: perched, missed or aborted, on the ground: the estimator goes on by inertia,
    and the firmware's failsafe lands once its position is no longer valid."""

    kind = "gps.loss"

    def begin(self, host: Host) -> None:
        _body(host).sensors.gps_lost = True

    def end(self, host: Host) -> None:
        _body(host).sensors.gps_lost = False


class EstimatorReset(_Firmware):
    """GPS is off by (x, y, z) m, at once: the estimator rejects it for seconds, then resets its estimate to it.

    Safe end: perched, missed or aborted, on the ground."""

    kind = "estimator.reset"

    class Parameters(Parameters):
        x: Length = 8.0
        y: Length = 0.0
        z: Length = 0.0

    def begin(self, host: Host) -> None:
        _body(host).sensors.gps_offset[:] = self.p.x, self.p.y, self.p.z

    def end(self, host: Host) -> None:
        _body(host).sensors.gps_offset[:] = 0.0


class FirmwareReboot(_Firmware):
    """The firmware loses power and boots again: its motors stop. Safe end: none in the air, where the vehicle falls;
    the driver gives up, and nothing arms it again."""

    kind, final = "firmware.reboot", True

    @classmethod
    def complaint(cls, parameters: Any, setting: Setting) -> str:
        if setting.live:
            return "restarts a process that a lockstep run has started: fly without --live"
        return super().complaint(parameters, setting)

    def begin(self, host: Host) -> None:
        _body(host).reboot()


class BatteryEmpty(_Firmware):
    """The firmware measures an empty battery: a SITL models its battery itself, and is told by MAVLink's failure
    injection. Safe end: aborted, on the ground: its failsafe lands it."""

    kind, nodes, final = "battery.empty", ("vehicle_link",), True
    _told = False

    def carried(self, item: Any, outward: bool) -> list[tuple[int, Any]]:
        target = 0 if self._told or not outward else _target(item)
        self._told = self._told or target > 0
        return [(0, item), *([(0, _empty_battery(target))] if target else [])]


def _target(data: bytes) -> int:
    """The system that `data` is addressed to; 0 for none."""
    return max((getattr(frame.fields, "target_system", 0) for frame in Parser().feed(data)), default=0)


def _empty_battery(system: int) -> bytes:
    values = (system, 1, int(Command.INJECT_FAILURE), 0, _BATTERY, _OFF, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Packer(*_STATION).send_name("COMMAND_LONG", *values)


KINDS = (SensorStuck, GpsLoss, EstimatorReset, FirmwareReboot, BatteryEmpty)
