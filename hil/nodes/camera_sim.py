"""The simulated camera: one exposure of the true scene per period, delivered after read-out and transport."""

from __future__ import annotations

import numpy as np

from hil.contract.messages import BoardState, Image, Stage, VehicleState
from hil.contract.node import Inbox, Node, Out
from kernel.rotations import rotate_back
from vehicle.render.pose import motion_row
from vehicle.render.renderer import Renderer


def motion_of(state: VehicleState | BoardState, at_ns: int) -> np.ndarray:
    """Motion row (13,) of a body moved with its own twist from its stamp to `at_ns` (a few milliseconds)."""
    seconds = (at_ns - state.stamp_ns) * 1e-9
    position = np.array(state.position) + seconds * np.array(state.velocity)
    if isinstance(state, VehicleState):
        return motion_row(position, state.orientation, state.velocity, state.body_rate)
    body_rate = rotate_back(state.orientation, 0.0, 0.0, state.turn_rate)
    return motion_row(position, state.orientation, state.velocity, body_rate)


class CameraSim(Node):
    """Renders from the lead stage to the run's end (no other is used) and stamps each picture with the middle of its
    exposure."""

    name = "camera"
    inputs = ("truth/vehicle", "truth/board", "run/stage")
    outputs = ("camera/image",)

    def __init__(
        self, renderer: Renderer, rate_hz: float, exposure_ns: int, transport_ns: int, drawn_after_ns: int = 0
    ) -> None:
        """`drawn_after_ns`: how long after its exposure a picture is drawn, no longer than until it is delivered. At
        usual rates a picture arrives when the next one is exposed: drawn at once, the next would keep cores from the
        search of this one."""
        self.period_ns = round(1e9 / rate_hz)
        self._renderer = renderer
        self._exposure_ns, self._delay_ns = exposure_ns, exposure_ns // 2 + transport_ns
        self._drawn_after_ns = min(drawn_after_ns, self._delay_ns)
        self.lookahead_ns = self._delay_ns - self._drawn_after_ns
        self._sequence = 0

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        vehicle, board = inbox.latest("truth/vehicle"), inbox.latest("truth/board")
        stage: Stage | None = inbox.latest("run/stage")
        if vehicle is None or board is None or stage is None or stage.name in ("prepare", "ended"):
            return []
        exposed_ns = now_ns - self._drawn_after_ns
        pixels = self._renderer.render(
            motion_of(vehicle, exposed_ns), motion_of(board, exposed_ns), self._exposure_ns, self._sequence
        )
        height, width = pixels.shape
        image = Image(exposed_ns, width, height, self._exposure_ns, pixels.tobytes(), self._sequence)
        self._sequence += 1
        return [Out("camera/image", image, self.lookahead_ns)]
