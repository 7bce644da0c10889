"""The belief filter: detections in, the board's state predicted to now out, at the control rate and per detection."""

from __future__ import annotations

from hil.contract.messages import Belief, Event
from hil.contract.node import Inbox, Node, Out
from policies.estimation.board_ekf import CODES, LATER_THAN_NOW
from policies.estimation.board_filter import BoardFilter


class BeliefNode(Node):
    """One `BoardFilter`; measurements are applied at their exposure time, however late they come."""

    name = "belief"
    inputs = ("board/detection", "vehicle/odometry")
    outputs = ("belief", "event")
    wakes = ("vehicle/odometry", "board/detection")

    def __init__(self, board_filter: BoardFilter) -> None:
        self._filter = board_filter
        self._later = 0

    @property
    def counters(self) -> dict[str, int]:
        return {"detections refused, stamped later than now": self._later}

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        seen = [detection for detection in inbox.new("board/detection") if detection.found]
        outs: list[Out] = []
        for detection in seen:
            code = self._filter.update(
                detection.stamp_ns,
                detection.position,
                detection.orientation,
                detection.position_sigma,
                detection.orientation_sigma,
                now_ns,
            )
            if code == CODES[LATER_THAN_NOW]:
                self._later += 1
                if self._later == 1:
                    text = "a detection was refused: stamped later than now; further ones are only counted"
                    outs.append(Out("event", Event(now_ns, "warning", self.name, text)))
        if inbox.latest("vehicle/odometry") is None or not (seen or inbox.new("vehicle/odometry")):
            return outs
        return [*outs, Out("belief", Belief(*self._filter.estimate(now_ns)))]
