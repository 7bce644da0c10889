"""Maps messages to Rerun's entities, for a run in progress and for a finished one. Needs the Rerun SDK.

World ENU; `world/vehicle/camera` is the pinhole with the pictures.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
import rerun as rr

from hil.contract import messages as m
from hil.recording.foxglove import belief_orientation, optical_from_tilt
from hil.report.drawing.charts import ASKED, BAD, BELIEF, BOARD, MUTED, SEEN, VEHICLE
from hil.report.recorded.geometry import nose_up_deg
from hil.viewer import scene
from hil.viewer.scene import BELIEF_AT, BOARD_AT, BODY, CAMERA, EVENTS, PLOTS, WORLD, rgb
from vehicle.camera.pinhole import Camera

_BEST = {"truth": 3, "mocap": 2, "vehicle": 1}  # of several sources of one pose, by the first part of the topic
_PICTURES_KEPT = 32
_LIMITED = 3  # line of a command's plot: what the gate limited


class Line(NamedTuple):
    """One line of a plot; `dots` draws single samples."""

    name: str
    colour: str
    dots: bool = False


class Plot(NamedTuple):
    """One plot of a tab: entities `plots/<key>/<index of the line>`."""

    key: str
    title: str
    lines: tuple[Line, ...]


_COMMAND = (
    Line("asked", ASKED), Line("sent", VEHICLE), Line("achieved", BOARD), Line("limited by the gate", BAD, dots=True),
)  # fmt: skip

TABS: dict[str, tuple[Plot, ...]] = {
    "perching": (
        Plot("rho", "reliability rho (1), age of the newest picture (s)", (Line("rho", BELIEF), Line("age", MUTED))),
        Plot(
            "tags", "tags in a picture (1)", (Line("board found", SEEN, dots=True), Line("not found", BAD, dots=True))
        ),
        Plot("speed", "speed (m/s)", (Line("vehicle", VEHICLE), Line("board", BOARD), Line("board, believed", BELIEF))),
        Plot("pitch", "pitch (deg)", (Line("vehicle", VEHICLE), Line("board", BOARD))),
    ),
    "commands": (
        Plot("rate-0", "roll rate (rad/s)", _COMMAND),
        Plot("rate-1", "pitch rate (rad/s)", _COMMAND),
        Plot("rate-2", "yaw rate (rad/s)", _COMMAND),
        Plot("thrust", "collective thrust (m/s²)", _COMMAND),
    ),
}


class ViewStream:
    """Logs messages on arrival; a topic that it does not show is ignored."""

    def __init__(
        self,
        stream: rr.RecordingStream,
        board_size: float,
        tolerance: float,
        camera: Camera,
        *,
        timeline: str = scene.RUN,
        origin_ns: int = 0,
    ) -> None:
        """`board_size` and `tolerance` (radius of the circle on the board) in m; `origin_ns` is the timeline's zero."""
        self._stream, self._size, self._tolerance, self._camera = stream, board_size, tolerance, camera
        self._timeline, self._origin_ns = timeline, origin_ns
        self._mount = optical_from_tilt(camera.tilt)
        self._rank: dict[str, int] = {}
        self._drawn: set[str] = set()  # frames whose shapes are drawn
        self._scale = 1.0
        self._stage = self._tripped = ""
        self._decided = False
        self._pictures: dict[int, None] = {}  # stamps of those shown, oldest first
        self._take: dict[str, Callable[[Any], None]] = {
            "truth/vehicle": self._vehicle, "mocap/vehicle": self._vehicle, "vehicle/odometry": self._vehicle,
            "truth/board": self._board, "mocap/board": self._board, "belief": self._belief,
            "board/detection": self._detection, "camera/image": self._image, "policy/action": self._action,
            "vehicle/sent": self._sent, "referee/contact": self._contact, "run/stage": self._run_stage,
            "event": self._event,
        }  # fmt: skip
        scene.draw_world(stream)
        self._draw_lens(camera.width, camera.height)
        stream.log(f"{WORLD}/detection", rr.Points3D.from_fields(colors=rgb(SEEN), radii=0.02), static=True)
        for plot in (plot for plots in TABS.values() for plot in plots):
            for i, line in enumerate(plot.lines):
                style = rr.SeriesPoints if line.dots else rr.SeriesLines
                stream.log(f"{PLOTS}/{plot.key}/{i}", style(colors=rgb(line.colour), names=line.name), static=True)

    def add(self, topic: str, message: Any) -> None:
        """Show `message` of `topic`."""
        take = self._take.get(topic)
        if take is None or not self._is_best(topic):
            return
        self._at(message.stamp_ns)
        take(message)

    def add_picture(self, stamp_ns: int, jpeg: bytes, width: int, height: int) -> None:
        """Show a picture that is compressed already; `width` and `height` in px, reduced or not."""
        self._at(stamp_ns)
        scale = width / self._camera.width
        if scale != self._scale:
            self._scale = scale
            self._draw_lens(width, height)
        self._stream.log(CAMERA, rr.EncodedImage(contents=jpeg, media_type="image/jpeg"))
        self._pictures[stamp_ns] = None
        if len(self._pictures) > _PICTURES_KEPT:
            del self._pictures[next(iter(self._pictures))]

    def _at(self, stamp_ns: int) -> None:
        self._stream.set_time(self._timeline, duration=(stamp_ns - self._origin_ns) / 1e9)

    def _is_best(self, topic: str) -> bool:
        """False for a pose that a better source gives too."""
        head, _, body = topic.partition("/")
        body = "vehicle" if topic == "vehicle/odometry" else body
        if body not in ("vehicle", "board"):
            return True
        rank = _BEST[head]
        self._rank[body] = max(rank, self._rank.get(body, 0))
        return rank == self._rank[body]

    def _vehicle(self, state: m.VehicleState) -> None:
        if self._pose(BODY, state.position, state.orientation):
            scene.draw_arms(self._stream)
        self._scalar("speed", 0, math.hypot(*state.velocity))
        self._scalar("pitch", 0, _pitch_deg(state.orientation))
        for axis, rate in enumerate(state.body_rate):
            self._scalar(f"rate-{axis}", 2, rate)

    def _board(self, state: m.BoardState) -> None:
        if self._pose(BOARD_AT, state.position, state.orientation):
            scene.draw_board(self._stream, self._size, self._tolerance)
        self._scalar("speed", 1, abs(state.speed))
        self._scalar("pitch", 1, _pitch_deg(state.orientation))

    def _belief(self, belief: m.Belief) -> None:
        if not belief.valid:
            return
        self._scalar("rho", 0, belief.rho)
        if belief.last_exposure_ns:
            self._scalar("rho", 1, (belief.stamp_ns - belief.last_exposure_ns) / 1e9)
        self._scalar("speed", 2, abs(belief.speed))
        if self._pose(BELIEF_AT, belief.position, belief_orientation(belief.heading, belief.inclination)):
            scene.draw_believed(self._stream, self._size)

    def _detection(self, seen: m.Detection) -> None:
        self._scalar("tags", 0 if seen.found else 1, len(seen.tag_ids))
        if seen.found:
            self._stream.log(f"{WORLD}/detection", rr.Points3D.from_fields(positions=[seen.position]))
        # on an older picture the corners would be in the wrong place
        if seen.stamp_ns in self._pictures or (seen.corners_px and not self._pictures):
            scene.draw_corners(self._stream, seen.tag_ids, seen.corners_px, self._scale)

    def _image(self, image: m.Image) -> None:
        pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width)
        ok, jpeg = cv2.imencode(".jpg", pixels, [cv2.IMWRITE_JPEG_QUALITY, 75])
        if ok:
            self.add_picture(image.stamp_ns, jpeg.tobytes(), image.width, image.height)

    def _draw_lens(self, width: int, height: int) -> None:
        matrix = self._camera.matrix.copy()
        matrix[:2] *= self._scale
        scene.draw_lens(self._stream, self._camera.offset, self._mount, matrix, (width, height))

    def _action(self, action: m.Action) -> None:
        if action.engaged and not self._decided:  # after the verdict no command of the policy is sent
            self._command(0, action.body_rate, action.thrust)

    def _sent(self, sent: m.Sent) -> None:
        if not sent.tripped:
            self._command(1, sent.body_rate, sent.thrust)
            if sent.limited:
                self._command(_LIMITED, sent.body_rate, sent.thrust)
        elif sent.tripped != self._tripped:
            self._say(f"gate tripped: {sent.tripped}", "ERROR")
        self._tripped = sent.tripped

    def _command(self, line: int, rates: Sequence[float], thrust: float) -> None:
        for axis, rate in enumerate(rates):
            self._scalar(f"rate-{axis}", line, rate)
        self._scalar("thrust", line, thrust)

    def _contact(self, contact: m.Contact) -> None:
        if contact.outcome != "ongoing" and not self._decided:
            self._decided = True
            held = "attached" if contact.attached else "not attached"
            self._say(f"the referee decides here: {contact.reason or contact.outcome}, {held}", "INFO")

    def _run_stage(self, stage: m.Stage) -> None:
        if stage.name != self._stage:
            self._stage = stage.name
            self._say(f"stage: {stage.name}", "INFO")

    def _event(self, event: m.Event) -> None:
        self._say(f"{event.source}: {event.text}", scene.LEVELS.get(event.severity, "INFO"))

    def _say(self, text: str, level: str) -> None:
        self._stream.log(EVENTS, rr.TextLog(text, level=level))

    def _pose(self, path: str, position: Sequence[float], orientation: m.Quat) -> bool:
        """Move a frame; True the first time. A pose that is not finite is not shown."""
        if not all(map(math.isfinite, (*position, *orientation))):
            return False
        w, x, y, z = orientation
        turned = rr.Quaternion(xyzw=[x, y, z, w])
        self._stream.log(path, rr.Transform3D(translation=position, quaternion=turned))
        first = path not in self._drawn
        self._drawn.add(path)
        return first

    def _scalar(self, key: str, line: int, value: float) -> None:
        self._stream.log(f"{PLOTS}/{key}/{line}", rr.Scalars(value))


def _pitch_deg(orientation: m.Quat) -> float:
    return float(nose_up_deg(np.array([orientation]))[0])
