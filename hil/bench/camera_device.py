"""A real or recorded camera, with the vehicle on its stand in front of the board: its pictures, decoded."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from groundcar.board.layout import Board
from hil.assembly.cameras import open_camera
from hil.assembly.rig import Rig
from hil.assembly.sensing import mounted_cameras
from hil.bench.camera import PICTURES, BoardMeasurement, Quat, measure
from hil.bench.reading import Unavailable
from hil.recording.reader import Recording
from hil.recording.recorder import PREFIX
from hil.wires import WireError
from hil.wires.camera import CameraWire, Mode
from hil.wires.camera_mcap import RecordedCamera
from scenarios.draw import Drawn
from scenarios.spec import Scenario
from vehicle.apriltag.detector import BoardDetector
from vehicle.quadrotor.airframe import Airframe

_LIMIT_NS = 8_000_000_000
_LEVEL = (1.0, 0.0, 0.0, 0.0)
_NOWHERE = np.zeros(3)

Shot = tuple[int, np.ndarray, int]  # time of exposure (ns, of the camera's own time), pixels, number


class DeviceBench:
    """Reads a second of pictures once; the crew has placed the vehicle at the checklist's distance.

    The board's inclination needs the camera's attitude: from the autopilot or the recording, else the
    vehicle is taken as level.
    """

    def __init__(
        self,
        scenario: Scenario,
        rig: Rig,
        airframe: Airframe,
        drawn: Drawn,
        attitude: Callable[[], Quat | None] = lambda: None,
    ) -> None:
        """Raises Unavailable if the camera cannot be opened in the scenario's mode."""
        self.camera = mounted_cameras(rig.camera, airframe, drawn)[1]
        self.board = Board(size=scenario.board.size)
        self.set_deg = scenario.board.inclination_deg
        self.wanted_hz = scenario.camera.rate
        wanted = Mode(self.camera.width, self.camera.height, self.wanted_hz)
        try:
            camera = open_camera(rig.camera, wanted)
        except WireError as error:
            raise Unavailable(str(error)) from None
        try:
            self._shots = _collect(camera, max(PICTURES, round(self.wanted_hz)))
        finally:
            camera.close()
        self._attitude = attitude()
        self._recorded: list[tuple[int, Quat]] = []
        if isinstance(camera, RecordedCamera) and self._attitude is None:
            self._recorded = _recorded_attitudes(rig.camera.device, camera.shift_ns)
        how = "from its autopilot" if self._attitude else "as recorded" if self._recorded else "taken as level"
        self.source = f"{camera.source}, AprilTag detector; vehicle's attitude {how}"
        self._seen: list[BoardMeasurement] = []

    @property
    def mode(self) -> tuple[int, int, float]:
        """Width, height (px) and rate (Hz) that were delivered, the rate over all pictures."""
        height, width = self._shots[0][1].shape
        (first_ns, _, first), (last_ns, _, last) = self._shots[0], self._shots[-1]
        seconds = (last_ns - first_ns) * 1e-9
        return width, height, (last - first) / seconds if seconds > 0 else 0.0

    def measure_board(self, distance: float) -> list[BoardMeasurement]:
        """Ten pictures; their distance is set by the crew."""
        if not self._seen:
            detector = BoardDetector(self.camera, self.board)
            every = self._shots[:: max(1, len(self._shots) // PICTURES)][:PICTURES]
            self._seen = [
                measure(detector, self.camera, pixels, _NOWHERE, np.array(self._at(stamp_ns)))
                for stamp_ns, pixels, _ in every
            ]
        return self._seen

    def _at(self, stamp_ns: int) -> Quat:
        if self._attitude is not None:
            return self._attitude
        if self._recorded:
            return min(self._recorded, key=lambda sample: abs(sample[0] - stamp_ns))[1]
        return _LEVEL


def _collect(camera: CameraWire, count: int) -> list[Shot]:
    """`count` pictures, or fewer if a recording has no more. Raises Unavailable if a device is lost or none come."""
    shots: list[Shot] = []
    began = time.monotonic_ns()
    while len(shots) < count and not camera.lost:
        now = time.monotonic_ns() - began
        picture = camera.take(now)
        if picture is not None:
            shots.append((now - picture.age_ns, picture.pixels, picture.sequence))
        elif now > _LIMIT_NS:
            break
        time.sleep(0.001)
    if len(shots) < 2:
        raise Unavailable(camera.lost or f"camera {camera.source} gave {len(shots)} pictures")
    return shots


def _recorded_attitudes(path: str, shift_ns: int) -> list[tuple[int, Quat]]:
    """(time, attitude) of the vehicle in the recording, by motion capture or its own odometry, `shift_ns` later."""
    recording = Recording(path)
    for topic in ("mocap/vehicle", "vehicle/odometry"):
        if PREFIX + topic in recording.topics:
            states = (entry.message for entry in recording.messages([topic]))
            return [(state.stamp_ns + shift_ns, state.orientation) for state in states]
    return []
