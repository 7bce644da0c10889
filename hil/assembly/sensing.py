"""Camera, detector and motion capture of a run, of the kind that the rig names, and where the camera is mounted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from groundcar.board.layout import Board
from hil.assembly.cameras import mounted_camera, open_camera
from hil.assembly.parts import Parts
from hil.assembly.rig import CameraSlot
from hil.contract.node import Node
from hil.nodes.camera_device import CameraDevice
from hil.nodes.camera_model import CameraModel
from hil.nodes.camera_sim import CameraSim
from hil.nodes.detector import Detector
from hil.nodes.mocap import MocapNode
from hil.nodes.mocap_device import MocapDevice
from hil.wires.camera import Mode
from hil.wires.mocap_vrpn import VrpnMocap
from kernel.random import stream
from kernel.rotations import from_rotation_vector
from scenarios.draw import Drawn
from vehicle.apriltag.detector import BoardDetector
from vehicle.camera import bias_row
from vehicle.camera.noise import measured_noise, paper_noise
from vehicle.camera.pinhole import Camera
from vehicle.mocap.agreement import BoardSetting
from vehicle.mocap.system import Mocap
from vehicle.quadrotor import airframe as af
from vehicle.render.renderer import Renderer
from vehicle.render.sensor import Sensor

_MS = 1_000_000
_DRAWN_AFTER_NS = 4 * _MS  # in real time: the search of the picture before has the cores for so long


def mounted_cameras(slot: CameraSlot, frame: af.Airframe, drawn: Drawn) -> tuple[Camera, Camera]:
    """(the true camera, the calibrated one). Of a device only the calibrated one is known: that of the airframe's file;
    a recording is taken to be of a run with the same drawn numbers."""
    camera = mounted_camera(slot, frame)
    if slot.kind in ("v4l2", "gstreamer"):
        return camera, camera
    true = replace(camera, tilt=camera.tilt + drawn.camera_tilt_offset)
    return true, replace(true, tilt=true.tilt + drawn.camera_tilt_error)


def camera(parts: Parts) -> Node:
    """The rig's camera, opened. Raises ValueError for a device in a host that does not keep real time, WireError for a
    device that cannot be opened."""
    scenario, slot, drawn = parts.scenario, parts.rig.camera, parts.drawn
    rate, real_time = scenario.camera.rate, parts.stopwatch is not None
    exposure_ns, transport_ns = round(slot.exposure_ms * _MS), round(slot.transport_ms * _MS)
    true, calibrated = mounted_cameras(slot, parts.frame, drawn)
    if slot.kind != "sim":
        if slot.kind != "mcap":
            _needs_real_time("camera", slot.kind, real_time)
        opened = open_camera(slot, Mode(calibrated.width, calibrated.height, rate))
        return CameraDevice(opened, exposure_ns, slot.kind != "mcap")
    if slot.source == "pictures":
        board = Board(size=scenario.board.size)
        renderer = Renderer(true, board, drawn.image_seed, Sensor(gain=slot.gain))
        return CameraSim(renderer, rate, exposure_ns, transport_ns, _DRAWN_AFTER_NS if real_time else 0)
    noise = paper_noise() if slot.model_noise == "paper" else measured_noise()
    bias = np.zeros(bias_row.DIM)
    bias[:3] = drawn.vision_position_bias
    bias[3:] = from_rotation_vector(*drawn.vision_orientation_bias)
    return CameraModel(
        true.row(),
        noise,
        bias,
        stream(drawn.vision_seed),
        rate,
        exposure_ns // 2 + transport_ns,
        round(slot.model_processing_ms * _MS),
    )


def detector(parts: Parts) -> Detector:
    """The AprilTag detector with the calibrated camera."""
    _, calibrated = mounted_cameras(parts.rig.camera, parts.frame, parts.drawn)
    board = Board(size=parts.scenario.board.size)
    return Detector(BoardDetector(calibrated, board), calibrated.row(), parts.stopwatch)


def mocap(parts: Parts) -> Node:
    """The rig's motion capture, its bodies seen. Raises ValueError for a device in a host that does not keep real time,
    WireError for a system that does not answer."""
    slot, real_time = parts.rig.mocap, parts.stopwatch is not None
    delay_ns, seed = round(slot.delay_ms * _MS), parts.drawn.mocap_seed
    if slot.kind == "vrpn":
        _needs_real_time("motion capture", slot.kind, real_time)
        bodies = (slot.vehicle_body, slot.board_body)
        setting = None
        if parts.rig.groundcar.kind != "sim":
            setting = BoardSetting(parts.inclination, parts.scenario.board.height, parts.rig.gate.reach)
        return MocapDevice(VrpnMocap(slot.server, bodies, delay_ns).wait_for_bodies(), *bodies, setting)
    return MocapNode(Mocap(seed), Mocap(seed + 1), slot.rate_hz, delay_ns)


def _needs_real_time(what: str, kind: str, real_time: bool) -> None:
    if not real_time:
        raise ValueError(f"a {what} of kind {kind} keeps real time, which only the live host does: fly with --live")
