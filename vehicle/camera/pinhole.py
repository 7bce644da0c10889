"""The pinhole camera on the vehicle: intrinsics, mount, projection, and the visibility test of the model camera.

Optical frame: x right, y down, z forward. Pixels follow OpenCV: centres at integers, so a picture covers
[-0.5, width - 0.5]. The mount is an offset from the body origin (FLU) and a tilt below the body's x axis (paper App.
"Experimental Setup": about 15 deg down). The visibility test is that of the paper's Sec. "Visibility-Gated Observation
Model"; its limits were set by the AprilTag detector's results on rendered pictures (benchmarks/bench_camera.py).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from groundcar.board.layout import TAG_MODULES, Board
from groundcar.motion import board_row
from kernel.jit import njit
from kernel.rotations import rotate, rotate_back
from vehicle.camera import camera_row
from vehicle.camera.lens import Lens


@dataclass(frozen=True)
class Camera:
    """Intrinsics (px), mount (m, rad) and limits of visibility. Defaults: the paper's 82.96 x 52.90 deg camera.

    `lens`: the distortion, which only pictures have; projection and visibility test here are the pinhole's.
    """

    width: int = 1280
    height: int = 720
    fx: float = 723.9
    fy: float = 723.6
    cx: float = 639.5
    cy: float = 359.5
    offset: tuple[float, float, float] = (0.08, 0.0, 0.0)
    tilt: float = math.radians(15.0)
    margin_px: float = 4.0
    max_range: float = 8.0
    max_incidence: float = math.radians(82.0)
    min_module_px: float = 1.35
    lens: Lens = field(default_factory=Lens)

    def __post_init__(self) -> None:
        if self.width < 16 or self.height < 16:
            raise ValueError(f"camera picture is {self.width} x {self.height} px; it needs at least 16 x 16")
        numbers = (self.fx, self.fy, self.cx, self.cy, *self.offset, self.tilt, self.margin_px, self.max_range)
        if not all(math.isfinite(n) for n in (*numbers, self.max_incidence, self.min_module_px)):
            raise ValueError(f"camera has a number that is not finite: {self}")
        if min(self.fx, self.fy, self.max_range, self.min_module_px) <= 0.0:
            raise ValueError("camera fx, fy, max_range and min_module_px must be positive")
        if not 0.0 < self.max_incidence < math.pi / 2:
            raise ValueError(f"camera max_incidence is {self.max_incidence} rad; give one between 0 and pi/2")

    @property
    def matrix(self) -> np.ndarray:
        """Intrinsic matrix, shape (3, 3)."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def row(self, board: Board | None = None) -> np.ndarray:
        """The camera row for kernels (vehicle.camera.camera_row), with the tags of `board` (None: the project's own).

        Raises ValueError for a board of more than MOST_TAGS tags.
        """
        tags = (board or Board()).tags
        if len(tags) > camera_row.MOST_TAGS:
            raise ValueError(
                f"the board has {len(tags)} tags; the visibility test takes at most {camera_row.MOST_TAGS}"
            )
        limits = (self.margin_px, self.max_range, math.cos(self.max_incidence), self.min_module_px)
        intrinsics = (self.fx, self.fy, self.cx, self.cy, self.width, self.height)
        row = np.zeros(camera_row.DIM)
        row[: camera_row.TAGS] = (*intrinsics, *self.offset, self.tilt, *limits)
        row[camera_row.TAGS] = len(tags)
        numbers = [number for tag in tags for number in (tag.x, tag.y, tag.width / 2)]
        row[camera_row.FIRST_TAG : camera_row.FIRST_TAG + len(numbers)] = numbers
        return row


@njit
def optical_from_body(x, y, z, tilt):
    """A vector in body FLU expressed in the optical frame (3 floats)."""
    c, s = math.cos(tilt), math.sin(tilt)
    return -y, -s * x - c * z, c * x - s * z


@njit
def body_from_optical(x, y, z, tilt):
    """A vector in the optical frame expressed in body FLU (3 floats)."""
    c, s = math.cos(tilt), math.sin(tilt)
    return c * z - s * y, -x, -s * z - c * y


@njit
def world_from_optical(vehicle_q, x, y, z, cam):
    """A vector in the optical frame expressed in the world (3 floats). `vehicle_q` (4,): world from body."""
    bx, by, bz = body_from_optical(x, y, z, cam[camera_row.TILT])
    return rotate(vehicle_q, bx, by, bz)


@njit
def optical_from_world(vehicle_q, x, y, z, cam):
    """A world vector (a direction, no translation) expressed in the optical frame (3 floats)."""
    bx, by, bz = rotate_back(vehicle_q, x, y, z)
    return optical_from_body(bx, by, bz, cam[camera_row.TILT])


@njit
def camera_position(vehicle_p, vehicle_q, cam):
    """Position of the camera's centre in the world (3 floats, m)."""
    x, y, z = rotate(vehicle_q, cam[camera_row.OFFSET_X], cam[camera_row.OFFSET_Y], cam[camera_row.OFFSET_Z])
    return vehicle_p[0] + x, vehicle_p[1] + y, vehicle_p[2] + z


@njit
def optical_axis(vehicle_q, cam):
    """Viewing direction of the camera in the world (3 floats, unit): v_cam of the active perception reward."""
    return world_from_optical(vehicle_q, 0.0, 0.0, 1.0, cam)


@njit
def camera_frame(vehicle_p, vehicle_q, cam):
    """The camera in the world: R (3, 3) world from optical and p (3,) m, newly allocated."""
    R, p = np.empty((3, 3)), np.empty(3)
    p[0], p[1], p[2] = camera_position(vehicle_p, vehicle_q, cam)
    R[0, 0], R[1, 0], R[2, 0] = world_from_optical(vehicle_q, 1.0, 0.0, 0.0, cam)
    R[0, 1], R[1, 1], R[2, 1] = world_from_optical(vehicle_q, 0.0, 1.0, 0.0, cam)
    R[0, 2], R[1, 2], R[2, 2] = world_from_optical(vehicle_q, 0.0, 0.0, 1.0, cam)
    return R, p


@njit
def point_in_camera(vehicle_p, vehicle_q, point, cam):
    """A world point (3,) in the optical frame (3 floats, m)."""
    x, y, z = camera_position(vehicle_p, vehicle_q, cam)
    return optical_from_world(vehicle_q, point[0] - x, point[1] - y, point[2] - z, cam)


@njit
def project(x, y, z, cam):
    """Pixel (u, v) of a point in the optical frame; NaN behind the camera."""
    if z <= 1e-6:
        return math.nan, math.nan
    return cam[camera_row.FX] * x / z + cam[camera_row.CX], cam[camera_row.FY] * y / z + cam[camera_row.CY]


@njit
def _square_inside(c, ex, ey, half, cam):
    """True if all corners of a square on the board, its centre `c` in the optical frame, lie inside the picture's
    margin."""
    low, right, bottom = (
        cam[camera_row.MARGIN],
        cam[camera_row.WIDTH] - 1.0 - cam[camera_row.MARGIN],
        cam[camera_row.HEIGHT] - 1.0 - cam[camera_row.MARGIN],
    )
    for i in range(4):
        bx = half if i < 2 else -half
        by = half if i % 2 == 0 else -half
        px, py, pz = (c[0] + bx * ex[0] + by * ey[0], c[1] + bx * ex[1] + by * ey[1], c[2] + bx * ex[2] + by * ey[2])
        if pz < 0.02:
            return False
        u, v = cam[camera_row.FX] * px / pz + cam[camera_row.CX], cam[camera_row.FY] * py / pz + cam[camera_row.CY]
        if u < low or u > right or v < low or v > bottom:
            return False
    return True


@njit
def _visible(c, ex, ey, cam):
    """Visibility test for the board's centre `c` and axes `ex`, `ey`, all 3-tuples in the optical frame."""
    nx, ny, nz = ex[1] * ey[2] - ex[2] * ey[1], ex[2] * ey[0] - ex[0] * ey[2], ex[0] * ey[1] - ex[1] * ey[0]
    above = -(c[0] * nx + c[1] * ny + c[2] * nz)
    if not above > 0.0:
        return 0
    for i in range(int(cam[camera_row.TAGS])):
        at = camera_row.FIRST_TAG + camera_row.TAG_DIM * i
        x, y, half = cam[at + camera_row.TAG_X], cam[at + camera_row.TAG_Y], cam[at + camera_row.TAG_HALF]
        tag = (c[0] + x * ex[0] + y * ey[0], c[1] + x * ex[1] + y * ey[1], c[2] + x * ex[2] + y * ey[2])
        distance = math.sqrt(tag[0] * tag[0] + tag[1] * tag[1] + tag[2] * tag[2])
        if distance > cam[camera_row.MAX_RANGE] or above < cam[camera_row.MIN_COS_INCIDENCE] * distance:
            continue
        module = cam[camera_row.FX] * 2.0 * half / TAG_MODULES / distance * (above / distance)
        if module >= cam[camera_row.MIN_MODULE] and _square_inside(tag, ex, ey, half, cam):
            return 1
    return 0


@njit
def board_visibility(vehicle_p, vehicle_q, board_p, board_R, cam):
    """1 if the detector is expected to give a pose of the board, else 0 (NaN anywhere: 0).

    `vehicle_p` (3,) m and `vehicle_q` (4,) world from body; `board_p` (3,) m and `board_R` (3, 3) world from board;
    `cam` a camera row. Visible means: front face, and at least one tag lies wholly in the picture, within range and
    incidence, with modules large enough to decode. Occlusion and blur are not modelled.
    """
    c = point_in_camera(vehicle_p, vehicle_q, board_p, cam)
    ex = optical_from_world(vehicle_q, board_R[0, 0], board_R[1, 0], board_R[2, 0], cam)
    ey = optical_from_world(vehicle_q, board_R[0, 1], board_R[1, 1], board_R[2, 1], cam)
    return _visible(c, ex, ey, cam)


@njit
def board_row_visibility(vehicle_p, vehicle_q, board, cam):
    """`board_visibility` for a board row (groundcar.motion.board_row), as training uses it."""
    ch, sh = math.cos(board[board_row.HEADING]), math.sin(board[board_row.HEADING])
    ci, si = math.cos(board[board_row.INCLINATION]), math.sin(board[board_row.INCLINATION])
    c = point_in_camera(vehicle_p, vehicle_q, board, cam)
    ex = optical_from_world(vehicle_q, ch * ci, sh * ci, si, cam)
    ey = optical_from_world(vehicle_q, -sh, ch, 0.0, cam)
    return _visible(c, ex, ey, cam)
