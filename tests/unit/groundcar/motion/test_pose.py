import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.motion.pose import board_normal, board_position, board_quaternion, board_velocity


def row(heading, inclination, speed=0.0):
    return np.array([1.0, 2.0, 1.5, heading, speed, 0.0, inclination, 0.0])


@settings(max_examples=100)
@given(heading=st.floats(-4, 4), inclination=st.floats(0, 1.5))
def test_rotation_is_heading_then_tilt_and_all_forms_agree(heading, inclination):
    board = row(heading, inclination)
    c, s, ci, si = math.cos(heading), math.sin(heading), math.cos(-inclination), math.sin(-inclination)
    expected = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ np.array([[ci, 0, si], [0, 1, 0], [-si, 0, ci]])
    assert np.array(board_normal(board)) == pytest.approx(expected[:, 2])
    w, x, y, z = board_quaternion(board)
    assert np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    ) == pytest.approx(expected, abs=1e-12)


def test_the_normal_faces_backward_and_up():
    nx, ny, nz = board_normal(row(0.0, math.radians(70)))
    assert (nx, ny) == pytest.approx((-math.sin(math.radians(70)), 0.0))
    assert nz > 0


def test_the_board_moves_along_the_heading():
    board = row(math.pi / 2, 0.5, speed=-2.0)
    assert board_position(board) == (1.0, 2.0, 1.5)
    assert board_velocity(board) == pytest.approx((0.0, -2.0, 0.0), abs=1e-12)
