"""Two boards in one picture: the same tags twice. The pictures are two renders, one of them pasted into the other."""

import numpy as np
import pytest

from tests.unit.vehicle.apriltag.test_detector import RENDERER, detector
from tests.unit.vehicle.render.camera_scene import BOARD, CAMERA, board_in_camera, pixels, view

WIDTH, HEIGHT = CAMERA.width, CAMERA.height


def scene(near, far, left=-0.33, right=0.33):
    """A picture with a board at `near` m on the left and one at `far` m on the right, and the truth of both."""
    vehicle, first = view(near, aside=-left)
    other_vehicle, second = view(far, aside=-right)
    picture = RENDERER.render(vehicle, first, 0, 0)
    other = RENDERER.render(other_vehicle, second, 0, 1)
    truths = [board_in_camera(vehicle, first), board_in_camera(other_vehicle, second)]
    at_left = pixels(np.zeros((1, 3)), *truths[0][:2])[0, 0] < WIDTH / 2
    half = slice(WIDTH // 2, None) if at_left else slice(None, WIDTH // 2)
    picture[:, half] = other[:, half]
    return picture, [truth[:2] for truth in truths], truths[0][2]


def is_at(result, truth):
    return result.found and np.linalg.norm(result.p - truth[1]) < 0.03


@pytest.mark.parametrize("which", [0, 1])
@pytest.mark.parametrize(("near", "far"), [(1.0, 2.0), (1.5, 1.5), (2.5, 1.2)])
def test_with_a_prior_the_board_nearest_to_it_is_found(near, far, which):
    picture, truths, up = scene(near, far)
    R, p = truths[which]
    d = detector()
    for _ in range(9):  # whatever part is searched
        result = d.detect(picture, (R, p * 1.02), up)
        assert is_at(result, truths[which]), result.reason


@pytest.mark.parametrize("which", [0, 1])
def test_prior_decides_where_both_boards_are_searched(which):
    picture, truths, up = scene(1.2, 2.0)
    d = detector()
    d.search.misses = 7  # the next picture is searched whole
    result = d.detect(picture, truths[which], up)
    assert is_at(result, truths[which])
    assert (result.boards, result.duplicates > 0) == (2, True)


@pytest.mark.parametrize(("near", "far", "meant"), [(1.0, 2.5, 0), (2.5, 1.0, 1)])
def test_without_a_prior_the_board_with_more_and_larger_tags_is_found(near, far, meant):
    picture, truths, up = scene(near, far)
    for given in (up, None):
        result = detector().detect(picture, None, given)
        assert is_at(result, truths[meant]), result.reason
        assert result.boards == 2


def test_without_a_prior_a_print_that_does_not_lie_as_on_a_car_is_not_used():
    picture, truths, up = scene(1.6, 1.6)
    u, v = pixels(np.zeros((1, 3)), *truths[1])[0].astype(int)
    patch = picture[v - 170 : v + 170, u - 170 : u + 170]
    patch[:] = np.rot90(patch).copy()
    result = detector().detect(picture, None, up)
    assert is_at(result, truths[0]), result.reason
    assert result.boards == 2


def test_tags_of_one_board_are_one_board_at_all_distances():
    for distance in (0.15, 0.4, 1.0, 2.0, 4.0):
        vehicle, board = view(distance)
        _, _, up = board_in_camera(vehicle, board)
        result = detector().detect(RENDERER.render(vehicle, board, 0, 0), None, up)
        assert (result.found, result.boards, result.duplicates) == (True, 1, 0)


def test_all_tags_used_are_of_the_board_that_is_meant():
    picture, truths, up = scene(0.9, 0.9)
    for R, p in truths:
        d = detector()
        d.search.misses = 7
        result = d.detect(picture, (R, p), up)
        assert len(set(result.ids)) == len(result.ids)
        for tag_id, corners in zip(result.ids, result.corners, strict=True):
            assert np.abs(pixels(BOARD.corners_by_id[tag_id], R, p) - corners).max() < 3.0
