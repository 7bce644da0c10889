"""Checks which devices of a rig are reachable now. It only receives: nothing is sent to a vehicle or a car."""

from __future__ import annotations

import time
from dataclasses import dataclass

from hil.assembly.cameras import open_camera
from hil.assembly.hitl import HitlWires, build_folder, free_instance
from hil.assembly.rig import Rig, VehicleSlot
from hil.wires import WireError
from hil.wires.camera import Mode
from hil.wires.can import open_can
from hil.wires.crazyradio import CrazyradioWire
from hil.wires.mocap_vrpn import VrpnMocap
from hil.wires.url import open_url
from vehicle.px4.codec import Parser

LISTEN_S = 3.0
_CAR_V1, _CAR_V2 = 0x151, 0x221
_CAMERA_HZ = (60.0, 30.0)  # rates of the published scenarios; one of them is enough here


@dataclass(frozen=True)
class Reached:
    """One slot: `text`: what answered, or what to do."""

    slot: str
    kind: str
    ok: bool
    text: str


def reach(rig: Rig, listen_s: float = LISTEN_S) -> list[Reached]:
    """Every slot of `rig`."""
    return [_vehicle(rig, listen_s), _car(rig, listen_s), _camera(rig), _mocap(rig, listen_s)]


def _vehicle(rig: Rig, listen_s: float) -> Reached:
    slot = rig.vehicle
    if slot.kind in ("sim", "crazyflie-sim"):
        return Reached("vehicle", slot.kind, True, "simulated behind its wire")
    if slot.kind == "crazyflie":
        return _crazyflie(slot)
    if slot.simulated:
        return _firmware(slot)
    try:
        if slot.on_hardware:
            HitlWires(slot).close()
        wire = open_url(slot.url)
    except WireError as error:
        return Reached("vehicle", slot.kind, False, str(error))
    parser, frames, until = Parser(), 0, time.monotonic() + listen_s
    while time.monotonic() < until and frames < 20:
        for data in wire.receive():
            frames += len(list(parser.feed(data)))
        time.sleep(0.01)
    wire.close()
    if frames:
        late = getattr(wire, "remark", "")
        return Reached("vehicle", slot.kind, True, f"MAVLink comes in on {slot.url}" + (f"; {late}" if late else ""))
    other = parser.garbage_bytes or getattr(wire, "others_dropped", 0)
    rubbish = "; data that are no MAVLink came" if other else ""
    return Reached("vehicle", slot.kind, False, f"no MAVLink on {slot.url} for {listen_s:g} s{rubbish}")


def _firmware(slot: VehicleSlot) -> Reached:
    build = build_folder(slot)
    try:
        HitlWires(slot, free_instance(slot)).close()
    except WireError as error:
        return Reached("vehicle", slot.kind, False, str(error))
    text = f"each run starts {build}/bin/px4" if build else f"waits for your PX4 SITL at {slot.simulator}"
    return Reached("vehicle", slot.kind, True, text)


def _crazyflie(slot: VehicleSlot) -> Reached:
    """Whether its radio is there. A radio hears only who it asks, so that the Crazyflie itself is not looked for."""
    try:
        CrazyradioWire(slot.url).close()
    except WireError as error:
        return Reached("vehicle", slot.kind, False, str(error))
    return Reached("vehicle", slot.kind, True, f"the radio of {slot.url} is there; the Crazyflie was not asked")


def _car(rig: Rig, listen_s: float) -> Reached:
    slot = rig.groundcar
    if slot.kind == "sim":
        return Reached("groundcar", "sim", True, "simulated behind its wire")
    where = f"{slot.interface} {slot.channel}"
    try:
        wire = open_can(slot.interface, slot.channel)
    except WireError as error:
        return Reached("groundcar", slot.kind, False, str(error))
    ids: set[int] = set()
    until = time.monotonic() + listen_s
    while time.monotonic() < until and not ids & {_CAR_V1, _CAR_V2}:
        ids.update(frame.can_id for frame in wire.receive())
        time.sleep(0.01)
    wire.close()
    if _CAR_V1 in ids:
        return Reached("groundcar", slot.kind, False, f"the car on {where} uses protocol V1 (0x151); V2 is needed")
    if _CAR_V2 in ids:
        return Reached("groundcar", slot.kind, True, f"a Scout with protocol V2 on {where}")
    received = f"{len(ids)} other identifiers" if ids else "nothing"
    return Reached("groundcar", slot.kind, False, f"no car on {where}: {received} in {listen_s:g} s")


def _camera(rig: Rig) -> Reached:
    slot = rig.camera
    if slot.kind == "sim":
        return Reached("camera", "sim", True, f"simulated, {slot.source}")
    trouble = ""
    for rate in _CAMERA_HZ:
        try:
            camera = open_camera(slot, Mode(slot.calibration.width, slot.calibration.height, rate))
        except WireError as error:
            trouble = trouble or str(error)
        else:
            camera.close()
            return Reached("camera", slot.kind, True, f"{camera.mode} from {camera.source}")
    return Reached("camera", slot.kind, False, trouble)


def _mocap(rig: Rig, listen_s: float) -> Reached:
    slot = rig.mocap
    if slot.kind == "sim":
        return Reached("mocap", "sim", True, "simulated")
    bodies = (slot.vehicle_body, slot.board_body)
    try:
        VrpnMocap(slot.server, bodies, 0).wait_for_bodies(listen_s).close()
    except WireError as error:
        return Reached("mocap", slot.kind, False, str(error))
    return Reached("mocap", slot.kind, True, f"{' and '.join(bodies)} are streamed by {slot.server}")
