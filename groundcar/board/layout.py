"""The board that the vehicle perches on: its size and its tags, as data.

Board frame: origin at the centre of the face, x up-slope, y left, z the outward normal. One large tag is read from far
away; small ones, ten times smaller, are read from 0.1 m. Five are placed on cell corners of the large one, where they
cover none of its sample points. Five more are in a row along the board's upper edge, outside the large one's white
ring: a forward camera keeps them in its picture until a vehicle parallel to the board meets its centre.
All edges lie on a grid of one small module, so the bitmap is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

TAG_MODULES = 8  # width of a 36h11 tag between its outer corners; its white ring adds one module on each side


@dataclass(frozen=True)
class BoardTag:
    """One tag: library id, width between its detected corners (m), centre in the board frame (m)."""

    id: int
    width: float
    x: float
    y: float

    def corners(self) -> np.ndarray:
        """Corners in the board frame, shape (4, 3) m, in the detector's order: bottom left, bottom right, top right,
        top left as seen with x up."""
        h = self.width / 2
        return np.array([(self.x + sx * h, self.y + sy * h, 0.0) for sx, sy in ((-1, 1), (-1, -1), (1, -1), (1, 1))])


_SIZE = 0.42  # m
_MODULE = _SIZE / 110.0  # m: ten of them for the row of small tags, a hundred for the large tag with its ring


def _default_tags() -> tuple[BoardTag, ...]:
    large = BoardTag(0, 10 * TAG_MODULES * _MODULE, -5 * _MODULE, 0.0)
    nested = ((-5, 0), (15, 20), (15, -20), (-25, -20), (-25, 20))
    row = ((50, 0), (50, 20), (50, -20), (50, 40), (50, -40))
    small = (
        BoardTag(i, TAG_MODULES * _MODULE, x * _MODULE, y * _MODULE) for i, (x, y) in enumerate((*nested, *row), 1)
    )
    return (large, *small)


@dataclass(frozen=True)
class Board:
    """A square board (m) with tags; later tags are printed over earlier ones. Raises ValueError if tags do not fit."""

    size: float = _SIZE
    thickness: float = 0.01
    tags: tuple[BoardTag, ...] = field(default_factory=_default_tags)

    def __post_init__(self) -> None:
        if not self.tags:
            raise ValueError("a board needs at least one tag")
        ids = [tag.id for tag in self.tags]
        if len(set(ids)) != len(ids):
            raise ValueError(f"every tag on the board needs its own id, not {ids}")
        for tag in self.tags:
            reach = max(abs(tag.x), abs(tag.y)) + tag.width * (TAG_MODULES + 2) / TAG_MODULES / 2
            if tag.width <= 0 or reach > self.size / 2 + 1e-9:
                raise ValueError(f"tag {tag.id} with its white ring does not fit on a board of {self.size} m")
        self.modules  # noqa: B018  raises if the grid does not carry the tags

    @property
    def module(self) -> float:
        """Width of the smallest tag's module (m): the grid of `bitmap`."""
        return min(tag.width for tag in self.tags) / TAG_MODULES

    @cached_property
    def modules(self) -> int:
        """Modules along an edge of the board. Raises ValueError if an edge of a tag lies off the grid."""
        count = self.size / self.module
        edges = (
            [count] + [e for tag in self.tags for e in self.grid_box(tag)] + [t.width / self.module for t in self.tags]
        )
        if any(abs(e - round(e)) > 1e-6 for e in edges):
            raise ValueError(f"board and tags must lie on a grid of one small module ({self.module} m)")
        return round(count)

    def grid_box(self, tag: BoardTag) -> tuple[float, float]:
        """Grid row and column of the top left corner of the tag's white ring (row 0 is up-slope, column 0 left)."""
        ring = tag.width * (TAG_MODULES + 2) / TAG_MODULES / 2
        return (self.size / 2 - tag.x - ring) / self.module, (self.size / 2 - tag.y - ring) / self.module

    @cached_property
    def corners_by_id(self) -> dict[int, np.ndarray]:
        """Tag id to its corners in the board frame, (4, 3) m."""
        return {tag.id: tag.corners() for tag in self.tags}

    @cached_property
    def corners(self) -> np.ndarray:
        """Corners of all tags in the board frame, (tags, 4, 3) m."""
        return np.stack([tag.corners() for tag in self.tags])

    @cached_property
    def is_large(self) -> np.ndarray:
        """(tags,) bool: those of the greatest width."""
        widths = np.array([tag.width for tag in self.tags])
        return widths == widths.max()


def rotation_from_car(heading: float, inclination: float) -> np.ndarray:
    """R_world_board (3, 3) of a board on a car: Rz(heading) Ry(-inclination), rad; the normal faces backward and up."""
    ch, sh, ci, si = math.cos(heading), math.sin(heading), math.cos(inclination), math.sin(inclination)
    return np.array([[ch * ci, -sh, -ch * si], [sh * ci, ch, -sh * si], [si, 0.0, ci]])
