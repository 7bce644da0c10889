"""Automatic checks of a Crazyflie."""

from __future__ import annotations

import math

from hil.bench.devices import Context
from hil.check.judge import Reading
from hil.check.registry import check
from vehicle.crazyflie.crtp import Info


@check("crazyflie.firmware")
def firmware(context: Context) -> Reading:
    """The firmware's release; one with another version of CRTP gives no answer here."""
    report = context.crazyflie()
    return Reading(report.identity.firmware, "", report.source)


@check("crazyflie.battery", unit="V")
def battery(context: Context) -> Reading:
    """Its battery at rest."""
    report = context.crazyflie()
    return Reading(report.status.battery_v, "at rest", report.source)


@check("crazyflie.upright")
def upright(context: Context) -> Reading:
    """It is neither tumbled, crashed nor locked, and its tumble check is on."""
    report = context.crazyflie()
    bad = [bit.name.lower() for bit in (Info.TUMBLED, Info.CRASHED, Info.LOCKED) if report.status.has(bit)]
    if report.parameters.get("supervisor.tmblChckEn") != 1.0:
        bad.append("the tumble check is off (supervisor.tmblChckEn)")
    return Reading(not bad, ", ".join(bad), report.source, ok=not bad)


@check("crazyflie.pose", unit="m")
def pose(context: Context) -> Reading:
    """How well it knows where it is, by motion capture: the largest sigma of its position."""
    report = context.crazyflie()
    return Reading(math.sqrt(max(0.0, report.status.variance)), "", report.source)


@check("crazyflie.odometry", unit="Hz")
def odometry(context: Context) -> Reading:
    """Rate of its state estimate."""
    report = context.crazyflie()
    return Reading(report.odometry_hz, "", report.source)


@check("crazyflie.battery_load", unit="V")
def battery_load(context: Context) -> Reading:
    """Tried in a flight: its battery under the load of a hover."""
    trial = context.crazyflie_trial()
    return Reading(trial.hover_v, "hovering", trial.source)


@check("crazyflie.radio_loss", unit="s")
def radio_loss(context: Context) -> Reading:
    """Tried in a flight: from the loss of the radio until its motors have stopped; it flies level before."""
    trial = context.crazyflie_trial()
    if trial.level_s is None or trial.stop_s is None:
        return Reading(None, "it neither levelled nor stopped its motors within 5 s", trial.source, ok=False)
    return Reading(trial.stop_s, f"flew level after {trial.level_s:.2f} s", trial.source)
