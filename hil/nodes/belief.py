"""The belief filter: detections, or poses of motion capture, in; the board's state predicted to now out, at the control
rate and per measurement."""

from __future__ import annotations

from hil.contract.messages import Belief, BoardState, Event
from hil.contract.node import Inbox, Node, Out
from policies.estimation.board_ekf import CODES, LATER_THAN_NOW
from policies.estimation.board_filter import BoardFilter

# What motion capture of the board is taken to err by, one sigma: m and rad. More than it does, as the board is no rigid
# body to a micrometre, and a filter that believes in less follows its noise.
MOCAP_POSITION, MOCAP_ORIENTATION = 0.001, 0.003


class BeliefNode(Node):
    """One `BoardFilter`; measurements are applied at their exposure time, however late they come."""

    name = "belief"
    inputs = ("board/detection", "vehicle/odometry")
    outputs = ("belief", "event")
    wakes = ("vehicle/odometry", "board/detection")
    _what, _plural = "detection", "detections"

    def __init__(self, board_filter: BoardFilter) -> None:
        self._filter = board_filter
        self._later = 0

    @property
    def counters(self) -> dict[str, int]:
        return {f"{self._plural} refused, stamped later than now": self._later}

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        seen = self._seen(inbox)
        outs: list[Out] = []
        for stamp_ns, position, orientation, position_sigma, orientation_sigma in seen:
            code = self._filter.update(stamp_ns, position, orientation, position_sigma, orientation_sigma, now_ns)
            if code == CODES[LATER_THAN_NOW]:
                self._later += 1
                if self._later == 1:
                    text = f"a {self._what} was refused: stamped later than now; further ones are only counted"
                    outs.append(Out("event", Event(now_ns, "warning", self.name, text)))
        if inbox.latest("vehicle/odometry") is None or not (seen or inbox.new("vehicle/odometry")):
            return outs
        return [*outs, Out("belief", Belief(*self._filter.estimate(now_ns)))]

    def _seen(self, inbox: Inbox) -> list[tuple]:
        """Stamp (ns), position, orientation and their sigmas of each measurement."""
        found = [detection for detection in inbox.new("board/detection") if detection.found]
        return [(d.stamp_ns, d.position, d.orientation, d.position_sigma, d.orientation_sigma) for d in found]


class MocapBeliefNode(BeliefNode):
    """The same filter on motion capture, where the policy may know it: position and attitude in, speed and turn rate
    out, each as of its stamp, so that its delay is predicted over. What motion capture says of motion is not used."""

    inputs = ("mocap/board", "vehicle/odometry")
    wakes = ("vehicle/odometry", "mocap/board")
    _what, _plural = "pose of motion capture", "poses of motion capture"

    def _seen(self, inbox: Inbox) -> list[tuple]:
        boards: list[BoardState] = inbox.new("mocap/board")
        return [(b.stamp_ns, b.position, b.orientation, MOCAP_POSITION, MOCAP_ORIENTATION) for b in boards]
