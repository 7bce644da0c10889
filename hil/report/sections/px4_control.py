"""What only the autopilot knows of its control: rate set-points at its own rate, motors, battery, vibration."""

from __future__ import annotations

import numpy as np

from hil.report.drawing.charts import ASKED, BAD, BELIEF, BOARD, SEEN, VEHICLE, TimePlot
from hil.report.drawing.section import Section, table
from hil.report.recorded.flight import Recorded
from hil.report.recorded.ulog import LogTopic, PX4Log
from hil.report.recorded.ulog_clock import LogClock, log_rates

_MOTORS = (VEHICLE, BOARD, BELIEF, SEEN)
_FULL, _IDLE = 0.999, 0.001
_JOINED_HZ = 2.0  # the page joins no samples that are further apart than that
_AXES = (("roll", 1.0), ("pitch", -1.0), ("yaw", -1.0))  # and the sign from FRD to FLU


def build(recorded: Recorded) -> Section:
    section = Section("px4-control", "PX4's own log: rates, motors, battery, vibration")
    log, clock = recorded.log, recorded.log_clock
    if log is None or clock is None or clock.trouble:
        return section
    _rates(section, log, clock)
    _motors(section, recorded, log, clock)
    _battery(section, log, clock)
    _vibration(section, log, clock)
    return section


def topic_of(section: Section, log: PX4Log, name: str, title: str) -> LogTopic | None:
    """A topic of the log; without it the plot `title` is noted as lost."""
    found = log.topics.get(name)
    if found is None:
        section.lost.append((title, f"the log has no {name}"))
    return found


def _rates(section: Section, log: PX4Log, clock: LogClock) -> None:
    asked, achieved = log.topics.get("vehicle_rates_setpoint"), log_rates(log)
    for axis, (name, sign) in enumerate(_AXES):
        plot = TimePlot(f"px4-rate-{axis}", f"PX4: {name} rate", "rad/s", height=130)
        if asked is not None:
            plot.add("set-point", ASKED, clock.run_ns(asked.us), sign * asked[name], "step")
        if achieved is not None:
            plot.add("achieved", VEHICLE, clock.run_ns(achieved[0]), achieved[1][:, axis])
        section.plot(plot)
    rates = [("set-points", asked.hz if asked else 0.0)]
    gyro = log.topics.get("vehicle_angular_velocity")
    rates.append(("gyro", gyro.hz if gyro else 0.0))
    section.text("Logged at " + ", ".join(f"{hz:.0f} Hz ({name})" for name, hz in rates) + ".")


def _motors(section: Section, recorded: Recorded, log: PX4Log, clock: LogClock) -> None:
    motors = topic_of(section, log, "actuator_motors", "motor outputs")
    if motors is not None:
        t = clock.run_ns(motors.us)
        outputs = motors.vector("control", 4)
        plot = TimePlot("px4-motors", "PX4: motor outputs", "1, share of the full range", fixed=(0.0, 1.0))
        for i, colour in enumerate(_MOTORS):
            plot.add(f"motor {i + 1}", colour, t, outputs[:, i])
        section.plot(plot)
        attempt = recorded.during(t)
        if attempt.any():
            rows: list[tuple[object, ...]] = [
                (f"motor {i + 1}", _share(outputs[attempt, i] >= _FULL), _share(outputs[attempt, i] <= _IDLE))
                for i in range(4)
            ]
            section.html(table(("during the attempt", "at full output", "at its least"), rows))
    allocation = log.topics.get("control_allocator_status")
    if allocation is not None:
        plot = TimePlot(
            "px4-unallocated", "PX4: torque that the motors could not give", "1, of the full range", height=120
        )
        torque = allocation.vector("unallocated_torque", 3)
        for axis, colour in enumerate((VEHICLE, BOARD, BELIEF)):
            plot.add(_AXES[axis][0], colour, clock.run_ns(allocation.us), torque[:, axis])
        section.plot(plot)


def _share(rows: np.ndarray) -> str:
    return f"{100 * rows.mean():.1f} %"


def _battery(section: Section, log: PX4Log, clock: LogClock) -> None:
    battery = topic_of(section, log, "battery_status", "battery")
    if battery is None:
        return
    t = clock.run_ns(battery.us)
    for key, title, unit, name, scale in (
        ("px4-voltage", "PX4: battery voltage", "V", "voltage_v", 1.0),
        ("px4-current", "PX4: battery current", "A", "current_a", 1.0),
        ("px4-charge", "PX4: battery charge", "%", "remaining", 100.0),
    ):
        values = scale * battery[name]
        plot = TimePlot(key, title, unit, height=110)
        plot.add(name, VEHICLE, t, np.where(values >= 0.0, values, np.nan))  # -1: not measured
        section.plot(plot)


def _vibration(section: Section, log: PX4Log, clock: LogClock) -> None:
    imu = topic_of(section, log, "vehicle_imu_status", "vibration")
    if imu is None:
        return
    t = clock.run_ns(imu.us)
    for key, title, unit, name in (
        ("px4-shake", "PX4: vibration of the accelerometer", "m/s²", "accel_vibration_metric"),
        ("px4-twist", "PX4: vibration of the gyro", "rad/s", "gyro_vibration_metric"),
    ):
        plot = TimePlot(key, title, unit, height=110)
        plot.add(name, VEHICLE, t, imu[name], "line" if imu.hz > _JOINED_HZ else "dots")
        section.plot(plot)
    if np.ptp(np.nan_to_num(imu.vector("accel_clipping", 3)), axis=0).any():
        plot = TimePlot("px4-clipping", "PX4: samples at the accelerometer's limit", "samples", height=100)
        for axis, colour in enumerate((VEHICLE, BOARD, BAD)):
            plot.add("xyz"[axis], colour, t, imu[f"accel_clipping[{axis}]"])
        section.plot(plot)
