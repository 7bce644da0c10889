"""The belief filter: detections in, the board's state predicted to now out, at the control rate and per detection."""

from __future__ import annotations

from hil.contract.messages import Belief
from hil.contract.node import Inbox, Node, Out
from policies.estimation.board_filter import BoardFilter


class BeliefNode(Node):
    """One `BoardFilter`; measurements are applied at their exposure time, however late they come."""

    name = "belief"
    inputs = ("board/detection", "vehicle/odometry")
    outputs = ("belief",)
    wakes = ("vehicle/odometry", "board/detection")

    def __init__(self, board_filter: BoardFilter) -> None:
        self._filter = board_filter

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        seen = [detection for detection in inbox.new("board/detection") if detection.found]
        for detection in seen:
            self._filter.update(
                detection.stamp_ns,
                detection.position,
                detection.orientation,
                detection.position_sigma,
                detection.orientation_sigma,
            )
        if inbox.latest("vehicle/odometry") is None or not (seen or inbox.new("vehicle/odometry")):
            return []
        return [Out("belief", Belief(*self._filter.estimate(now_ns)))]
