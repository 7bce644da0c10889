"""A real motion capture system: poses of vehicle and board in, their states with measured motion out."""

from __future__ import annotations

from typing import Protocol

from hil.contract.messages import Event, VehicleState
from hil.contract.node import Inbox, Node, Out
from hil.nodes.mocap import board_state
from hil.wires import WireError
from hil.wires.mocap_vrpn import BodyPose
from kernel.rotations import rotate
from vehicle.mocap.motion import BodyMotion

_POLL_NS = 5_000_000
_HIDDEN_NS = 200_000_000


class MocapWire(Protocol):
    """The source of poses; see `hil.wires.mocap_vrpn.VrpnMocap`."""

    @property
    def lost(self) -> str: ...

    def take(self, now_ns: int, /) -> list[BodyPose]: ...

    def close(self) -> None: ...


class MocapDevice(Node):
    """Publishes each pose on arrival. A system that is lost ends the service, and with it the attempt."""

    name = "mocap"
    inputs = ("run/stage",)
    outputs = ("mocap/vehicle", "mocap/board", "event")
    wakes = ("run/stage",)  # a node that is woken is stepped at the time that it is, not at its deadline
    period_ns = _POLL_NS

    def __init__(self, wire: MocapWire, vehicle: str, board: str) -> None:
        """`vehicle` and `board`: the names of the two bodies in the system."""
        self._wire = wire
        self._motions = {vehicle: BodyMotion(), board: BodyMotion()}
        self._vehicle = vehicle
        self._seen_ns: dict[str, int] = {}
        self._hidden: set[str] = set()
        self._rejected = self._hidings = 0
        self._lost = ""

    @property
    def counters(self) -> dict[str, int]:
        return {
            "poses of motion capture rejected": self._rejected,
            "times a body was hidden from motion capture": self._hidings,
            "motion capture systems lost": int(bool(self._lost)),
        }

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        if self._lost:
            raise WireError(self._lost)
        self._lost = self._wire.lost
        if self._lost:
            return [Out("event", Event(now_ns, "error", self.name, self._lost))]
        outs = [out for pose in self._wire.take(now_ns) if (out := self._state(now_ns, pose)) is not None]
        return outs + self._watch(now_ns)

    def _state(self, now_ns: int, pose: BodyPose) -> Out | None:
        stamp = now_ns - pose.age_ns
        moves = self._motions[pose.body].add(stamp, pose.position, pose.orientation)
        if moves is None:
            self._rejected += 1
            return None
        self._seen_ns[pose.body] = now_ns
        velocity, body_rate = moves
        if pose.body == self._vehicle:
            return Out("mocap/vehicle", VehicleState(stamp, pose.position, velocity, pose.orientation, body_rate))
        turn_rate = rotate(pose.orientation, *body_rate)[2]
        return Out("mocap/board", board_state(stamp, pose.position, velocity, pose.orientation, turn_rate))

    def _watch(self, now_ns: int) -> list[Out]:
        """Report when a body is hidden and when it is back."""
        outs = []
        for body, seen_ns in self._seen_ns.items():
            hidden = now_ns - seen_ns > _HIDDEN_NS
            if hidden != (body in self._hidden):
                self._hidden ^= {body}
                self._hidings += hidden
                text = f'"{body}" is hidden from motion capture' if hidden else f'"{body}" is seen again'
                outs.append(Out("event", Event(now_ns, "warning" if hidden else "info", self.name, text)))
        return outs

    def close(self) -> None:
        self._wire.close()
