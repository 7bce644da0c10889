"""The camera that a rig names: as it is calibrated and mounted, and opened."""

from __future__ import annotations

import math

from hil.assembly.rig import CameraSlot
from hil.wires import WireError
from hil.wires.camera import CameraWire, Mode, undistortion
from hil.wires.camera_gstreamer import open_gstreamer
from hil.wires.camera_mcap import RecordedCamera
from hil.wires.camera_opencv import open_v4l2
from policies.flying.contract import CameraContract
from vehicle.camera.pinhole import Camera
from vehicle.quadrotor.airframe import Airframe


def mounted_camera(slot: CameraSlot, frame: Airframe) -> Camera:
    """The camera of `slot` where the airframe's file puts it: a device as it is calibrated, else the paper's."""
    found = slot.calibration.model_dump(exclude={"distortion"}) if slot.kind in ("v4l2", "gstreamer") else {}
    return Camera(**found, offset=frame.camera.offset, tilt=math.radians(frame.camera.tilt_deg))


def camera_contract(slot: CameraSlot, frame: Airframe) -> CameraContract:
    """The same, to compare with the camera that a policy was made with."""
    camera = mounted_camera(slot, frame)
    return CameraContract(**{name: getattr(camera, name) for name in CameraContract.model_fields})


def open_camera(slot: CameraSlot, mode: Mode) -> CameraWire:
    """The camera of `slot` in `mode`. Raises WireError if it is not there, or grants another mode."""
    delay_ms = slot.exposure_ms / 2 + slot.transport_ms
    if slot.kind == "mcap":
        return RecordedCamera(slot.device, mode)
    correct = None
    if any(slot.calibration.distortion):
        lens = Camera(**slot.calibration.model_dump(exclude={"distortion"}))
        correct = undistortion(lens.matrix, slot.calibration.distortion, mode)
    if slot.kind == "gstreamer":
        return open_gstreamer(slot.device, mode, arrival_delay_ms=delay_ms, correct=correct)
    if slot.kind == "v4l2":
        return open_v4l2(
            slot.device,
            mode,
            pixel_format=slot.pixel_format,
            exposure_ms=slot.exposure_ms,
            arrival_delay_ms=delay_ms,
            stamped=slot.stamps == "driver",
            stamp_offset_ms=slot.stamp_offset_ms,
            correct=correct,
        )
    raise WireError(f"a camera of kind {slot.kind} is no device")
