"""A run under way as Rerun sees it, message by message. Times are seconds of the run's clock. Needs the Rerun SDK."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from hil.contract import messages as m
from hil.recording.foxglove import belief_orientation, optical_from_tilt
from hil.report.drawing.charts import BOARD, SEEN, VEHICLE
from hil.report.recorded.geometry import nose_up_deg
from hil.viewer import scene
from hil.viewer.scene import BELIEF_AT, BOARD_AT, BODY, CAMERA, EVENTS, PLOTS, WORLD, rgb
from vehicle.camera.pinhole import Camera

TIMELINE = "run"
_ASKED, _SENT, _BELIEF = "#1f5fa8", "#c4262e", "#7b3fa0"
_BEST = {"truth": 3, "mocap": 2, "vehicle": 1}  # of several sources of one pose, by the topic's head
_PICTURES_KEPT = 32

# tab -> (key, title, ((name, colour), ...))
_SERIES: dict[str, tuple[tuple[str, str, tuple[tuple[str, str], ...]], ...]] = {
    "perching": (
        ("rho", "reliability rho (1)", (("rho", _BELIEF),)),
        ("tags", "tags in the picture (1)", (("tags", SEEN),)),
        ("speed", "speed (m/s)", (("vehicle", VEHICLE), ("board", BOARD), ("believed board", _BELIEF))),
        ("pitch", "pitch (deg)", (("vehicle", VEHICLE), ("board", BOARD))),
    ),
    "commands": (
        ("rate-0", "roll rate (rad/s)", (("asked", _ASKED), ("sent", _SENT))),
        ("rate-1", "pitch rate (rad/s)", (("asked", _ASKED), ("sent", _SENT))),
        ("rate-2", "yaw rate (rad/s)", (("asked", _ASKED), ("sent", _SENT))),
        ("thrust", "thrust (m/s²)", (("asked", _ASKED), ("sent", _SENT))),
    ),
}


def blueprint() -> rrb.Blueprint:
    """The lay-out for a run under way."""
    tabs = {name: [(key, title) for key, title, _ in plots] for name, plots in _SERIES.items()}
    return scene.layout(TIMELINE, tabs)


class ViewStream:
    """Logs messages as they come; a topic it does not show is ignored."""

    def __init__(self, stream: rr.RecordingStream, board_size: float, tolerance: float, camera: Camera) -> None:
        """`tolerance`: radius of the circle on the board, m."""
        self._stream, self._size = stream, board_size
        self._rank: dict[str, int] = {}
        self._scale = 0.0
        self._width = camera.width
        self._believed = False
        self._stage = ""
        self._pictures: dict[int, None] = {}  # stamps of those shown, oldest first
        self._take: dict[str, Callable[[Any], None]] = {
            "truth/vehicle": self._vehicle, "mocap/vehicle": self._vehicle, "vehicle/odometry": self._vehicle,
            "truth/board": self._board, "mocap/board": self._board, "belief": self._belief,
            "board/detection": self._detection, "camera/image": self._image, "policy/action": self._action,
            "vehicle/sent": self._sent, "run/stage": self._run_stage, "event": self._event,
        }  # fmt: skip
        scene.draw_world(stream)
        scene.draw_arms(stream)
        scene.draw_board(stream, board_size, tolerance)
        mount = optical_from_tilt(camera.tilt)
        scene.draw_lens(stream, camera.offset, mount, camera.matrix, (camera.width, camera.height))
        self._lens = (camera, mount)
        stream.log(f"{WORLD}/detection", rr.Points3D.from_fields(colors=rgb(SEEN), radii=0.02), static=True)
        for plots in _SERIES.values():
            for key, _, lines in plots:
                for i, (name, colour) in enumerate(lines):
                    stream.log(f"{PLOTS}/{key}/{i}", rr.SeriesLines(colors=rgb(colour), names=name), static=True)

    def add(self, topic: str, message: Any) -> None:
        """Show `message` of `topic`."""
        take = self._take.get(topic)
        if take is None or not self._is_best(topic):
            return
        self._stream.set_time(TIMELINE, duration=message.stamp_ns / 1e9)
        take(message)

    def _is_best(self, topic: str) -> bool:
        """False for a pose that a better source tells too."""
        head, _, body = topic.partition("/")
        body = "vehicle" if topic == "vehicle/odometry" else body
        if body not in ("vehicle", "board"):
            return True
        rank = _BEST[head]
        self._rank[body] = max(rank, self._rank.get(body, 0))
        return rank == self._rank[body]

    def _vehicle(self, state: m.VehicleState) -> None:
        self._pose(BODY, state.position, state.orientation)
        self._scalar("speed", 0, math.hypot(*state.velocity))
        self._scalar("pitch", 0, _pitch_deg(state.orientation))

    def _board(self, state: m.BoardState) -> None:
        self._pose(BOARD_AT, state.position, state.orientation)
        self._scalar("speed", 1, abs(state.speed))
        self._scalar("pitch", 1, _pitch_deg(state.orientation))

    def _belief(self, belief: m.Belief) -> None:
        self._scalar("rho", 0, belief.rho)
        if not belief.valid:
            return
        self._pose(BELIEF_AT, belief.position, belief_orientation(belief.heading, belief.inclination))
        self._scalar("speed", 2, abs(belief.speed))
        if not self._believed:
            self._believed = True
            scene.draw_believed(self._stream, self._size)

    def _detection(self, seen: m.Detection) -> None:
        self._scalar("tags", 0, len(seen.tag_ids))
        if seen.found:
            self._stream.log(f"{WORLD}/detection", rr.Points3D.from_fields(positions=[seen.position]))
        if seen.stamp_ns in self._pictures:  # on an older picture they would seem wrong
            scene.draw_corners(self._stream, seen.tag_ids, seen.corners_px, self._scale)

    def _image(self, image: m.Image) -> None:
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        ok, jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 75])
        if not ok:
            return
        scale = image.width / self._width
        if scale != self._scale:
            self._scale = scale
            camera, mount = self._lens
            matrix = camera.matrix.copy()
            matrix[:2] *= scale
            scene.draw_lens(self._stream, camera.offset, mount, matrix, (image.width, image.height))
        self._stream.log(CAMERA, rr.EncodedImage(contents=jpeg.tobytes(), media_type="image/jpeg"))
        self._pictures[image.stamp_ns] = None
        if len(self._pictures) > _PICTURES_KEPT:
            del self._pictures[next(iter(self._pictures))]

    def _action(self, action: m.Action) -> None:
        if action.engaged:
            self._command(0, action.body_rate, action.thrust)

    def _sent(self, sent: m.Sent) -> None:
        self._command(1, sent.body_rate, sent.thrust)
        if sent.tripped:
            self._say(f"gate tripped: {sent.tripped}", "ERROR")

    def _command(self, line: int, rates: Sequence[float], thrust: float) -> None:
        for axis, rate in enumerate(rates):
            self._scalar(f"rate-{axis}", line, rate)
        self._scalar("thrust", line, thrust)

    def _run_stage(self, stage: m.Stage) -> None:
        if stage.name != self._stage:
            self._stage = stage.name
            self._say(f"stage: {stage.name}", "INFO")

    def _event(self, event: m.Event) -> None:
        self._say(f"{event.source}: {event.text}", scene.LEVELS.get(event.severity, "INFO"))

    def _say(self, text: str, level: str) -> None:
        self._stream.log(EVENTS, rr.TextLog(text, level=level))

    def _pose(self, path: str, position: Sequence[float], orientation: m.Quat) -> None:
        w, x, y, z = orientation
        turned = rr.Quaternion(xyzw=[x, y, z, w])
        self._stream.log(path, rr.Transform3D(translation=position, quaternion=turned))

    def _scalar(self, key: str, line: int, value: float) -> None:
        self._stream.log(f"{PLOTS}/{key}/{line}", rr.Scalars(value))


def _pitch_deg(orientation: m.Quat) -> float:
    return float(nose_up_deg(np.array([orientation]))[0])
