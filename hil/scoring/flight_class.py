"""How a flight ended, in exactly one class, whatever happened on the way: perched, missed, aborted, or unsafe.

Everything comes from topics; whether the motors have stopped is said by the host, which can look at the device.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from hil.contract.messages import BoardState, Contact, Event, Faults, Sent, Stage, VehicleState, VehicleStatus
from hil.scoring.verdict import NOT_HELD
from kernel.rotations import rotate

PERCHED, MISSED, ABORTED, UNSAFE = "perched", "missed and landed", "aborted and landed", "unsafe"
CLASSES = (PERCHED, MISSED, ABORTED, UNSAFE)

FENCE_MARGIN = 5.0  # m
GROUND_SPEED = 2.0  # m/s
BOARD_SPEED = 2.0  # m/s
LAND_LIMIT_S = 60.0
_ON_BOARD = 0.45  # m, from the board's centre
_ON_GROUND = 0.3  # m above the start, and m/s
_NEAR_BOARD = 0.9  # m
_GROUND_BAND = 0.05  # m

DEFINITIONS = {
    PERCHED: f"The magnet held; at the end the vehicle is on the board ({_ON_BOARD} m from its centre), motors off.",
    MISSED: "The referee decided that the magnet does not hold, or it did not hold; at the end the vehicle is on the "
    "ground, motors off.",
    ABORTED: "The attempt was given up before the referee decided, or never began: the gate tripped, the driver lost "
    "control or gave it back, the autopilot's failsafe acted, or a process was lost. At the end the vehicle is on the "
    "ground, motors off.",
    UNSAFE: f"More than {FENCE_MARGIN:g} m outside the gate's fence; the ground met at more than {GROUND_SPEED:g} m/s; "
    f"the board met at more than {BOARD_SPEED:g} m/s along its normal; motors that run {LAND_LIMIT_S:g} s after the "
    "end; a command sent after a gate had tripped; or no other class.",
}
READ = (
    "run/stage", "run/fault", "truth/vehicle", "truth/board", "mocap/vehicle", "mocap/board", "vehicle/status",
    "vehicle/sent", "car/sent", "referee/contact", "event",
)  # fmt: skip

Range = tuple[float, float]


@dataclass(frozen=True)
class FlightClass:
    """One of `CLASSES`, why, and which of the scenario's faults never began."""

    name: str
    why: tuple[str, ...]
    not_begun: tuple[str, ...] = ()

    def as_dict(self) -> dict[str, Any]:
        """For score.json."""
        return {"class": self.name, "why": list(self.why), "not_begun": list(self.not_begun)}


class FlightJudge:
    """Feed it every message (`judge(now_ns, topic, message)`, a host's tap); ask `result` at the end."""

    def __init__(self, fence: tuple[Range, Range, Range], board_size: float, faults: Sequence[str] = ()) -> None:
        """`fence`: the gate's x, y and z limits (m, world). `board_size`: its side (m). `faults`: their titles."""
        self._fence, self._half, self._faults = fence, board_size / 2, faults
        self._stage = ""
        self._attempted = False
        self._contact: Contact | None = None
        self._vehicle: VehicleState | None = None
        self._board: BoardState | None = None
        self._floor: float | None = None
        self._height: float | None = None  # above the board's plane, at the sample before
        self._truth: set[str] = set()
        self._tripped: dict[str, bool] = {}
        self._aborts: dict[str, None] = {}
        self._unsafe: dict[str, None] = {}
        self._begun: set[int] = set()

    def __call__(self, now_ns: int, topic: str, message: Any) -> None:
        part, _, body = topic.partition("/")
        if part == "truth" or (part == "mocap" and f"truth/{body}" not in self._truth):
            self._truth.add(topic)
            self._move(message)
        elif topic == "vehicle/sent":
            self._command("vehicle", message)
        elif topic == "car/sent" and self._tripped.get("car"):
            self._unsafe["a command was sent to the car after its gate had tripped"] = None
        elif topic == "vehicle/status":
            self._status(message)
        elif topic == "referee/contact":
            if self._contact is None and message.outcome != "ongoing":
                self._contact = message
        elif topic == "run/stage":
            self._at(message)
        elif topic == "run/fault":
            self._begun.update(_faults(message).begun)
        elif topic == "event" and _event(message).source == "car_gate":
            self._tripped["car"] = True

    def _at(self, stage: Stage) -> None:
        self._stage = stage.name
        self._attempted = self._attempted or stage.name == "attempt"

    def _status(self, status: VehicleStatus) -> None:
        if self._contact is not None or self._stage == "ended":
            return
        if status.given_up:
            self._aborts["the vehicle's driver gave control up"] = None
        if status.failsafe:
            self._aborts["the autopilot's failsafe acted"] = None

    def _command(self, gate: str, sent: Sent) -> None:
        if self._tripped.get(gate) and not sent.tripped:
            self._unsafe["a command was sent to the vehicle after its gate had tripped"] = None
        if sent.tripped:
            self._tripped[gate] = True
            if self._contact is None:
                self._aborts[f"gate: {sent.tripped}"] = None

    def _move(self, body: VehicleState | BoardState) -> None:
        if isinstance(body, BoardState):
            self._board = body
            return
        before, self._vehicle = self._vehicle, body
        if not all(map(math.isfinite, (*body.position, *body.velocity))):
            return
        if self._floor is None or before is None:
            self._floor = body.position[2]
            return
        for axis, value, (low, high) in zip("xyz", body.position, self._fence, strict=True):
            beyond = max(value - high, low - value) if axis != "z" else value - high
            if beyond > FENCE_MARGIN:
                self._unsafe[f"the vehicle was more than {FENCE_MARGIN:g} m outside its fence ({axis})"] = None
        ground = self._floor + _GROUND_BAND
        if before.position[2] > ground >= body.position[2]:
            speed = -min(before.velocity[2], body.velocity[2])
            if speed > GROUND_SPEED:
                self._unsafe[f"the vehicle met the ground at {speed:.1f} m/s"] = None
        self._meets_board(body)

    def _meets_board(self, vehicle: VehicleState) -> None:
        board = self._board
        if board is None or math.dist(vehicle.position, board.position) > _NEAR_BOARD:
            self._height = None
            return
        normal = rotate(board.orientation, 0.0, 0.0, 1.0)
        apart = [p - b for p, b in zip(vehicle.position, board.position, strict=True)]
        height = sum(a * n for a, n in zip(apart, normal, strict=True))
        beside = math.sqrt(max(0.0, sum(a * a for a in apart) - height * height))
        if self._height is not None and self._height > _GROUND_BAND >= height and beside < 1.42 * self._half:
            moves = [v - b for v, b in zip(vehicle.velocity, board.velocity, strict=True)]
            speed = -sum(m * n for m, n in zip(moves, normal, strict=True))
            if speed > BOARD_SPEED:
                self._unsafe[f"the vehicle met the board at {speed:.1f} m/s"] = None
        self._height = height

    def _on_board(self) -> bool:
        if self._contact is None or not self._contact.attached or self._vehicle is None or self._board is None:
            return False
        return math.dist(self._vehicle.position, self._board.position) < _ON_BOARD

    def _on_ground(self) -> bool:
        vehicle, floor = self._vehicle, self._floor
        if vehicle is None or floor is None:
            return True  # it was never seen to leave it
        return vehicle.position[2] - floor < _ON_GROUND and math.hypot(*vehicle.velocity) < _ON_GROUND

    def settled(self, motors_off: bool) -> bool:
        """Whether the flight is over: motors off, on the board or on the ground."""
        return motors_off and (self._on_board() or self._on_ground())

    def result(self, motors_off: bool, trouble: str = "") -> FlightClass:
        """The class. `trouble`: why the host gave the attempt up, empty if it did not."""
        not_begun = tuple(title for place, title in enumerate(self._faults) if place not in self._begun)
        aborts = [*self._aborts, *([trouble] if trouble else [])]
        if not self._attempted:
            aborts.append("no attempt began")
        unsafe = list(self._unsafe)
        if not motors_off:
            unsafe.append(f"the motors ran {LAND_LIMIT_S:g} s after the end")
        elif not self._on_board() and not self._on_ground():
            unsafe.append("the vehicle is neither on the board nor on the ground")
        elif not self._on_board() and self._contact is None and not aborts:
            unsafe.append("no class: the referee decided nothing, and nothing was aborted")
        if unsafe:
            return FlightClass(UNSAFE, tuple(unsafe), not_begun)
        if self._on_board():
            return FlightClass(PERCHED, (), not_begun)
        if aborts:
            return FlightClass(ABORTED, tuple(aborts), not_begun)
        contact = self._contact
        reason = NOT_HELD if contact and contact.attached else contact.reason if contact else ""
        return FlightClass(MISSED, (reason,) if reason else (), not_begun)


def _faults(message: Any) -> Faults:
    return message


def _event(message: Any) -> Event:
    return message
