"""The quadrotor's driver with its gate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Protocol

from hil.contract.messages import (
    Action,
    Belief,
    BoardState,
    Contact,
    Event,
    Sent,
    VehicleParameters,
    VehicleState,
    VehicleStatus,
)
from hil.contract.node import Inbox, Node, Out
from hil.nodes.external_pose import ExternalPoses
from hil.safety.dive import SILENCE_NS, diving
from hil.safety.floor import DOWN_NS, FloorWatch
from hil.safety.magnet import MagnetCheck
from hil.safety.vehicle_gate import VehicleGate
from hil.scoring.verdict import NOT_HELD
from kernel.stamps import later_than_now
from vehicle.mocap.agreement import Lasting, vehicle_disagreement
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.core import BEFORE_FLIGHT
from vehicle.px4.driver.types import ExternalPose, LinkOutput, Rates

STATUS_PERIOD_NS = 100_000_000
GROUND_PHASES = (*BEFORE_FLIGHT, "arm")
_LANDS = ("released", "failed")  # phases in which the autopilot has to land it, and no pilot flies
_FRESH_NS, _AGREES_NS = 300_000_000, 300_000_000
_DIFFERS_NS = 20_000_000_000  # an estimator takes seconds to align with the poses that it is given


class Driver(Protocol):
    """The driver of a vehicle; see `vehicle.px4.driver.driver.Px4Link`."""

    phase: str

    def step(
        self, now_ns: int, command: Rates | None = None, external_pose: ExternalPose | None = None, /
    ) -> LinkOutput: ...
    def allow_arming(self, arming: Arming, /) -> None: ...
    def refuse_arming(self) -> None: ...
    def release(self) -> None: ...
    def kill(self) -> None: ...
    @property
    def armed(self) -> bool: ...
    @property
    def garbage(self) -> int: ...
    @property
    def parameters(self) -> dict[str, float]: ...


class VehicleLink(Node):
    """Driver and gate in one node: nothing comes between the last check and the wire."""

    name = "vehicle_link"
    inputs = ("policy/action", "referee/contact", "belief", "mocap/vehicle", "mocap/board")
    outputs = ("vehicle/odometry", "vehicle/status", "vehicle/sent", "vehicle/parameters", "event")
    wakes = ("policy/action",)
    period_ns = 2_000_000

    def __init__(
        self,
        link: Driver,
        gate: VehicleGate,
        stands_for_truth: bool = False,
        external_pose: bool = False,
        virtual_board: bool = False,
        mocap_reach: float | None = None,
    ) -> None:
        """`stands_for_truth`: a real vehicle with simulated sensors, which use the pose from its odometry.
        `external_pose`: the vehicle's pose from motion capture is passed on to the autopilot's estimator.
        `virtual_board`: a real vehicle perches on a board that is not there, and would fall if its motors stopped.
        `mocap_reach` (m, the largest coordinate inside the fence): a real motion capture has to agree with the
        autopilot before `link` gets the permission to arm."""
        self._link, self._gate, self._truth = link, gate, stands_for_truth
        self._poses = ExternalPoses(gate.most_speed) if external_pose else None
        self._virtual_board = virtual_board
        self._reach, self._agrees, self._differs = mocap_reach, Lasting(_AGREES_NS), Lasting(_DIFFERS_NS)
        if stands_for_truth:
            self.outputs = (*VehicleLink.outputs, "truth/vehicle")
        self._odometry: VehicleState | None = None
        self._board: Belief | None = None
        self._seen: tuple[VehicleState | None, BoardState | None] = (None, None)  # by motion capture
        self._commanded_ns: int | None = None
        self._status_ns = -STATUS_PERIOD_NS
        self._phase = ""
        self._published: dict[str, float] = {}
        self._aborted = False
        self._arming: Arming | None = None  # the host's permission
        self._magnet: MagnetCheck | None = None  # from contact on
        self._floor = None if stands_for_truth else FloorWatch()  # of the autopilot it would learn nothing new

    def permit(self, arming: Any) -> None:
        """A real vehicle is not armed before. Raises ValueError for a table that is not that of an `Arming`."""
        self._arming = Arming.of(arming)
        if self._reach is None:
            self._link.allow_arming(self._arming)

    def abort(self, why: str) -> None:
        """Return control to the autopilot, which lands; on the ground, do not take off."""
        self._aborted = True
        self._link.release()

    @property
    def safe(self) -> bool:
        """On the ground or perched, as far as the autopilot has reported."""
        return self._link.phase in GROUND_PHASES or not self._link.armed

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        if self._aborted and self._link.phase in GROUND_PHASES:
            return []
        contact: Contact | None = inbox.latest("referee/contact")
        lost = self._end(now_ns, contact) if contact is not None and contact.outcome != "ongoing" else ""
        actions, self._board = inbox.new("policy/action"), inbox.latest("belief")
        self._seen = inbox.latest("mocap/vehicle"), inbox.latest("mocap/board")
        command, sent, tripped = self._checked(now_ns, self._wanted(actions)) if actions else (None, None, "")
        if tripped and self._link.phase == "handed_over":  # not from a pilot who has taken over
            self._link.release()
        silent = self._silent(now_ns, command is not None)
        down = self._down(self._seen[0])
        pose, refused = self._poses.take(now_ns, inbox, self._link.armed) if self._poses else (None, "")
        output = self._link.step(now_ns, command, pose)
        outs = [Out("event", Event(now_ns, note.severity, self.name, note.text)) for note in output.notes]
        errors = (lost, refused, silent, down)
        outs += [Out("event", Event(now_ns, "error", self.name, text)) for text in errors if text]
        if tripped:
            outs.append(Out("event", Event(now_ns, "error", "gate", f"gate tripped: {tripped}")))
        for sample in output.odometry:
            self._odometry = VehicleState(*sample)
            outs.append(Out("vehicle/odometry", self._odometry))
            if self._truth:
                outs.append(Out("truth/vehicle", self._odometry))
        if sent is not None and (output.sent_thrust is not None or tripped):
            outs.append(Out("vehicle/sent", _with_thrust(sent, output)))
        if self._reach is not None and output.phase == "ready":
            outs += self._before_arming(now_ns, self._seen[0], self._reach)
        outs += self._parameters(now_ns, output.phase)
        if output.phase != self._phase or now_ns - self._status_ns >= STATUS_PERIOD_NS:
            self._status_ns, self._phase = now_ns, output.phase
            outs.append(Out("vehicle/status", _status(now_ns, output)))
        return outs

    def _before_arming(self, now_ns: int, seen: VehicleState | None, reach: float) -> list[Out]:
        """Pass the host's permission on once motion capture agrees with the autopilot; give up when it differs for
        too long."""
        own = self._odometry
        if seen is None or own is None or now_ns - own.stamp_ns > _FRESH_NS:
            why = "no pose of the vehicle from motion capture" if seen is None else "no odometry of the autopilot"
        elif later_than_now(seen.stamp_ns, now_ns):
            why = "its pose is stamped later than now"
        elif now_ns - seen.stamp_ns > _FRESH_NS:
            why = "motion capture does not see the vehicle"
        else:
            why = vehicle_disagreement(seen.position, seen.orientation, own.orientation, reach)
        if self._agrees.add(now_ns, not why) and self._arming is not None:
            self._link.allow_arming(self._arming)
        if not self._differs.add(now_ns, bool(why)):
            return []
        self._link.refuse_arming()
        text = f"not armed: motion capture's vehicle does not agree with the autopilot: {why}"
        return [Out("event", Event(now_ns, "error", self.name, text))]

    def _parameters(self, now_ns: int, phase: str) -> list[Out]:
        """What the autopilot holds, once it has been read and set."""
        if phase == self._phase or phase in ("connect", "parameters"):
            return []
        held = self._link.parameters
        if not held or held == self._published:
            return []
        self._published = held
        return [Out("vehicle/parameters", VehicleParameters(now_ns, tuple(held), tuple(held.values())))]

    def _wanted(self, actions: Sequence[Action]) -> Action | None:
        """What is to be sent, before the gate: the newest engaged action; from contact on the motors idle."""
        engaged = [action for action in actions if action.engaged]
        if not engaged or self._aborted:
            return None
        if self._magnet is None:
            return engaged[-1]
        return replace(engaged[-1], body_rate=(0.0, 0.0, 0.0), thrust=self._gate.least_thrust)

    def _silent(self, now_ns: int, commanded: bool) -> str:
        """Hand the vehicle back if commands have stopped in the dive, sooner than its driver would; why, once."""
        if commanded or self._commanded_ns is None or self._link.phase != "handed_over":
            self._commanded_ns = now_ns if commanded else None
            return ""
        silent_ns = now_ns - self._commanded_ns
        if silent_ns < SILENCE_NS or self._magnet is not None or not diving(now_ns, self._odometry, self._board):
            return ""
        self._link.release()
        return f"no command for {silent_ns * 1e-9:.2f} s in the dive: the vehicle is handed back"

    def _down(self, seen: VehicleState | None) -> str:
        """Stop the motors of a vehicle that was handed back and is on the floor; why, once."""
        if self._floor is None or self._link.phase not in _LANDS or not self._link.armed or not self._floor.add(seen):
            return ""
        self._link.kill()
        return f"on the floor for {DOWN_NS * 1e-9:.0f} s, and not disarmed by the autopilot: the motors are stopped"

    def _checked(self, now_ns: int, action: Action | None) -> tuple[Rates | None, Sent | None, str]:
        """(what to send, its record, why the gate tripped just now)."""
        if action is None or self._gate.tripped:
            return None, None, ""
        sent = self._gate.check(now_ns, action, self._odometry, self._board, self._seen)
        if sent is not None:
            return Rates(sent.body_rate, sent.thrust), sent, ""
        if self._gate.tripped:
            return None, Sent(now_ns, (0.0, 0.0, 0.0), 0.0, 0.0, False, self._gate.tripped), self._gate.tripped
        return None, None, ""

    def _end(self, now_ns: int, contact: Contact) -> str:
        """Held by the magnet: motors off. Not held, or on a board that is not there: back to the autopilot, which
        lands. Returns what is to be reported, once."""
        if not contact.attached or self._virtual_board:
            self._link.release()
            return ""
        self._magnet = self._magnet or MagnetCheck(now_ns)
        before, hold = self._magnet.hold, self._magnet.judge(now_ns, self._odometry)
        if hold == "held":
            self._link.kill()
        elif hold == "falls":
            self._link.release()
        return NOT_HELD if hold == "falls" != before else ""

    @property
    def counters(self) -> dict[str, int]:
        return {
            "bytes of garbage on the vehicle's wire": self._link.garbage,
            "commands too old to send": self._gate.refused,
            "poses of motion capture not passed on to the autopilot": self._poses.refused if self._poses else 0,
        }


def _with_thrust(sent: Sent, output: LinkOutput) -> Sent:
    return Sent(sent.stamp_ns, sent.body_rate, sent.thrust, output.sent_thrust or 0.0, sent.limited, sent.tripped)


def _status(now_ns: int, output: LinkOutput) -> VehicleStatus:
    return VehicleStatus(
        now_ns,
        output.connected,
        output.armed,
        output.landed,
        output.failsafe,
        output.mode,
        output.phase,
        output.battery_v,
        output.hover_thrust,
        output.clock_offset_ns or 0,
    )
