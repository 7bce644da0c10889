"""The simulated camera on a stand: pictures of the board from a known place, decoded and compared with the set-up."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from groundcar.board.layout import Board, rotation_from_car
from hil.assembly.rig import Rig
from hil.assembly.sensing import mounted_cameras
from hil.bench.reading import NotApplicable, Unavailable
from kernel.rotations import body_z, from_euler, from_matrix, rotate
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.apriltag.detector import BoardDetector, BoardPose, world_board_pose
from vehicle.camera.pinhole import Camera
from vehicle.mocap.system import Mocap
from vehicle.quadrotor.airframe import Airframe
from vehicle.render.pose import motion_row
from vehicle.render.renderer import Renderer
from vehicle.render.sensor import Sensor

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]

_MS = 1_000_000
PICTURES = 10
_OFF_NORMAL = math.radians(30.0)  # line of sight to the board's normal: a view along the normal measures tilt badly


@dataclass(frozen=True)
class BoardMeasurement:
    """Result of one picture. `distance` (m) camera to board, `inclination` (deg) of the board, both as measured."""

    pose: BoardPose
    distance: float
    inclination: float
    brightness: float  # mean of the picture, DN
    contrast: float  # 2nd to 98th percentile of the board's part, DN


class CameraBench:
    """Vehicle held on a stand, its pose known from motion capture; the camera renders, the detector decodes."""

    def __init__(self, scenario: Scenario, rig: Rig, airframe: Airframe, drawn: Drawn) -> None:
        self._true, self.camera = mounted_cameras(rig.camera, airframe, drawn)
        self.board = Board(size=scenario.board.size)
        self.set_deg = scenario.board.inclination_deg
        self.wanted_hz = scenario.camera.rate
        self._height = scenario.board.height
        self._slot, self._drawn = rig.camera, drawn
        self._kept: dict[float, list[BoardMeasurement]] = {}
        self.source = "rendered pictures, AprilTag detector"

    @property
    def mode(self) -> tuple[int, int, float]:
        """Width, height (px) and rate (Hz) that the camera delivers."""
        exposure_s = self._slot.exposure_ms * 1e-3
        return self._true.width, self._true.height, min(self.wanted_hz, 1.0 / exposure_s)

    def measure_board(self, distance: float) -> list[BoardMeasurement]:
        """Ten pictures from `distance` (m). Raises NotApplicable for a camera model, Unavailable for a bad distance."""
        if self._slot.source != "pictures":
            raise NotApplicable('the rig\'s camera is a model without pictures (camera.source = "model")')
        if not 0.3 <= distance <= 10.0:
            raise Unavailable(f"a stand at {distance:g} m: between 0.3 and 10 m")
        if distance not in self._kept:
            self._kept[distance] = self._pictures(distance)
        return self._kept[distance]

    def _pictures(self, distance: float) -> list[BoardMeasurement]:
        inclination = math.radians(self.set_deg)
        board_R = rotation_from_car(0.0, inclination)
        board = motion_row((0.0, 0.0, self._height), from_matrix(board_R))
        position, attitude = self._stand(distance, inclination)
        renderer = Renderer(self._true, self.board, self._drawn.image_seed, Sensor(gain=self._slot.gain))
        detector = BoardDetector(self.camera, self.board)
        mocap = Mocap(self._drawn.mocap_seed)
        still = (0.0, 0.0, 0.0)
        found = []
        for index in range(PICTURES):
            picture = renderer.render(motion_row(position, attitude), board, round(self._slot.exposure_ms * _MS), index)
            p, _, q, _ = mocap.measure(position, still, attitude, still)
            found.append(measure(detector, self.camera, picture, np.array(p), np.array(q)))
        return found

    def _stand(self, distance: float, inclination: float) -> tuple[Vec3, Quat]:
        """Vehicle position and attitude that centre the board in the true camera's view, from behind and above."""
        # Angle of the sight line from the heading, up and backward; off the normal to the side that stays level-headed
        angle = math.pi / 2 + inclination + (_OFF_NORMAL if inclination < math.pi / 4 else -_OFF_NORMAL)
        toward = (math.cos(angle), 0.0, math.sin(angle))
        down = math.pi - angle
        q = from_euler(0.0, down - self._true.tilt, 0.0)
        mount = rotate(q, *self._true.offset)
        base = (0.0, 0.0, self._height)
        x, y, z = (b + distance * t - m for b, t, m in zip(base, toward, mount, strict=True))
        return (x, y, z), q


def measure(
    detector: BoardDetector, camera: Camera, picture: np.ndarray, p: np.ndarray, q: np.ndarray
) -> BoardMeasurement:
    """The board in one picture (height, width), taken by `camera` of a vehicle at `p` (m) with attitude `q` (wxyz)."""
    pose = detector.detect(picture)
    brightness, contrast = float(picture.mean()), math.nan
    if not pose.found:
        return BoardMeasurement(pose, math.nan, math.nan, brightness, contrast)
    _, board_q = world_board_pose(p, q, camera.row(), pose.R, pose.p)
    up = body_z(board_q)[2]
    corners = pose.corners.reshape(-1, 2)
    (u0, v0), (u1, v1) = np.floor(corners.min(0)).astype(int), np.ceil(corners.max(0)).astype(int)
    part = picture[max(0, v0) : v1 + 1, max(0, u0) : u1 + 1]
    low, high = np.percentile(part, (2, 98))
    tilt = math.degrees(math.acos(min(1.0, max(-1.0, float(up)))))
    return BoardMeasurement(pose, float(np.linalg.norm(pose.p)), tilt, brightness, float(high - low))
