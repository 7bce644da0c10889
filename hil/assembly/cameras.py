"""The camera that a rig names: as it is calibrated and mounted, and opened."""

from __future__ import annotations

import math

from hil.assembly.rig import CameraSlot
from hil.wires import WireError
from hil.wires.camera import CameraWire, Mode
from hil.wires.camera_gstreamer import open_gstreamer
from hil.wires.camera_mcap import RecordedCamera
from hil.wires.camera_opencv import open_v4l2
from policies.flying.contract import CameraContract
from vehicle.camera.distortion import edges
from vehicle.camera.pinhole import Camera
from vehicle.quadrotor.airframe import Airframe


def mounted_camera(slot: CameraSlot, frame: Airframe) -> Camera:
    """The camera of `slot` as it is calibrated, where the airframe's file puts it."""
    found = slot.calibration.model_dump(exclude={"model", "distortion"})
    mount = frame.camera
    return Camera(**found, offset=mount.offset, tilt=math.radians(mount.tilt_deg), lens=slot.calibration.lens)


def camera_contract(slot: CameraSlot, frame: Airframe) -> CameraContract:
    """The same, to compare with the camera that a policy was made with: without its distortion, with what it sees."""
    camera = mounted_camera(slot, frame)
    left, right, upper, lower = edges(camera)
    return CameraContract(
        width=round(right - left), height=round(lower - upper), fx=camera.fx, fy=camera.fy,
        cx=camera.cx - left - 0.5, cy=camera.cy - upper - 0.5, offset=camera.offset, tilt=camera.tilt,
    )  # fmt: skip


def open_camera(slot: CameraSlot, mode: Mode) -> CameraWire:
    """The camera of `slot` in `mode`. Raises WireError if it is not there, or grants another mode."""
    delay_ms = slot.exposure_ms / 2 + slot.transport_ms
    if slot.kind == "mcap":
        return RecordedCamera(slot.device, mode)
    if slot.kind == "gstreamer":
        return open_gstreamer(slot.device, mode, arrival_delay_ms=delay_ms)
    if slot.kind == "v4l2":
        return open_v4l2(
            slot.device,
            mode,
            pixel_format=slot.pixel_format,
            exposure_ms=slot.exposure_ms,
            arrival_delay_ms=delay_ms,
            stamped=slot.stamps == "driver",
            stamp_offset_ms=slot.stamp_offset_ms,
        )
    raise WireError(f"a camera of kind {slot.kind} is no device")
