import math

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from groundcar.board.layout import Board, BoardTag
from vehicle.camera import camera_row
from vehicle.camera import pinhole as c

CAM = c.Camera()
ROW = CAM.row()
LARGE = BoardTag(0, 0.336, 0.0, 0.0)
LARGE_ROW = CAM.row(Board(tags=(LARGE,)))
LEVEL = np.array([1.0, 0.0, 0.0, 0.0])


def quaternion(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return np.array([math.cos(angle / 2), *(math.sin(angle / 2) * axis)])


def matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def board_R(heading, inclination):
    ch, sh, ci, si = math.cos(heading), math.sin(heading), math.cos(inclination), math.sin(inclination)
    return np.array([[ch * ci, -sh, -ch * si], [sh * ci, ch, -sh * si], [si, 0.0, ci]])


def facing(distance, incidence=0.0, tilt_row=ROW):
    """Board on the optical axis of a level camera at the origin, turned `incidence` about the optical x axis."""
    axis = np.array(c.optical_axis(LEVEL, tilt_row))
    p = np.array(c.camera_position(np.zeros(3), LEVEL, tilt_row)) + distance * axis
    inclination = math.pi / 2 - CAM.tilt + incidence  # the normal points back along the axis at 90 - tilt
    return p, board_R(0.0, inclination)


unit = st.floats(-1.0, 1.0)


@settings(max_examples=60)
@given(st.tuples(unit, unit, unit), st.floats(-3.0, 3.0), st.tuples(unit, unit, unit), st.tuples(unit, unit, unit))
def test_projection_equals_opencv(axis, angle, position, target):
    q = quaternion([axis[0], axis[1], axis[2] + 1.5], angle)
    vehicle_p, point = np.array(position), 4.0 * np.array(target)
    x, y, z = c.point_in_camera(vehicle_p, q, point, ROW)
    t = CAM.tilt
    body_from_optical = np.array([[0, -math.sin(t), math.cos(t)], [-1, 0, 0], [0, -math.cos(t), -math.sin(t)]])
    R = (matrix(q) @ body_from_optical).T
    expected = R @ (point - vehicle_p - matrix(q) @ np.array(CAM.offset))
    assert np.allclose([x, y, z], expected, atol=1e-12)
    if z > 0.05:
        pixel = cv2.projectPoints(point[None], cv2.Rodrigues(R)[0], expected - R @ point, CAM.matrix, np.zeros(5))[
            0
        ].ravel()
        assert np.allclose(c.project(x, y, z, ROW), pixel, atol=1e-6)


@settings(max_examples=30)
@given(st.tuples(unit, unit, unit), st.floats(-3.0, 3.0), st.tuples(unit, unit, unit))
def test_optical_and_world_directions_are_inverse(axis, angle, v):
    q = quaternion([axis[0], axis[1], axis[2] + 1.5], angle)
    assert np.allclose(c.world_from_optical(q, *c.optical_from_world(q, *v, ROW), ROW), v, atol=1e-12)


def test_axes_of_a_level_vehicle():
    assert np.allclose(c.optical_axis(LEVEL, ROW), [math.cos(CAM.tilt), 0.0, -math.sin(CAM.tilt)])
    assert np.allclose(c.world_from_optical(LEVEL, 1.0, 0.0, 0.0, ROW), [0.0, -1.0, 0.0])  # right is -y
    assert c.world_from_optical(LEVEL, 0.0, 1.0, 0.0, ROW)[2] < -0.9  # down


def test_behind_the_camera_projects_to_nan():
    assert all(math.isnan(v) for v in c.project(0.1, 0.1, -1.0, ROW))


def test_a_facing_board_is_visible_and_its_back_is_not():
    p, R = facing(2.0)
    assert c.board_visibility(np.zeros(3), LEVEL, p, R, ROW) == 1
    back = R @ np.diag([1.0, -1.0, -1.0])
    assert c.board_visibility(np.zeros(3), LEVEL, p, back, ROW) == 0


def test_incidence_and_range_limits_are_those_of_the_module_size():
    # fx * (0.336 / 8) * cos(incidence) / distance is the foreshortened module in pixels
    for incidence in (0.0, 60.0, 70.0):
        limit = CAM.fx * 0.042 * math.cos(math.radians(incidence)) / CAM.min_module_px
        for factor, expected in ((0.99, 1), (1.01, 0)):
            if limit * factor < CAM.max_range:
                p, R = facing(limit * factor, math.radians(incidence))
                assert c.board_visibility(np.zeros(3), LEVEL, p, R, LARGE_ROW) == expected
    p, R = facing(CAM.max_range * 1.001)
    assert c.board_visibility(np.zeros(3), LEVEL, p, R, LARGE_ROW) == 0
    p, R = facing(0.5, CAM.max_incidence + 0.01)
    assert c.board_visibility(np.zeros(3), LEVEL, p, R, LARGE_ROW) == 0


def test_near_the_board_only_the_small_tags_count():
    # At 0.2 m the large tag overfills the picture: 0.336 m are 1216 px
    p, R = facing(0.2)
    assert c.board_visibility(np.zeros(3), LEVEL, p, R, ROW) == 1
    assert c.board_visibility(np.zeros(3), LEVEL, p, R, LARGE_ROW) == 0


def test_board_is_invisible_beyond_the_picture_edge():
    # Facing at 3 m: the large tag is 81 px wide; slide the vehicle sideways until a corner reaches the margin.
    p, R = facing(3.0)
    half_px = CAM.fx * 0.168 / 3.0
    slide = (CAM.cx - CAM.margin_px - half_px) / CAM.fx * 3.0
    for factor, expected in ((0.995, 1), (1.005, 0)):
        for side in (-1.0, 1.0):
            assert c.board_visibility(np.array([0.0, side * slide * factor, 0.0]), LEVEL, p, R, LARGE_ROW) == expected


def test_a_tag_ahead_counts_though_the_board_s_centre_is_behind_the_camera():
    board = np.array([0.0, 0.0, 1.5, 0.0, 3.0, 0.0, 0.0, 0.0])
    level_on_it = np.array([0.0, 0.0, 1.55])
    assert c.point_in_camera(level_on_it, LEVEL, board[:3], ROW)[2] < 0.0
    assert c.board_row_visibility(level_on_it, LEVEL, board, ROW) == 1


def test_a_board_of_too_many_tags_is_refused():
    tags = [BoardTag(i, 0.0336, 0.0, 0.0) for i in range(camera_row.MOST_TAGS + 1)]
    with pytest.raises(ValueError, match="17 tags"):
        CAM.row(Board(tags=tuple(tags)))


@settings(max_examples=60)
@given(st.floats(-3.0, 3.0), st.floats(0.0, 1.4), st.floats(-0.8, 0.8), st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))
def test_board_row_and_matrix_agree(heading, inclination, roll, x, y):
    board = np.array([1.0, 0.5, 1.5, heading, 1.0, 0.1, inclination, 0.0])
    vehicle_p, q = np.array([x, y, 2.5]), quaternion([1.0, 0.3, 2.0], roll)
    R = board_R(heading, inclination)
    assert c.board_row_visibility(vehicle_p, q, board, ROW) == c.board_visibility(vehicle_p, q, board[:3], R, ROW)


def test_nan_is_not_visible():
    p, R = facing(2.0)
    for bad in (0, 1, 2):
        broken = p.copy()
        broken[bad] = math.nan
        assert c.board_visibility(np.zeros(3), LEVEL, broken, R, ROW) == 0
    assert c.board_visibility(np.zeros(3), LEVEL * math.nan, p, R, ROW) == 0
    assert c.board_visibility(np.zeros(3), LEVEL, p, R * math.nan, ROW) == 0


@pytest.mark.parametrize(
    "change", [{"width": 4}, {"fx": 0.0}, {"tilt": math.nan}, {"max_incidence": 2.0}, {"max_range": -1.0}]
)
def test_invalid_cameras_are_refused(change):
    with pytest.raises(ValueError, match="camera"):
        c.Camera(**change)
