"""Automatic checks of the ground car."""

from __future__ import annotations

from hil.bench.devices import Context
from hil.check.judge import Reading
from hil.check.registry import check


@check("car.mode")
def mode(context: Context) -> Reading:
    """The car's control mode after CAN control was requested."""
    car = context.car()
    return Reading(car.feedback.mode or "not reported", car.feedback.fault, car.source)


@check("car.fault")
def fault(context: Context) -> Reading:
    """Faults the car reports, the e-stop and the remote control among them; `none` if there are none."""
    car = context.car()
    return Reading(car.feedback.fault or "none", "", car.source)


@check("car.battery", unit="V")
def battery(context: Context) -> Reading:
    """The car's battery voltage."""
    car = context.car()
    return Reading(car.feedback.battery_v, "", car.source)


@check("car.stop", unit="s")
def stop(context: Context, *, speed: float = 0.3) -> Reading:
    """Tried: one second at `speed` (m/s), then no commands; time until it brakes by itself (500 ms watchdog)."""
    car = context.car()
    report = car.try_stop(speed)
    if report.slowing_s is None or report.standing_s is None:
        return Reading(None, f"still driving 3 s after the last command, {report.rolled_m:.2f} m on", car.source, False)
    detail = f"from {report.speed:.2f} m/s; stood after {report.standing_s:.2f} s and {report.rolled_m:.2f} m"
    return Reading(report.slowing_s, detail, car.source)
