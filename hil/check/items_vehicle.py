"""Automatic checks of the quadrotor and of motion capture."""

from __future__ import annotations

import math
from contextlib import suppress

from hil.bench.devices import Context
from hil.bench.reading import NotApplicable, Unavailable
from hil.check.judge import Reading
from hil.check.registry import check
from hil.contract.messages import Action, VehicleState
from hil.recording.autopilot_parameters import changes, last_flight
from hil.safety.vehicle_gate import VehicleGate
from vehicle.px4 import protocol as px4

_NO_READING = 65535
_GRAVITY = 9.80665


@check("vehicle.heartbeat", unit="s")
def heartbeat(context: Context) -> Reading:
    """Age of the autopilot's last HEARTBEAT."""
    ground = context.ground()
    beat = ground.latest("HEARTBEAT")
    age = (ground.until_ns - ground.received["HEARTBEAT"][-1][0]) * 1e-9
    if beat.autopilot != px4.AUTOPILOT_PX4:
        return Reading(age, f"autopilot type {beat.autopilot} is not PX4", ground.source, ok=False)
    return Reading(age, f"mode {px4.mode_name(beat.custom_mode)}", ground.source)


@check("vehicle.disarmed")
def disarmed(context: Context) -> Reading:
    """The autopilot reports that it is disarmed."""
    ground = context.ground()
    armed = bool(ground.latest("HEARTBEAT").base_mode & px4.BaseMode.ARMED)
    return Reading(not armed, "armed!" if armed else "", ground.source, ok=not armed)


@check("vehicle.prearm")
def prearm(context: Context) -> Reading:
    """The PREARM bit of SYS_STATUS: the autopilot's own checks pass."""
    ground = context.ground()
    health = ground.latest("SYS_STATUS").onboard_control_sensors_health
    fine = bool(health & px4.PREARM_CHECK)
    why = "" if fine else "; ".join(ground.notes[-2:]) or "the autopilot gives no reason"
    return Reading(fine, why, ground.source, ok=fine)


@check("vehicle.sensors", unit="sensors")
def sensors(context: Context) -> Reading:
    """Sensors that are present and enabled but not healthy, counted from SYS_STATUS."""
    ground = context.ground()
    status = ground.latest("SYS_STATUS")
    wanted = status.onboard_control_sensors_present & status.onboard_control_sensors_enabled
    unhealthy = wanted & ~status.onboard_control_sensors_health & ~px4.PREARM_CHECK
    return Reading(unhealthy.bit_count(), f"bits {unhealthy:#x} of SYS_STATUS" if unhealthy else "", ground.source)


@check("vehicle.battery", unit="%")
def battery(context: Context) -> Reading:
    """Remaining charge, as the autopilot reports it."""
    ground = context.ground()
    status = ground.latest("SYS_STATUS")
    volts = "" if status.voltage_battery == _NO_READING else f"{status.voltage_battery / 1000:.2f} V"
    if status.battery_remaining < 0:
        raise Unavailable(f"the autopilot does not know the battery's charge ({volts or 'nor its voltage'})")
    return Reading(int(status.battery_remaining), volts, ground.source)


@check("vehicle.estimator")
def estimator(context: Context) -> Reading:
    """Worst test ratio of the autopilot's estimator (ESTIMATOR_STATUS); 1 is where it starts to reject."""
    ground = context.ground()
    status = ground.latest("ESTIMATOR_STATUS")
    ratios = {n: getattr(status, f"{n}_ratio") for n in ("vel", "pos_horiz", "pos_vert", "mag", "hagl")}
    worst = max(ratios, key=lambda name: ratios[name] if math.isfinite(ratios[name]) else math.inf)
    return Reading(float(ratios[worst]), f"worst: {worst}", ground.source)


@check("vehicle.odometry", unit="Hz")
def odometry(context: Context) -> Reading:
    """Rate at which the autopilot sends ODOMETRY after 100 Hz were requested."""
    ground = context.ground()
    ground.latest("ODOMETRY")
    return Reading(ground.rate_hz("ODOMETRY"), f"over {ground.listened_ns * 1e-9:.1f} s", ground.source)


@check("vehicle.clock", unit="ms")
def clock(context: Context) -> Reading:
    """Uncertainty of the clock offset to the autopilot: half the round trip of TIMESYNC."""
    ground = context.ground()
    if not ground.received.get("TIMESYNC"):
        raise Unavailable("the autopilot does not answer TIMESYNC")
    return Reading(ground.round_trip_ns * 0.5e-6, f"offset {ground.clock_offset_ns * 1e-9:.3f} s", ground.source)


@check("vehicle.identity")
def identity(context: Context, *, uid: str = "") -> Reading:
    """The autopilot's UID: a go is for this one only. `uid` in the list requires a certain one."""
    found = context.identity()
    same = not uid or found.uid == uid.lower()
    detail = f"firmware {found.firmware or 'unknown'}"
    return Reading(found.uid, detail if same else f"the list requires {uid}", context.ground().source, ok=same)


@check("vehicle.parameter")
def parameter(context: Context, *, name: str) -> Reading:
    """A parameter as the autopilot holds it now, after the driver has set its own."""
    ground = context.ground()
    try:
        value = ground.parameters[name]
    except KeyError:
        raise Unavailable(
            f"the autopilot does not answer a request for {name}: perhaps this firmware has no such parameter"
        ) from None
    return Reading(value, name, ground.source)


@check("vehicle.parameters_changed", unit="parameters")
def parameters_changed(context: Context) -> Reading:
    """Parameters that differ from the last flight of this rig, of those in its manifest."""
    found = last_flight(context.out, context.rig_name)
    if found is None:
        raise NotApplicable(f"no earlier flight of rig {context.rig_name} under {context.out} holds parameters")
    run, before = found
    ground = context.ground()
    now: dict[str, float] = {}
    for name in before:
        with suppress(KeyError):  # the parameter does not exist now: that is a change too
            now[name] = ground.parameters[name]
    if not now:
        raise Unavailable("the autopilot answers no request for the parameters of that flight")
    texts = [f"{c.name} {_plain(c.other)}, now {_plain(c.value)}" for c in changes(now, before)]
    detail = f"{len(before)} compared with {run.path.name}"
    return Reading(len(texts), f"{'; '.join(texts)} ({detail})" if texts else detail, ground.source)


def _plain(value: float | None) -> str:
    return "gone" if value is None else f"{value:g}"


@check("vehicle.tilt_limit")
def tilt_limit(context: Context) -> Reading:
    """The failure detector lets the vehicle tilt as far as the board does, or its termination is switched off."""
    ground = context.ground()
    breaker = ground.parameters["CBRK_FLIGHTTERM"]
    limits = [ground.parameters["FD_FAIL_P"], ground.parameters["FD_FAIL_R"]]
    detail = f"FD_FAIL_P {limits[0]:g}, FD_FAIL_R {limits[1]:g} deg, CBRK_FLIGHTTERM {breaker:g}"
    needed = context.scenario.board.inclination_deg + 10.0
    fine = breaker == 121212 or all(limit == 0 or limit >= needed for limit in limits)
    what = "" if fine else f"; a perch at {needed - 10:g} deg needs {needed:g} or CBRK_FLIGHTTERM 121212"
    return Reading("ok" if fine else "too tight", detail + what, ground.source, ok=fine)


@check("vehicle.offboard_loss", unit="s")
def offboard_loss(context: Context) -> Reading:
    """Tried in a flight: from the last set-point until the autopilot leaves OFFBOARD by itself."""
    trial = context.trial()
    if trial.loss_s is None:
        return Reading(None, "still in OFFBOARD after 5 s without set-points", trial.source, ok=False)
    return Reading(trial.loss_s, f"went to {trial.loss_mode}", trial.source)


@check("vehicle.kill", unit="s")
def kill(context: Context) -> Reading:
    """Tried in the air: from the kill command until it is disarmed and no motor gives thrust."""
    trial = context.trial()
    if trial.kill_s is None or trial.motors_off_s is None:
        return Reading(None, "the motors still turned after 3 s", trial.source, ok=False)
    return Reading(trial.motors_off_s, f"disarmed after {trial.kill_s:.3f} s", trial.source)


@check("gate.fence", unit="m")
def fence(context: Context) -> Reading:
    """Least distance between the scenario's workspace and the gate's fence; each side of the fence is tried."""
    limits, space = context.rig.gate, context.scenario.workspace
    sides = [(axis, end) for axis in range(3) for end in range(2)]
    fences, spaces = (limits.x, limits.y, limits.z), (space.x, space.y, space.z)
    middle = [0.5 * (low + high) for low, high in fences]
    if _trips(limits, middle):
        return Reading(None, f"the gate trips in the middle of its fence: {_trips(limits, middle)}", "gate", ok=False)
    for axis, end in sides:
        place = list(middle)
        place[axis] = fences[axis][end] + (0.01 if end else -0.01)
        if "fence" not in _trips(limits, place):
            return Reading(None, f"outside at {place} and the gate did not trip", "gate", ok=False)
    room = min((fences[a][e] - spaces[a][e]) * (1 if e else -1) for a, e in sides)
    return Reading(room + 0.0, "tried on six sides", "gate")


def _trips(limits, place: list[float]) -> str:
    gate = VehicleGate(limits)
    x, y, z = place
    still, level = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
    gate.check(0, Action(0, True, still, _GRAVITY, "", 0, 1.0), VehicleState(0, (x, y, z), still, level, still))
    return gate.tripped
