"""The belief filter: detections in, the board predicted to now out, at the control rate."""

from __future__ import annotations

from hil.messages import Belief, Detection
from hil.node import Inbox, Out
from policies.belief import BoardFilter


class BeliefNode:
    """One `BoardFilter`; measurements are applied at their exposure time, however late they come."""

    name = "belief"
    inputs = ("board/detection", "vehicle/odometry")
    outputs = ("belief",)
    wakes = ("vehicle/odometry",)
    period_ns = 0

    def __init__(self, board_filter: BoardFilter) -> None:
        self._filter = board_filter

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        for detection in inbox.new("board/detection"):
            self._update(detection)
        if not inbox.new("vehicle/odometry"):
            return []
        return [Out("belief", Belief(*self._filter.estimate(now_ns)))]

    def _update(self, seen: Detection) -> None:
        if seen.found:
            self._filter.update(
                seen.stamp_ns, seen.position, seen.orientation, seen.position_sigma, seen.orientation_sigma
            )

    def close(self) -> None:
        pass
