"""Which parts of a picture are searched for the board, given where it is expected and how often it was missed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from groundcar.board.layout import Board
from vehicle.apriltag.region import Region, predicted_region
from vehicle.camera.pinhole import Camera


@dataclass(frozen=True)
class SearchSettings:
    """How long a prior without detections is used, and how often the whole picture is searched."""

    # After so many misses in a row the prior is ignored for one picture, not for longer: a search of the whole picture
    # takes 7 to 14 ms, and a board that is expected outside the picture is missed often
    misses_until_lost: int = 7
    doubt_px: float = 4.0  # growth of the search around the prior with every miss
    # After so many misses in a row without a prior only one picture in `seldom` is searched: searching all of them took
    # 59 % of a core while the board was out of sight
    seldom_after: int = 12
    seldom: int = 3


class BoardSearch:
    """Chooses the regions to search; counts misses to decide when the board is lost."""

    def __init__(self, camera: Camera, board: Board, settings: SearchSettings) -> None:
        self._camera, self._board, self._settings = camera, board, settings
        self._whole = Region(0, 0, camera.width, camera.height, 3.0)
        self.misses = self.searches = 0

    def note(self, found: bool) -> None:
        """Report whether the board was found in the last picture."""
        self.misses = 0 if found else self.misses + 1

    def regions(self, prior: tuple[np.ndarray, np.ndarray] | None) -> list[Region]:
        """Regions to search, in turn; empty where the board is expected outside the picture.

        `prior`: the expected pose (R (3, 3), p (3,) m) in the optical frame. The region around it grows
        with every miss, as long as that costs less than the whole picture; one picture in a few is searched without it.
        """
        s = self._settings
        believed = self.misses % (s.misses_until_lost + 1) < s.misses_until_lost
        if prior is not None and believed:
            regions = predicted_region(self._camera, self._board, *prior, s.doubt_px * self.misses)
            if self.misses < s.misses_until_lost or not regions:
                return regions
            if regions[0].work_px < self._whole.work_px:
                return regions[:1]
        if self.misses >= s.seldom_after and self.misses % s.seldom > 0 and (prior is None or believed):
            return []
        # Mostly the cheap search, one in four with finer decimation, which detects at longer range
        self.searches += 1
        return [replace(self._whole, decimate=2.0) if self.searches % 4 == 0 else self._whole]
