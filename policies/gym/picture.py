"""What the vehicle's camera sees in a training episode, as a picture for people."""

from __future__ import annotations

import numpy as np

from groundcar.board.layout import Board
from groundcar.motion import board_row
from groundcar.motion.pose import board_quaternion, board_velocity
from kernel.rotations import rotate_back
from vehicle.camera.pinhole import Camera
from vehicle.render.pose import MOTION_DIM, motion_row
from vehicle.render.renderer import Renderer

_EXPOSURE_NS = 2_000_000


class CameraView:
    """Pictures through the airframe's camera as it is mounted by its file: the draw of its tilt is not shown."""

    def __init__(self, camera: Camera) -> None:
        self._renderer = Renderer(camera, Board(), seed=0)

    def picture(self, vehicle: np.ndarray, board: np.ndarray, frame: int) -> np.ndarray:
        """RGB, (height, width, 3) uint8. `vehicle`: a state row; `board`: a board row (8,); `frame` seeds the noise."""
        q = board_quaternion(board)
        rate = rotate_back(np.array(q), 0.0, 0.0, board[board_row.TURN_RATE])
        seen = motion_row(board[board_row.X : board_row.Z + 1], q, board_velocity(board), rate)
        grey = self._renderer.render(vehicle[:MOTION_DIM], seen, _EXPOSURE_NS, frame)
        return np.repeat(grey[:, :, None], 3, axis=2)
