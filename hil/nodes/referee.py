"""The referee: detects contact from motion capture of both bodies (Algorithm 1) and gives the magnet's verdict."""

from __future__ import annotations

import math

import numpy as np

from hil.contract.messages import BoardState, Contact, Event, Stage, VehicleState
from hil.contract.node import Inbox, Node, Out
from kernel.stamps import later_than_now
from policies.task import contact as rule
from policies.task import result_row, rules_row
from vehicle.mocap.continuity import Repetition
from vehicle.quadrotor.airframe import ContactGeometry

_OLDEST_NS = 200_000_000  # a sample, at the time of judging; at 4 m/s a vehicle has then flown 0.8 m
_ARRIVES_S = 1.0  # an approach that is so near its end is not cut off by the time limit,
_OVERTIME_S = 1.5  # for so long at most


class Referee(Node):
    """Judges every new pair of motion capture samples while the attempt lasts; the first decision stands.

    The time limit does not hand a vehicle back right in front of the board: it would meet it at its approach speed. An
    approach that ends within a second is awaited, and has failed by time; whether the magnet holds is judged.
    """

    name = "referee"
    inputs = ("mocap/vehicle", "mocap/board", "run/stage")
    outputs = ("referee/contact", "event")
    wakes = ("mocap/vehicle",)

    def __init__(self, rules: rule.ContactRules, disc: ContactGeometry, inclination: float | None) -> None:
        """`inclination` in rad: the board's set angle; None where the board tilts or heaves: its angle and its vertical
        speed are then taken from motion capture."""
        self._rules = rules.row(disc)
        self._inclination = inclination
        self._result = np.zeros(result_row.DIM)
        self._decided: Contact | None = None
        self._repetitions = Repetition(), Repetition()  # of vehicle and board

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        vehicle: VehicleState | None = inbox.latest("mocap/vehicle")
        board: BoardState | None = inbox.latest("mocap/board")
        stage: Stage | None = inbox.latest("run/stage")
        if vehicle is None or board is None or stage is None or stage.name != "attempt":
            return []
        if self._decided is not None:
            return [Out("referee/contact", self._decided)]
        stamps = (vehicle.stamp_ns, board.stamp_ns)
        if now_ns - min(stamps) > _OLDEST_NS or later_than_now(max(stamps), now_ns):
            return []  # a hidden body, late samples or a broken stamp: a contact cannot be judged by where it was
        bodies = zip(self._repetitions, (vehicle, board), strict=True)
        if any([repetition.add(seen.stamp_ns, seen.position, True) for repetition, seen in bodies]):
            return []  # nor by a pose that is sent again and again: a measured one changes, of a body at rest too
        inclination, rise = (self._inclination, 0.0) if self._inclination is not None else _moving(board)
        board_row = np.array([*board.position, board.heading, board.speed, board.turn_rate, inclination, 0.0])
        state = (
            np.array(vehicle.position),
            np.array(vehicle.velocity) - (0.0, 0.0, rise),
            np.array(vehicle.orientation),
            np.array(vehicle.body_rate),
        )
        seen = self._judge(state, board_row, (now_ns - stage.attempt_start_ns) * 1e-9)
        contact = Contact(
            vehicle.stamp_ns,
            seen.outcome,
            seen.reason,
            seen.attached,
            seen.within_tolerance,
            seen.x,
            seen.y,
            seen.normal_error,
            seen.normal_speed,
            seen.tangential_speed,
        )
        if seen.outcome == "ongoing":
            return [Out("referee/contact", contact)]
        self._decided = contact
        held = "attached" if seen.attached else "not attached"
        why = f" ({seen.reason})" if seen.reason else ""
        return [
            Out("referee/contact", contact),
            Out("event", Event(now_ns, "info", self.name, f"{seen.outcome}{why}, {held}")),
        ]

    def _judge(self, state: tuple[np.ndarray, ...], board_row: np.ndarray, elapsed_s: float) -> rule.ContactView:
        """Algorithm 1 at `elapsed_s` of the attempt; beyond the time limit as the class says."""
        rule.evaluate(*state, board_row, elapsed_s, self._rules, self._result)
        seen, limit_s = rule.view(self._result), float(self._rules[rules_row.TIME_LIMIT])
        if seen.reason != rule.REASONS[rule.TIMEOUT]:
            return seen
        rule.evaluate(*state, board_row, limit_s, self._rules, self._result)
        late = rule.view(self._result)
        if late.touched:
            return late._replace(outcome=seen.outcome, reason=seen.reason, within_tolerance=False)
        arrives = 0.0 < late.height < -_ARRIVES_S * late.normal_speed
        return late if arrives and elapsed_s < limit_s + _OVERTIME_S else seen


def _moving(board: BoardState) -> tuple[float, float]:
    """(inclination rad, vertical speed m/s) as measured."""
    _, x, y, _ = board.orientation
    return math.acos(max(-1.0, min(1.0, 1.0 - 2.0 * (x * x + y * y)))), board.velocity[2]
