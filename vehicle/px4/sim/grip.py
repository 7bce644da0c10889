"""The magnet's hold: while it lasts, the vehicle keeps its pose in the frame of a moving board."""

from __future__ import annotations

import numpy as np

from kernel.rotations import (
    conjugate,
    from_rotation_vector,
    multiply,
    normalise,
    rotate,
    rotate_back,
    to_rotation_vector,
)
from vehicle.px4.sim.rows import situation
from vehicle.quadrotor import state_row

Vec3 = tuple[float, float, float]
Quat = tuple[float, float, float, float]


class Grip:
    """Moves a vehicle's row with a board; the kernel of the plant carries it on between two poses of the board."""

    def __init__(self, row: np.ndarray, body: np.ndarray) -> None:
        """`row`: state row of the vehicle; `body`: its situation row. Both are changed in place."""
        self._row, self._body = row, body
        self._hold: tuple[Vec3, Quat] | None = None
        self._board: tuple[Vec3, Quat, int] | None = None

    @property
    def holds(self) -> bool:
        return self._hold is not None

    def attach(
        self,
        now_ns: int,
        stamp_ns: int,
        board_position: Vec3,
        board_orientation: Quat,
        board_velocity: Vec3 = (0.0, 0.0, 0.0),
        board_turn_rate: float = 0.0,
    ) -> None:
        """From the first call on the vehicle keeps its pose in the board's frame; call again with every new pose.

        `now_ns`: time of the row; `stamp_ns`: when the pose (m, world; quaternion world from board) is true, on the
        same clock: a pose for the step to come would otherwise put the vehicle ahead by one step. Velocity (m/s,
        world) and turn rate (rad/s, about the vertical) are used at the first call only: later two poses give them.
        """
        row, board = self._row, normalise(board_orientation)
        if self._hold is None:
            offset = row[state_row.P : state_row.P + 3] - np.array(board_position)
            turn = multiply(conjugate(board), self._orientation())
            self._hold = (rotate_back(board, *offset.tolist()), normalise(turn))
            self._body[situation.ATTACHED] = 1.0
            spin = (0.0, 0.0, board_turn_rate)
            row[state_row.V : state_row.V + 3] = np.array(board_velocity) + np.cross(spin, offset)
            row[state_row.W : state_row.W + 3] = rotate_back(self._orientation(), *spin)
        offset, turn = self._hold
        row[state_row.P : state_row.P + 3] = np.array(board_position) + rotate(board, *offset)
        row[state_row.Q : state_row.Q + 4] = normalise(multiply(board, turn))
        if self._board is not None and stamp_ns > self._board[2]:
            old_position, old_orientation, then = self._board
            rate = 1e9 / (stamp_ns - then)
            spin = to_rotation_vector(multiply(board, conjugate(old_orientation)))
            spin = tuple(rate * s for s in spin)
            arm = rotate(board, *offset)
            velocity = (np.array(board_position) - old_position) * rate + np.cross(spin, arm)
            row[state_row.V : state_row.V + 3] = velocity
            row[state_row.W : state_row.W + 3] = rotate_back(self._orientation(), *spin)
        if self._board is None or stamp_ns > self._board[2]:
            self._board = (board_position, board, stamp_ns)
        early = (stamp_ns - now_ns) * 1e-9  # bring the pose back to the time of the row
        row[state_row.P : state_row.P + 3] -= early * row[state_row.V : state_row.V + 3]
        spin_back = (-early * row[state_row.W : state_row.W + 3]).tolist()
        row[state_row.Q : state_row.Q + 4] = normalise(multiply(self._orientation(), from_rotation_vector(*spin_back)))

    def detach(self) -> None:
        """The magnet lets go; the vehicle leaves with the board's velocity."""
        self._hold = self._board = None
        self._body[situation.ATTACHED] = 0.0

    def _orientation(self) -> Quat:
        w, x, y, z = self._row[state_row.Q : state_row.Q + 4].tolist()
        return w, x, y, z
