"""The vehicle's pose from motion capture on its way to the autopilot's estimator."""

from __future__ import annotations

from hil.contract.messages import VehicleState
from hil.contract.node import Inbox
from kernel.clip import usable
from kernel.stamps import later_than_now
from vehicle.mocap.continuity import Continuity, Repetition
from vehicle.px4.driver.types import ExternalPose


class ExternalPoses:
    """Passes a pose on unless it cannot be the vehicle's: not finite, stamped later than now, or, in flight, off by a
    jump or equal to those before it. Without poses the autopilot knows that it does not know where it is; with wrong
    ones it flies by them."""

    def __init__(self, speed: float) -> None:
        """`speed`: m/s that the vehicle does not reach."""
        self._continuity, self._repetition = Continuity(speed), Repetition()
        self._told: set[str] = set()
        self.refused = 0

    def take(self, now_ns: int, inbox: Inbox, armed: bool) -> tuple[ExternalPose | None, str]:
        """The pose for the autopilot, and why one was not passed on, once for each reason."""
        seen: VehicleState | None = inbox.latest("mocap/vehicle")
        if seen is None:
            return None, ""
        why = self._why_not(now_ns, seen, armed)
        if not why:
            return ExternalPose(seen.stamp_ns, seen.position, seen.orientation), ""
        self.refused += bool(inbox.new("mocap/vehicle"))
        first = why not in self._told
        self._told.add(why)
        return None, f"a pose of motion capture is not passed on to the autopilot: {why}" if first else ""

    def _why_not(self, now_ns: int, seen: VehicleState, armed: bool) -> str:
        if later_than_now(seen.stamp_ns, now_ns):
            return "stamped later than now"
        if not usable((*seen.position, *seen.orientation)):
            return "not finite"
        if not armed:  # it is carried, and its markers are assigned anew
            self._continuity.reset()
        if self._continuity.add(seen.stamp_ns, seen.position):
            return "it has jumped"
        repeats = self._repetition.add(seen.stamp_ns, seen.position, armed)
        return "it does not change, to the last bit" if repeats else ""
