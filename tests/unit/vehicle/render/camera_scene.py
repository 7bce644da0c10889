"""Views of the board for the camera room's tests."""

import math

import numpy as np

from groundcar.board.layout import Board, rotation_from_car
from kernel.rotations import from_euler, from_matrix, to_matrix
from vehicle.camera.pinhole import Camera, camera_frame
from vehicle.render.pose import motion_row

CAMERA, BOARD = Camera(), Board()
ROW = CAMERA.row()


def view(distance, incidence_deg=30.0, velocity=(0.0, 0.0, 0.0), rate=(0.0, 0.0, 0.0), roll=0.0, aside=0.0):
    """Motion rows (vehicle, board): the board straight ahead of the vehicle (turned `aside` rad off it), normal in the
    vertical plane of sight, the line of sight 20 deg below the horizon."""
    depression = math.radians(20.0)
    inclination = math.pi / 2 - depression - math.radians(incidence_deg)
    line = np.array([math.cos(depression), 0.0, -math.sin(depression)])
    q = from_euler(roll, depression - CAMERA.tilt, aside)
    board_p = np.array([1.0, 2.0, 1.5])
    offset = camera_frame(np.zeros(3), np.array(q), ROW)[1]
    vehicle = motion_row(board_p - distance * line - offset, q, velocity, rate)
    return vehicle, motion_row(board_p, from_matrix(rotation_from_car(0.0, inclination)))


def board_in_camera(vehicle, board):
    """Truth: (R, p) of the board in the optical frame, and the world's up there."""
    R, p = camera_frame(vehicle[:3], vehicle[6:10], ROW)
    return R.T @ to_matrix(board[6:10]), R.T @ (board[:3] - p), R[2].copy()


def pixels(points, R, p):
    """Projection of board points (n, 3), (n, 2) px."""
    q = points @ R.T + p
    return q[:, :2] / q[:, 2:] * (CAMERA.fx, CAMERA.fy) + (CAMERA.cx, CAMERA.cy)
