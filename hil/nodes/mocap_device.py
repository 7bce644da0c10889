"""A real motion capture system: poses of vehicle and board in, their states with measured motion out.

The board is compared with how it is set, and its motion with the car's wheels; the vehicle with its autopilot in the
node of its driver, which does not arm before both agree.
"""

from __future__ import annotations

from typing import Protocol

from hil.contract.messages import BoardState, CarFeedback, Event, Stage, VehicleState
from hil.contract.node import Inbox, Node, Out
from hil.nodes.mocap import board_state
from hil.wires import WireError
from hil.wires.mocap_vrpn import BodyPose
from kernel.rotations import rotate
from kernel.stamps import later_than_now
from vehicle.mocap.agreement import BoardSetting, Lasting, board_disagreement, motion_disagreement
from vehicle.mocap.motion import BodyMotion

_POLL_NS = 5_000_000
_HIDDEN_NS = 200_000_000
_LASTS_NS = 1_000_000_000  # a disagreement that counts
_FRESH_NS = 200_000_000  # feedback of the car that is compared


class MocapWire(Protocol):
    """The source of poses; see `hil.wires.mocap_vrpn.VrpnMocap`."""

    @property
    def lost(self) -> str: ...

    def take(self, now_ns: int, /) -> list[BodyPose]: ...

    def close(self) -> None: ...


class MocapDevice(Node):
    """Publishes each pose on arrival. A system that is lost, or whose board is not the one that is set, ends the
    service, and with it the attempt."""

    name = "mocap"
    inputs = ("run/stage", "car/feedback")
    outputs = ("mocap/vehicle", "mocap/board", "event")
    wakes = ("run/stage",)  # a node that is woken is stepped at the time that it is, not at its deadline
    period_ns = _POLL_NS

    def __init__(self, wire: MocapWire, vehicle: str, board: str, setting: BoardSetting | None = None) -> None:
        """`vehicle` and `board`: the names of the two bodies in the system. `setting`: how the board is set, which it
        is compared with until the attempt begins; it moves as the car's wheels until then."""
        self._wire, self._board, self._setting = wire, board, setting
        self._at_rest, self._moving = Lasting(_LASTS_NS), Lasting(_LASTS_NS)
        self._motions = {vehicle: BodyMotion(), board: BodyMotion()}
        self._vehicle = vehicle
        self._seen_ns: dict[str, int] = {}
        self._told: set[str] = set()
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
        boards = [out.message for out in outs if out.topic == "mocap/board"]
        stage: Stage | None = inbox.latest("run/stage")
        if boards and (stage is None or stage.name in ("prepare", "lead")):
            self._lost = self._disagreement(now_ns, boards[-1], inbox.latest("car/feedback"))
        if self._lost:
            return [Out("event", Event(now_ns, "error", self.name, self._lost))]
        return outs + self._watch(now_ns)

    def _disagreement(self, now_ns: int, board: BoardState, car: CarFeedback | None) -> str:
        """Why this cannot be the board on its car; empty while it can, or has not lasted."""
        if self._setting is None:
            return ""
        why = board_disagreement(board.position, board.orientation, self._setting)
        if self._at_rest.add(now_ns, bool(why)):
            return f'motion capture\'s "{self._board}" is not the board that is set: {why}'
        why = ""
        if car is not None and 0 <= now_ns - car.stamp_ns < _FRESH_NS and not car.fault:
            why = motion_disagreement(board.speed, board.turn_rate, car.speed, car.turn_rate)
        if self._moving.add(now_ns, bool(why)):
            return f'motion capture\'s "{self._board}" does not move as the car: {why}'
        return ""

    def _state(self, now_ns: int, pose: BodyPose) -> Out | None:
        stamp = now_ns - pose.age_ns
        moves = self._motions[pose.body].add(stamp, pose.position, pose.orientation, now_ns)
        if moves is None:
            self._rejected += 1
            return self._refuse(now_ns, pose) if later_than_now(stamp, now_ns) else None
        self._seen_ns[pose.body] = now_ns
        velocity, body_rate = moves
        if pose.body == self._vehicle:
            return Out("mocap/vehicle", VehicleState(stamp, pose.position, velocity, pose.orientation, body_rate))
        turn_rate = rotate(pose.orientation, *body_rate)[2]
        return Out("mocap/board", board_state(stamp, pose.position, velocity, pose.orientation, turn_rate))

    def _refuse(self, now_ns: int, pose: BodyPose) -> Out | None:
        """The event for the first pose of a body that is stamped later than now."""
        if pose.body in self._told:
            return None
        self._told.add(pose.body)
        text = f'a pose of "{pose.body}" was refused: stamped {-pose.age_ns * 1e-6:.1f} ms later than now'
        return Out("event", Event(now_ns, "warning", self.name, text))

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
