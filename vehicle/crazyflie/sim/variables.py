"""The log variables of the software Crazyflie, by the firmware's names, and what reads each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from kernel.rotations import to_euler
from vehicle.crazyflie.sim.state import Flight
from vehicle.crazyflie.table import Variable
from vehicle.px4.sim.rows import control, estimate
from vehicle.quadrotor import state_row
from vehicle.quadrotor.airframe import GRAVITY

_AXES = "xyz"
_MILLI = 1000.0


def log_variables(flight: Flight) -> tuple[list[Variable], Mapping[str, Callable[[], float]]]:
    """The table's variables in order, and the reader of each by full name. Attitudes in deg, rates in deg/s; the
    firmware's pitch is positive nose up."""
    variables: list[Variable] = []
    sources: dict[str, Callable[[], float]] = {}

    def add(group: str, name: str, kind: str, read: Callable[[], float]) -> None:
        variables.append(Variable(group, name, kind))
        sources[f"{group}.{name}"] = read

    est, row = flight.estimate, flight.row

    def of(at: int, scale: float = 1.0) -> Callable[[], float]:
        return lambda: float(est[at]) * scale

    def angle(axis: int, sign: float) -> Callable[[], float]:
        return lambda: (
            sign * math.degrees(to_euler(tuple(est[estimate.ATTITUDE : estimate.ATTITUDE + 4].tolist()))[axis])
        )

    for axis, name in enumerate(_AXES):
        add("stateEstimate", name, "float", of(estimate.POSITION + axis))
    for axis, name in enumerate(_AXES):
        add("stateEstimate", f"v{name}", "float", of(estimate.VELOCITY + axis))
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        add("stateEstimate", name, "float", angle(axis, -1.0 if axis == 1 else 1.0))
    for at, name in ((1, "qx"), (2, "qy"), (3, "qz"), (0, "qw")):
        add("stateEstimate", name, "float", of(estimate.ATTITUDE + at))
    for axis, name in enumerate(_AXES):
        add("stateEstimateZ", name, "int16", of(estimate.POSITION + axis, _MILLI))
    for axis, name in enumerate(_AXES):
        add("stateEstimateZ", f"v{name}", "int16", of(estimate.VELOCITY + axis, _MILLI))
    for axis, name in enumerate(("rateRoll", "ratePitch", "rateYaw")):
        add("stateEstimateZ", name, "int16", of(estimate.RATE + axis, -_MILLI if axis == 1 else _MILLI))
    for axis, name in enumerate(_AXES):
        add("gyro", name, "float", of(estimate.RATE + axis, math.degrees(1.0)))
    for axis, name in enumerate(_AXES):
        add("acc", name, "float", lambda at=state_row.F + axis: float(row[at]) / GRAVITY)
    add("pm", "vbat", "float", lambda: flight.battery.voltage)
    add("pm", "vbatMV", "uint16", lambda: flight.battery.voltage * 1000.0)
    add("pm", "state", "int8", lambda: float(flight.battery.state))
    add("pm", "batteryLevel", "uint8", lambda: 100.0 * flight.battery.charge)
    add("supervisor", "info", "uint16", lambda: float(flight.info))
    add("sys", "canfly", "uint8", lambda: float(flight.supervisor.can_fly))
    add("sys", "isFlying", "uint8", lambda: float(flight.supervisor.flying))
    add("sys", "isTumbled", "uint8", lambda: float(flight.supervisor.tumbled))
    for name in ("varPX", "varPY", "varPZ"):
        add("kalman", name, "float", lambda: flight.estimator.variance)
    add("stabilizer", "thrust", "float", lambda: flight.word)
    for axis, name in enumerate(("roll", "pitch", "yaw")):
        sign = -1.0 if axis == 1 else 1.0
        add("controller", f"{name}Rate", "float",
            lambda at=control.OUT_RATE + axis, sign=sign: sign * math.degrees(float(flight.control[at])))  # fmt: skip
    add("radio", "rssi", "uint8", lambda: 40.0)
    return variables, sources
