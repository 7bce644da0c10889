"""The paper's model camera in place of pictures: visibility test and observation noise at the scenario's rate."""

from __future__ import annotations

import numpy as np

from hil.contract.messages import BoardState, Detection, Stage, VehicleState
from hil.contract.node import Inbox, Node, Out
from hil.nodes.camera_sim import motion_of
from kernel.rotations import to_matrix
from vehicle.camera import detection_row
from vehicle.camera.noise import observe_board
from vehicle.camera.pinhole import board_visibility


class CameraModel(Node):
    """Publishes what a detector would have published, after exposure, transport and detection delays."""

    name = "camera"
    inputs = ("truth/vehicle", "truth/board", "run/stage")
    outputs = ("board/detection",)

    def __init__(
        self,
        camera_row: np.ndarray,
        noise: np.ndarray,
        bias: np.ndarray,
        rng: np.ndarray,
        rate_hz: float,
        delay_ns: int,
        processing_ns: int,
    ) -> None:
        """`camera_row`, `noise`, `bias`: rows of vehicle.camera.pinhole and vehicle.camera.noise; `rng` a kernel
        stream; `delay_ns` from mid-exposure to the detector's start."""
        self.period_ns = round(1e9 / rate_hz)
        self._cam, self._noise, self._bias, self._rng = camera_row, noise, bias, rng
        self._delay_ns, self._processing_ns = delay_ns, processing_ns
        self._sequence = 0

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        vehicle: VehicleState | None = inbox.latest("truth/vehicle")
        board: BoardState | None = inbox.latest("truth/board")
        stage: Stage | None = inbox.latest("run/stage")
        if vehicle is None or board is None or stage is None or stage.name == "prepare":
            return []
        v, b = motion_of(vehicle, now_ns), motion_of(board, now_ns)
        self._sequence += 1
        seen = board_visibility(v[:3], v[6:10], b[:3], to_matrix(b[6:10]), self._cam)
        out = np.zeros(detection_row.DIM)
        if seen:
            observe_board(
                v[:3], v[6:10], v[3:6], b[:3], b[6:10], b[3:6], self._cam, self._noise, 1.0, self._bias, self._rng, out
            )
        x, y, z, qw, qx, qy, qz, lateral, depth, rotation = (float(value) for value in out)
        detection = Detection(
            stamp_ns=now_ns,
            found=bool(seen),
            position=(x, y, z),
            orientation=(qw, qx, qy, qz),
            position_sigma=max(lateral, depth),
            orientation_sigma=rotation,
            tag_ids=(),
            corners_px=(),
            reason="" if seen else "not visible",
            image_sequence=self._sequence - 1,
            processing_ns=self._processing_ns,
        )
        return [Out("board/detection", detection, self._delay_ns + self._processing_ns)]
