"""Which tags of a picture are of one board, where a second one is in view: a spare print, the board of the next car.

All tags of one board agree on one pose. From each large tag, the others of its board are predicted; a tag that is seen
twice is the one nearest to where it is predicted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from vehicle.apriltag.pose import PoseFit

Seen = tuple[int, np.ndarray]  # id, corners (4, 2) px

# Distance of a tag from where another one predicts it, at most: px, and the share of the distance between both, which
# a small tag's own pose is uncertain by. Boards are whole widths apart.
_NEAR_PX, _NEAR_SHARE = 4.0, 0.15
_LEVEL = 0.15  # sine of the angle between the board's y axis and the horizontal, at most


def split_boards(
    tags: list[Seen], corners_by_id: Mapping[int, np.ndarray], matrix: np.ndarray, fit: Callable[..., list[PoseFit]]
) -> list[list[Seen]]:
    """The tags of each board in view, those of a board in the order of `tags`.

    `corners_by_id`: (4, 3) m in the board frame; `matrix` (3, 3) the intrinsics; `fit`: poses of one list of tags.
    """
    order = sorted(_without_doubles(tags), key=lambda tag: -_side(tag[1]))
    left = list(range(len(order)))
    boards: list[list[Seen]] = []
    while left:
        seed = left[0]
        best = [seed]
        for pose in fit([order[seed]]):
            group = [seed, *_agreeing(order, left, seed, corners_by_id, matrix, pose)]
            best = group if len(group) > len(best) else best
        boards.append([order[k] for k in sorted(best)])
        left = [k for k in left if k not in best]
    return boards


def choose_board(
    boards: list[list[Seen]],
    fit: Callable[..., list[PoseFit]],
    prior: tuple[np.ndarray, np.ndarray] | None,
    up: np.ndarray | None,
) -> list[Seen]:
    """The tags of the board that is meant: nearest to `prior` (R (3, 3), p (3,) m in the optical frame).

    Without a prior it is one whose y axis is level, as on a car (`up`: the world's up in the optical frame, (3,)); of
    several the one with the most tags, then the largest in the picture.
    """
    fitted = [(board, poses) for board in boards if (poses := fit(board))]
    if not fitted:
        return max(boards, key=len)
    if prior is not None:
        return min(fitted, key=lambda one: min(float(np.linalg.norm(pose.p - prior[1])) for pose in one[1]))[0]

    def merit(one: tuple[list[Seen], list[PoseFit]]) -> tuple[bool, int, float]:
        board, poses = one
        level = up is None or min(abs(float(pose.R[:, 1] @ up)) for pose in poses) < _LEVEL
        return level, len(board), max(_side(corners) for _, corners in board)

    return max(fitted, key=merit)[0]


def _agreeing(
    tags: list[Seen],
    left: list[int],
    seed: int,
    corners_by_id: Mapping[int, np.ndarray],
    matrix: np.ndarray,
    pose: PoseFit,
) -> list[int]:
    """Of the tags `left` those where `pose`, of the tag `seed`, predicts them: one of each id, the nearest."""
    nearest: dict[int, tuple[float, int]] = {}
    middle = tags[seed][1].mean(axis=0)
    for k in left:
        tag_id, corners = tags[k]
        if tag_id == tags[seed][0]:
            continue
        points = (corners_by_id[tag_id] @ pose.R.T + pose.p) @ matrix.T
        if points[:, 2].min() <= 0.0:
            continue
        off = float(np.linalg.norm(points[:, :2] / points[:, 2:] - corners, axis=1).max())
        limit = _NEAR_PX + _NEAR_SHARE * float(np.linalg.norm(corners.mean(axis=0) - middle))
        if off < min(limit, nearest.get(tag_id, (limit, k))[0]):
            nearest[tag_id] = off, k
    return [k for _, k in nearest.values()]


def _without_doubles(tags: list[Seen]) -> list[Seen]:
    """The tags, of two of one id at one place only the first: the library may read one tag twice."""
    kept: list[Seen] = []
    for tag_id, corners in tags:
        middle, reach = corners.mean(axis=0), 0.5 * _side(corners)
        if not any(i == tag_id and np.linalg.norm(c.mean(axis=0) - middle) < reach for i, c in kept):
            kept.append((tag_id, corners))
    return kept


def _side(corners: np.ndarray) -> float:
    """The longest side of a tag in the picture, px."""
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).max())
