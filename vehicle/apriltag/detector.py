"""The board's pose from one picture: search regions, the tags of one board, choice between two ambiguous poses."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from groundcar.board.layout import TAG_MODULES, Board
from kernel.rotations import from_matrix
from vehicle.apriltag.boards import choose_board, split_boards
from vehicle.apriltag.library import Tag, TagDetector
from vehicle.apriltag.pose import PoseFit, fit_poses
from vehicle.apriltag.region import Region
from vehicle.apriltag.search import BoardSearch, SearchSettings
from vehicle.camera.distortion import distorted, undistorted
from vehicle.camera.pinhole import Camera, camera_frame

_NO_POSE = np.full(3, np.nan)


@dataclass(frozen=True)
class DetectorSettings:
    """Thresholds; the defaults were measured on rendered pictures (benchmarks/bench_camera.py)."""

    # Least contrast of an edge, DN: a share of the searched part's own contrast, and never more than this. High values
    # save time in clutter, a fixed one finds nothing in poor light
    min_white_black_diff: int = 30
    contrast_share: float = 0.2
    decode_sharpening: float = 0.25
    max_hamming: int = 1
    # A tag cut by the picture's edge can still decode, with corners on the edge give or take the decimation
    border_px: float = 2.0  # plus 1.5 px for each px of decimation
    corner_sigma: float = 0.08  # px, one-sigma of a corner of a large tag
    # px^3, added as this over the module's width squared: edges of small modules disturb each other
    small_module_sigma: float = 1.2
    max_normal_sigma: float = math.radians(5.0)
    max_rms: float = 1.5  # px, of several tags
    max_rms_single: float = 0.6  # px; four corners fit almost anything, so a lone tag must fit well
    ambiguity_rms: float = 1.0  # px, two poses whose rms differ by less are both possible: the prior decides
    prior_angle: float = 0.35  # rad; a prior farther from both than this is not used: the board was lost
    # Where neither prior nor horizon decides, the better pose is accepted if the other one's rms is clear_rms (px)
    # larger, or clear_ratio times as large; an rms below sharp_rms (px) counts as sharp_rms
    clear_rms: float = 0.2
    clear_ratio: float = 4.0
    sharp_rms: float = 0.03
    search: SearchSettings = field(default_factory=SearchSettings)


@dataclass(frozen=True)
class BoardPose:
    """Result of one picture. `R` (3, 3) and `p` (3,) m: board in the optical frame, NaN unless found.

    Sigmas are one-sigma predictions from the corners' geometry: `lateral_sigma` and `depth_sigma` (m, across and along
    the optical axis), `orientation_sigma` (rad, rms rotation angle). They do not include errors of calibration or
    odometry.
    """

    found: bool
    # Empty if found: no tag, border, no fit, residual, uncertain normal, ambiguous, not searched
    reason: str
    R: np.ndarray
    p: np.ndarray
    ids: tuple[int, ...]
    corners: np.ndarray  # (n, 4, 2) px of the picture, of the tags used
    rms: float  # px
    lateral_sigma: float
    depth_sigma: float
    orientation_sigma: float
    duplicates: int  # ids that were seen more than once
    region: tuple[int, int, int, int]  # last region searched: u0, v0, u1, v1
    work_px: float  # pixels looked at after decimation, all searches: the measure of processing time
    boards: int = 1  # in view, as far as tags of one id tell; the pose is that of the one that is meant

    @property
    def position_sigma(self) -> float:
        """Root mean square of the three axes' sigmas, m."""
        return math.sqrt((2.0 * self.lateral_sigma**2 + self.depth_sigma**2) / 3.0)


_NOT_SEARCHED = BoardPose(
    False, "not searched", np.full((3, 3), np.nan), _NO_POSE, (), np.zeros((0, 4, 2)), math.nan, math.nan, math.nan,
    math.nan, 0, (0, 0, 0, 0), 0.0,
)  # fmt: skip


class BoardDetector:
    """Finds one board in the pictures of one camera, as its lens takes them: the corners found are undistorted."""

    def __init__(self, camera: Camera, board: Board, settings: DetectorSettings | None = None) -> None:
        self.camera, self.board, self.settings = camera, board, settings or DetectorSettings()
        self._tags = TagDetector(self.settings.decode_sharpening)
        self._matrix = camera.matrix
        self.search = BoardSearch(camera, board, self.settings.search)
        self.outcomes: Counter[str] = Counter()  # pictures by reason ("found" if found), and rejected priors

    def detect(
        self, image: np.ndarray, prior: tuple[np.ndarray, np.ndarray] | None = None, up: np.ndarray | None = None
    ) -> BoardPose:
        """Look for the board in `image` ((height, width) uint8).

        `prior`: where it is expected, (R (3, 3), p (3,) m) in the optical frame: narrows the search and decides
        between ambiguous poses. `up`: the world's up in the optical frame (3,); the board's y axis is horizontal on a
        car, which decides between ambiguous poses when there is no prior. A prior that is not finite is counted and
        ignored. Raises ValueError for a picture of another size or type.
        """
        if image.shape != (self.camera.height, self.camera.width) or image.dtype != np.uint8:
            expected = f"({self.camera.height}, {self.camera.width}) uint8"
            raise ValueError(f"the detector needs pictures of {expected}, not {image.shape} {image.dtype}")
        if prior is not None and not (np.isfinite(prior[0]).all() and np.isfinite(prior[1]).all()):
            self.outcomes["bad prior"] += 1
            prior = None
        if up is not None and not np.isfinite(up).all():
            up = None
        result = self._search(image, prior, up)
        self.search.note(result.found)
        self.outcomes[result.reason or "found"] += 1
        return result

    def _search(self, image: np.ndarray, prior: tuple | None, up: np.ndarray | None) -> BoardPose:
        work, result = 0.0, _NOT_SEARCHED
        for region in self.search.regions(prior):
            part = image[region.v0 : region.v1, region.u0 : region.u1]
            work += region.work_px
            tags = self._tags.detect(part, region.decimate, self._least_contrast(part))
            result = self._pose(tags, region, work, prior, up)
            if result.found or result.ids:
                break
        return result

    def _least_contrast(self, part: np.ndarray) -> int:
        darker = np.bincount(part[::8, ::8].ravel(), minlength=256).cumsum()  # or as dark: pixels by grey value
        fiftieth = int(darker[-1]) // 50
        dark, bright = np.searchsorted(darker, (fiftieth, int(darker[-1]) - 1 - fiftieth), side="right").tolist()
        spread = bright - dark
        return int(np.clip(self.settings.contrast_share * spread, 5, self.settings.min_white_black_diff))

    def _pose(
        self, tags: list[Tag], region: Region, work: float, prior: tuple | None, up: np.ndarray | None
    ) -> BoardPose:
        s, known = self.settings, self.board.corners_by_id
        seen = [t for t in tags if t.id in known and t.hamming <= s.max_hamming]
        counts = Counter(t.id for t in seen)
        duplicates = sum(1 for n in counts.values() if n > 1)
        box = (region.u0, region.v0, region.u1, region.v1)
        corner = np.array([region.u0, region.v0], np.float64)
        used: list[tuple[int, np.ndarray]] = []
        for tag in seen:
            pixels = tag.corners + corner
            if self._inside(pixels, s.border_px + 1.5 * region.decimate):
                used.append((tag.id, undistorted(pixels, self.camera)))
        boards = [used]
        if duplicates and used:
            boards = split_boards(used, known, self._matrix, self._fit)
            used = choose_board(boards, self._fit, prior, up)

        def outcome(
            reason: str, fit: PoseFit | None = None, sigmas: tuple[float, float, float] = (math.nan, math.nan, math.nan)
        ) -> BoardPose:
            found = reason == ""
            R, p = (fit.R, fit.p) if found and fit else (np.full((3, 3), np.nan), _NO_POSE)
            corners = distorted(np.array([c for _, c in used]).reshape(-1, 4, 2), self.camera)
            return BoardPose(
                found, reason, R, p, tuple(i for i, _ in used), corners,
                fit.rms if fit else math.nan, *sigmas, duplicates, box, work, len(boards),
            )  # fmt: skip

        if not used:
            return outcome("border" if seen else "no tag")
        fits = self._fit(used, prior)
        if not fits:
            return outcome("no fit")
        if fits[0].rms > s.max_rms and len(used) > 1:
            # One tag's edges may have locked onto an edge beside it: drop the tag with the largest effect
            trials = [(self._fit(used[:i] + used[i + 1 :], prior), i) for i in range(len(used))]
            rest, spoiler = min(trials, key=lambda trial: trial[0][0].rms if trial[0] else math.inf)
            if rest:
                fits = rest
                del used[spoiler]
        largest = s.max_rms if len(used) > 1 else s.max_rms_single
        if fits[0].rms > largest:
            return outcome("residual", fits[0])
        fit, doubt = self._choose([fit for fit in fits if fit.rms <= largest], prior, up)
        lateral, depth, orientation, normal = self._sigmas(fit)
        if doubt:
            return outcome("ambiguous", fit, (lateral, depth, orientation))
        if not normal <= s.max_normal_sigma:
            return outcome("uncertain normal", fit, (lateral, depth, orientation))
        return outcome("", fit, (lateral, depth, orientation))

    def _fit(self, used: list[tuple[int, np.ndarray]], prior: tuple | None = None) -> list[PoseFit]:
        points = np.concatenate([self.board.corners_by_id[i] for i, _ in used])
        s, sigmas = self.settings, []
        for _, corners in used:
            module = float(np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).min()) / TAG_MODULES
            sigmas += [math.hypot(s.corner_sigma, s.small_module_sigma / max(module, 0.5) ** 2)] * 4
        return fit_poses(points, np.concatenate([c for _, c in used]), np.array(sigmas), self._matrix, prior)

    def _inside(self, pixels: np.ndarray, border: float) -> bool:
        high = np.array([self.camera.width, self.camera.height]) - 1.0
        return bool((pixels >= border).all() and (pixels <= high - border).all())

    def _choose(self, fits: list[PoseFit], prior: tuple | None, up: np.ndarray | None) -> tuple[PoseFit, bool]:
        """The best pose, and True if a different pose is about as likely."""
        best = fits[0]
        apart, far = math.cos(2.0 * self.settings.max_normal_sigma), best.rms + self.settings.ambiguity_rms
        others = [f for f in fits if f.rms < far and float(f.R[:, 2] @ best.R[:, 2]) < apart]
        if not others:
            return best, False
        rivals = [best, *others]
        if prior is not None:
            near = max(rivals, key=lambda fit: float(np.sum(fit.R * prior[0])))
            if float(np.sum(near.R * prior[0])) > 1.0 + 2.0 * math.cos(self.settings.prior_angle):
                return near, False
        if up is not None:
            level = sorted(rivals, key=lambda fit: abs(float(fit.R[:, 1] @ up)))
            if abs(float(level[1].R[:, 1] @ up)) - abs(float(level[0].R[:, 1] @ up)) > 0.05:
                return level[0], False
        # Straight behind the board the second pose is level too; without a detection it would stay ambiguous
        s, other = self.settings, min(fit.rms for fit in others)
        return best, other < min(best.rms + s.clear_rms, s.clear_ratio * max(best.rms, s.sharp_rms))

    @staticmethod
    def _sigmas(fit: PoseFit) -> tuple[float, float, float, float]:
        """Lateral (m), depth (m), orientation (rad, rms angle) and normal (rad, worst axis) sigmas of a fit."""
        c = fit.covariance
        trace, difference = c[0, 0] + c[1, 1], c[0, 0] - c[1, 1]
        normal = 0.5 * (trace + math.sqrt(difference * difference + 4.0 * c[0, 1] ** 2))
        lateral = math.sqrt(0.5 * (c[3, 3] + c[4, 4]))
        return lateral, math.sqrt(c[5, 5]), math.sqrt(c[0, 0] + c[1, 1] + c[2, 2]), math.sqrt(normal)


def world_board_pose(
    vehicle_p: np.ndarray, vehicle_q: np.ndarray, camera_row: np.ndarray, R: np.ndarray, p: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Board in the world (p (3,) m, q (4,) w x y z) from its pose in the camera and the vehicle's pose at exposure."""
    camera_R, camera_p = camera_frame(vehicle_p, vehicle_q, camera_row)
    return camera_R @ p + camera_p, np.array(from_matrix(camera_R @ R))


def modelled_processing_ns(result: BoardPose) -> int:
    """Processing time to assume in lockstep (ns), from the pixels that were looked at: reproducible, unlike a clock."""
    return int(1_000_000 + 50.0 * result.work_px + 100_000 * len(result.ids))
