"""The vehicle's nodes: the driver with its gate, and the simulated vehicle with the software PX4 or a real firmware."""

from __future__ import annotations

import math
from dataclasses import replace

from hil.assembly.hitl import firmware_events
from hil.assembly.parts import Parts
from hil.nodes.vehicle import VehicleLink
from hil.nodes.vehicle_device import VehicleDevice
from hil.nodes.vehicle_firmware import FirmwareVehicle
from hil.safety.vehicle_gate import VehicleGate
from hil.wires.signing_key import read_signing_key
from vehicle.crazyflie.driver.driver import CrazyflieLink
from vehicle.crazyflie.driver.types import CrazyflieConfig
from vehicle.crazyflie.sim.crazyflie import CrazyflieSim
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import LinkConfig, Signing
from vehicle.px4.hitl.device import BASE_US, HitlVehicle
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor import airframe_row
from vehicle.quadrotor.wind import Wind

# What lets the software PX4 fly on external poses alone, as it must be set on a real one before it boots.
EXTERNAL_POSE_PARAMETERS = {
    "EKF2_EV_CTRL": 11, "EKF2_GPS_CTRL": 0, "EKF2_HGT_REF": 3, "SYS_HAS_GPS": 0, "SENS_EN_GPSSIM": 0,
}  # fmt: skip


def vehicle_device(parts: Parts) -> VehicleDevice:
    """The simulated vehicle, with the drawn errors of its mass, inertia, drag and thrust.

    Raises WireError if the firmware's link cannot be opened."""
    drawn, frame, slot = parts.drawn, parts.frame, parts.rig.vehicle
    x, y, _, yaw = parts.hover_start
    params = frame.params_row()
    params[airframe_row.MASS] *= drawn.mass_factor
    params[airframe_row.INERTIA : airframe_row.INERTIA + 3] *= drawn.inertia_factor
    params[airframe_row.DRAG : airframe_row.DRAG + 3] *= drawn.drag_factor
    params[airframe_row.MOTOR_THRUST] *= drawn.mass_factor * drawn.thrust_to_weight_factor * drawn.thrust_gain
    wire = parts.wires.vehicle_device()
    if slot.kind == "hitl":
        body = HitlVehicle(
            wire, frame, drawn.vehicle_seed, (x, y, 0.0), yaw, params, gps=not slot.external_pose, powered=slot.powered
        )
        return FirmwareVehicle(body, _wind(parts))
    if slot.kind == "crazyflie-sim":
        return VehicleDevice(CrazyflieSim(wire, frame, drawn.vehicle_seed, (x, y, 0.0), yaw, params), _wind(parts))
    parameters = EXTERNAL_POSE_PARAMETERS if slot.external_pose else None
    sim = Px4Sim({"api": wire}, frame, drawn.vehicle_seed, (x, y, 0.0), yaw, parameters=parameters, params_row=params)
    return VehicleDevice(sim, _wind(parts))


def vehicle_link(parts: Parts) -> VehicleLink:
    """The driver of a simulated or real vehicle. Raises ValueError if the signing key cannot be read."""
    rig = parts.rig
    slot, real = rig.vehicle, rig.vehicle.kind in ("mavlink", "crazyflie")
    seen_by_simulation = real and "sim" in (rig.camera.kind, rig.mocap.kind)
    reach = rig.gate.reach if real and rig.mocap.kind != "sim" else None
    virtual_board = real and "sim" in (rig.groundcar.kind, rig.mocap.kind)
    driver = _crazyflie_driver(parts) if slot.kind.startswith("crazyflie") else _px4_driver(parts)
    tilt = None if rig.policy.knows == "mocap" else math.radians(parts.frame.camera.tilt_deg)
    gate = VehicleGate(rig.gate, parts.frame.command, tilt)
    return VehicleLink(driver, gate, seen_by_simulation, slot.external_pose, virtual_board, reach)


def _crazyflie_driver(parts: Parts) -> CrazyflieLink:
    slot = parts.rig.vehicle
    config = CrazyflieConfig(
        parts.hover_start, parts.frame.body.mass, arm=slot.kind != "crazyflie", hover_position=slot.hover_position,
        hover_speed=slot.hover_speed, hover_turning=slot.hover_turning,
    )  # fmt: skip
    return CrazyflieLink(parts.wires.vehicle_link(), config)


def _px4_driver(parts: Parts) -> Px4Link:
    slot = parts.rig.vehicle
    config = LinkConfig(
        start=parts.hover_start, hover_thrust=parts.frame.hover_thrust, steepest=min(parts.steepest, math.pi / 2),
        hover_position=slot.hover_position, hover_speed=slot.hover_speed, hover_turning=slot.hover_turning,
        external_vision=slot.external_pose, events=firmware_events(slot),
    )  # fmt: skip
    link = parts.wires.vehicle_link()
    if slot.kind != "sim":
        config = replace(
            config,
            system=parts.wires.vehicle_system(),
            component=slot.component,
            clock_drift=slot.clock_drift,
            signing=vehicle_signing(slot.signing_key, parts.unix_ns),
            arm=False,  # the host permits it, with what the go is bound to, and motion capture must agree
        )
    if slot.kind == "hitl" and parts.stopwatch is None:  # without real time the firmware's clock is the host's
        config = replace(config, fixed_offset_ns=BASE_US * 1000)
    if slot.kind == "hitl" and not slot.external_pose:  # on GPS its local frame begins where it boots
        x, y, _, _ = parts.hover_start
        config = replace(config, origin=(x, y, 0.0))
    driver = Px4Link(link, config)
    if slot.kind == "hitl" and slot.simulated:
        driver.allow_arming(Arming())  # on no condition; it then tells which firmware it is
    return driver


def _wind(parts: Parts) -> Wind | None:
    wind = parts.scenario.wind
    if wind.gust == 0.0 and not any(wind.mean):
        return None
    return Wind(wind.mean, wind.gust, wind.gust_time, parts.drawn.wind_seed)


def vehicle_signing(path: str, unix_ns: int) -> Signing | None:
    """The signing of the vehicle's link with the key in the file `path`; None without one.

    `unix_ns`: date (Unix time) at which the link's clock shows 0. Raises ValueError if the key cannot be used.
    """
    if not path:
        return None
    return Signing(key=read_signing_key(path), epoch_ns=unix_ns)
