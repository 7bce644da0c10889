"""The AprilTag detector: pictures in, the board's pose in the world out, with the vehicle's pose at exposure time."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from hil.contract.messages import Belief, Detection, Event, Image, VehicleState
from hil.contract.node import Inbox, Node, Out
from kernel.clip import usable
from kernel.rotations import from_euler, to_matrix
from kernel.stamps import later_than_now
from vehicle.apriltag.detector import BoardDetector, BoardPose, modelled_processing_ns, world_board_pose
from vehicle.camera.noise import ODOMETRY_SIGMA, POINTING_SIGMA
from vehicle.camera.pinhole import camera_frame
from vehicle.quadrotor.pose_history import PoseAt, PoseHistory

_FARTHEST_S = 2.0  # between a belief and an exposure: beyond it the prior is not extrapolated


class Detector(Node):
    """Processes the newest picture only: one that arrives while another is being processed is dropped and counted."""

    name = "detector"
    inputs = ("camera/image", "vehicle/odometry", "belief")
    outputs = ("board/detection", "event")
    wakes = ("camera/image",)

    def __init__(
        self, detector: BoardDetector, camera_row: np.ndarray, stopwatch: Callable[[], int] | None = None
    ) -> None:
        """`camera_row`: the calibrated camera, which need not be the true one. `stopwatch` (ns) measures what a
        detection costs where it costs real time; without one the cost is modelled, and delays the answer."""
        self._detector, self._cam, self._stopwatch = detector, camera_row, stopwatch
        self._history = PoseHistory()
        self._busy_until_ns = 0
        self._dropped = self._crowded = 0
        self._refused = {"odometry": 0, "picture": 0}

    @property
    def counters(self) -> dict[str, int]:
        return {
            "pictures dropped by a busy detector": self._dropped,
            "pictures refused by the detector, stamped later than now": self._refused["picture"],
            "odometry refused by the detector, stamped later than now": self._refused["odometry"],
            "pictures with more than one board": self._crowded,
        }

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        outs: list[Out] = []
        for odometry in inbox.new("vehicle/odometry"):
            outs += self._refuse_later(now_ns, "odometry", odometry.stamp_ns)
            self._remember(now_ns, odometry)
        for image in inbox.new("camera/image"):
            outs += self._refuse_later(now_ns, "picture", image.stamp_ns)
        images = [image for image in inbox.new("camera/image") if not later_than_now(image.stamp_ns, now_ns)]
        if not images:
            return outs
        if now_ns < self._busy_until_ns:
            self._dropped += len(images)
            return outs
        self._dropped += len(images) - 1
        return outs + self._look(now_ns, images[-1], inbox.latest("belief"))

    def _look(self, now_ns: int, image: Image, belief: Belief | None) -> list[Out]:
        vehicle = self._history.at(image.stamp_ns)
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        prior = up = None
        if vehicle is not None:
            camera_R, camera_p = camera_frame(vehicle.position, vehicle.orientation, self._cam)
            up = camera_R[2]
            prior = _expected(belief, image.stamp_ns, camera_R, camera_p)
        began = self._stopwatch() if self._stopwatch is not None else 0
        seen = self._detector.detect(pixels, prior, up)
        if self._stopwatch is not None:
            processing_ns, delay_ns = self._stopwatch() - began, 0
        else:
            processing_ns = delay_ns = modelled_processing_ns(seen)
            self._busy_until_ns = now_ns + processing_ns
        outs = [Out("board/detection", self._message(image, seen, vehicle, processing_ns), delay_ns)]
        if seen.boards > 1:
            self._crowded += 1
            if self._crowded == 1:
                how_many = "two" if seen.boards == 2 else str(seen.boards)
                text = f"{how_many} boards in one picture: the one nearest to the belief is used; cover the other"
                outs.append(Out("event", Event(now_ns, "warning", self.name, text)))
        return outs

    def _remember(self, now_ns: int, odometry: VehicleState) -> None:
        parts = (odometry.position, odometry.velocity, odometry.orientation, odometry.body_rate)
        self._history.add(odometry.stamp_ns, PoseAt(*(np.array(part) for part in parts)), now_ns)

    def _refuse_later(self, now_ns: int, what: str, stamp_ns: int) -> list[Out]:
        """Count what is stamped later than now; an event for the first of its kind."""
        if not later_than_now(stamp_ns, now_ns):
            return []
        self._refused[what] += 1
        if self._refused[what] > 1:
            return []
        text = (
            f"{what} refused: stamped {(stamp_ns - now_ns) * 1e-6:.1f} ms later than now; further ones are only counted"
        )
        return [Out("event", Event(now_ns, "warning", self.name, text))]

    def _message(self, image: Image, seen: BoardPose, vehicle: PoseAt | None, processing_ns: int) -> Detection:
        found, reason = seen.found, seen.reason
        position, orientation = (0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)
        distance = float(np.linalg.norm(seen.p)) if found else 0.0
        if found and vehicle is None:
            found, reason = False, "no odometry at exposure time"
        if found and vehicle is not None:
            p, q = world_board_pose(vehicle.position, vehicle.orientation, self._cam, seen.R, seen.p)
            position, orientation = tuple(p.tolist()), tuple(q.tolist())
        return Detection(
            stamp_ns=image.stamp_ns,
            found=found,
            position=position,
            orientation=orientation,
            position_sigma=math.hypot(seen.position_sigma, ODOMETRY_SIGMA, POINTING_SIGMA * distance) if found else 0.0,
            orientation_sigma=math.hypot(seen.orientation_sigma, POINTING_SIGMA) if found else 0.0,
            tag_ids=seen.ids,
            corners_px=tuple(seen.corners.ravel().tolist()),
            reason=reason,
            image_sequence=image.sequence,
            processing_ns=processing_ns,
        )


def _expected(
    belief: Belief | None, at_ns: int, camera_R: np.ndarray, camera_p: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """The predicted board in the optical frame at the exposure (R (3, 3), p (3,)), or None before there is a belief."""
    if belief is None or not belief.valid:
        return None
    if not usable((*belief.position, belief.heading, belief.speed, belief.turn_rate, belief.inclination)):
        return None
    seconds = (at_ns - belief.stamp_ns) * 1e-9
    if abs(seconds) > _FARTHEST_S:
        return None
    heading = belief.heading + seconds * belief.turn_rate
    along = np.array([np.cos(belief.heading), np.sin(belief.heading), 0.0])
    position = np.array(belief.position) + seconds * belief.speed * along
    board_R = to_matrix(from_euler(0.0, -belief.inclination, heading))
    return camera_R.T @ board_R, camera_R.T @ (position - camera_p)
