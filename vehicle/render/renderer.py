"""The simulated camera: a mono picture of the board on its car, sharp where the detector looks, cheap elsewhere.

Ground, sky and car are drawn at half the resolution and enlarged; the board's face is sampled at full
resolution over the exposure (global shutter), so that it blurs as vehicle and board move. Equal arguments give
equal bytes. A camera with a distorting lens is drawn as a pinhole camera that sees as much, and then bent.
"""

from __future__ import annotations

import cv2
import numpy as np

from groundcar.board.face import bitmap
from groundcar.board.layout import Board
from kernel.random import stream
from kernel.rotations import to_matrix
from vehicle.camera.distortion import drawn_camera, picture_maps
from vehicle.camera.pinhole import Camera
from vehicle.quadrotor import state_row
from vehicle.render.board import MAX_SAMPLES, draw_face, face_box, face_texture
from vehicle.render.ground import doubled, draw_ground, ground_pyramid
from vehicle.render.pose import MOTION_DIM, camera_at
from vehicle.render.scene import car_faces, draw_faces, lambert, slab_faces
from vehicle.render.sensor import Sensor, expose, noise_tile, vignette

_STEP = 2  # full-resolution pixels for one of the background
_SAMPLES_PER_FRAME = 900_000  # about two milliseconds
_MOST_SAMPLES_PER_FRAME = 4_600_000  # five for every pixel of a picture that shows nothing but the face
_WHITE, _BLACK = 225.0, 24.0  # DN of paper and ink in full light at gain 1
_REACH = 3  # px, of the point spread


class Renderer:
    """Pictures of one board through one camera. Not thread-safe (it keeps scratch pictures)."""

    def __init__(self, camera: Camera, board: Board, seed: int, sensor: Sensor | None = None) -> None:
        """Raises ValueError for a picture of an odd size, and for a lens that sees too wide to be drawn."""
        if camera.width % _STEP or camera.height % _STEP:
            raise ValueError(f"picture size {camera.width} x {camera.height} must be a multiple of {_STEP}")
        self.camera, self.board, self.seed, self.sensor = camera, board, seed, sensor or Sensor()
        self._drawn = drawn_camera(camera)
        self._maps = picture_maps(camera, self._drawn) if camera.lens.bends else None
        self._cam = self._drawn.row()
        self._ground = ground_pyramid(seed)
        self._tile = noise_tile(seed)
        shape = (self._drawn.height, self._drawn.width)
        self._light = np.empty(shape, np.uint8)
        self._background = np.empty((shape[0] // _STEP, shape[1] // _STEP), np.uint8)
        corner = max(camera.cx, camera.width - camera.cx) ** 2 + max(camera.cy, camera.height - camera.cy) ** 2
        self._column_loss = vignette(camera.width, camera.cx, corner, self.sensor.vignetting)
        self._row_loss = vignette(camera.height, camera.cy, corner, self.sensor.vignetting)
        self._textures: dict[int, np.ndarray] = {}

    def render(self, vehicle: np.ndarray, board: np.ndarray, exposure_ns: int, frame_index: int) -> np.ndarray:
        """The picture, (height, width) uint8, newly allocated.

        `vehicle`, `board`: motion rows (13,) (position, velocity, quaternion world from body, body rate; see
        `render_pose.motion_row`) at the middle of the exposure; `frame_index` seeds the noise. Raises ValueError if a
        row holds a number that is not finite or the exposure is negative.
        """
        vehicle, board = vehicle[:MOTION_DIM], board[:MOTION_DIM]
        if not (np.isfinite(vehicle).all() and np.isfinite(board).all()):
            raise ValueError("cannot render: a vehicle or board motion row holds a number that is not finite")
        if exposure_ns < 0:
            raise ValueError(f"exposure is {exposure_ns} ns; it cannot be negative")
        R, p = np.empty((3, 3)), np.empty(3)
        camera_at(vehicle, 0.0, self._cam, R, p)
        board_R = to_matrix(board[state_row.Q : state_row.W])
        self._draw_background(R, p, board[state_row.P : state_row.V], board_R)
        self._draw_board(R, p, vehicle, board, board_R, exposure_ns * 1e-9)
        light, sensor = self._light, self.sensor
        if self._maps is not None:
            light = cv2.remap(light, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        picture = np.empty_like(light)
        expose(
            light, self._tile, self._column_loss, self._row_loss, sensor.gain, sensor.electrons_per_dn,
            sensor.read_noise, stream(self.seed, frame_index), picture,
        )  # fmt: skip
        return picture

    def _draw_background(self, R: np.ndarray, p: np.ndarray, board_p: np.ndarray, board_R: np.ndarray) -> None:
        draw_ground(self._background, R, p, self._cam, _STEP, *self._ground)
        faces, greys = car_faces(board_p, board_R)
        draw_faces(self._background, faces, greys, R, p, self._cam, _STEP)
        doubled(self._background, self._light)

    def _draw_board(
        self, R: np.ndarray, p: np.ndarray, vehicle: np.ndarray, board: np.ndarray, board_R: np.ndarray, exposure: float
    ) -> None:
        camera, size = self._drawn, self.board.size
        faces, greys = slab_faces(board[state_row.P : state_row.V], board_R, size, self.board.thickness)
        draw_faces(self._light, faces, greys, R, p, self._cam, 1)
        box = np.empty(4, np.int64)
        blur, seen = face_box(vehicle, board, exposure, self._cam, size / 2, camera.width, camera.height, box)
        if not seen:
            return
        area = int((box[2] - box[0]) * (box[3] - box[1]))
        # Enough samples that neither texture nor motion shows as steps, within what a period has room for
        most = min(MAX_SAMPLES, _MOST_SAMPLES_PER_FRAME // area)
        count = int(np.clip(max(_SAMPLES_PER_FRAME // area, 1.5 * blur), 4, most))
        texture = self._texture(lambert(board_R[0, 2], board_R[1, 2], board_R[2, 2]))
        draw_face(self._light, vehicle, board, exposure, self._cam, size / 2, texture, box, count)
        if self.sensor.point_spread > 0.0:
            u0, v0 = max(0, box[0] - _REACH), max(0, box[1] - _REACH)
            part = self._light[v0 : box[3] + _REACH, u0 : box[2] + _REACH]
            cv2.GaussianBlur(part, (5, 5), self.sensor.point_spread, dst=part, borderType=cv2.BORDER_REPLICATE)

    def _texture(self, light: float) -> np.ndarray:
        """The face's texels under a share of full light, in steps of one DN of white."""
        white = round(_WHITE * light)
        if white not in self._textures:
            self._textures[white] = face_texture(bitmap(self.board), white * _BLACK / _WHITE, white)
        return self._textures[white]
