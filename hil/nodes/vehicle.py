"""The quadrotor: driver with its gate, and the simulated autopilot and airframe behind the wire."""

from __future__ import annotations

from typing import Any

from hil.contract.messages import (
    Action,
    BoardState,
    Contact,
    Event,
    Sent,
    VehicleParameters,
    VehicleState,
    VehicleStatus,
)
from hil.contract.node import Inbox, Node, Out
from hil.safety.vehicle_gate import VehicleGate
from vehicle.px4.driver.arming import Arming
from vehicle.px4.driver.core import BEFORE_FLIGHT
from vehicle.px4.driver.driver import Px4Link
from vehicle.px4.driver.types import ExternalPose, LinkOutput, Rates
from vehicle.px4.sim.autopilot import Px4Sim
from vehicle.quadrotor.wind import Wind

STATUS_PERIOD_NS = 100_000_000
GROUND_PHASES = (*BEFORE_FLIGHT, "arm")


class VehicleLink(Node):
    """Driver and gate in one node: nothing comes between the last check and the wire."""

    name = "vehicle_link"
    inputs = ("policy/action", "referee/contact")
    outputs = ("vehicle/odometry", "vehicle/status", "vehicle/sent", "vehicle/parameters", "event")
    wakes = ("policy/action",)
    period_ns = 2_000_000

    def __init__(
        self,
        link: Px4Link,
        gate: VehicleGate,
        stands_for_truth: bool = False,
        external_pose: bool = False,
        virtual_board: bool = False,
    ) -> None:
        """`stands_for_truth`: a real vehicle with simulated sensors, which use the pose from its odometry.
        `external_pose`: the vehicle's pose from motion capture is passed on to the autopilot's estimator.
        `virtual_board`: a real vehicle perches on a board that is not there, and would fall if its motors stopped."""
        self._link, self._gate, self._truth, self._external = link, gate, stands_for_truth, external_pose
        self._virtual_board = virtual_board
        if external_pose:
            self.inputs = (*VehicleLink.inputs, "mocap/vehicle")
        if stands_for_truth:
            self.outputs = (*VehicleLink.outputs, "truth/vehicle")
        self._odometry: VehicleState | None = None
        self._status_ns = -STATUS_PERIOD_NS
        self._phase = ""
        self._published: dict[str, float] = {}
        self._aborted = False

    def permit(self, arming: Any) -> None:
        """A real vehicle is not armed before. Raises ValueError for a table that is not that of an `Arming`."""
        self._link.allow_arming(Arming.of(arming))

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
        if contact is not None and contact.outcome != "ongoing":
            self._end(contact)
        actions = [action for action in inbox.new("policy/action") if action.engaged]
        newest = actions[-1] if actions and not self._aborted else None
        command, sent, tripped = self._checked(now_ns, newest)
        seen: VehicleState | None = inbox.latest("mocap/vehicle") if self._external else None
        pose = None if seen is None else ExternalPose(seen.stamp_ns, seen.position, seen.orientation)
        output = self._link.step(now_ns, command, pose)
        outs = [Out("event", Event(now_ns, note.severity, self.name, note.text)) for note in output.notes]
        if tripped:
            outs.append(Out("event", Event(now_ns, "error", "gate", f"gate tripped: {tripped}")))
        for sample in output.odometry:
            self._odometry = VehicleState(*sample)
            outs.append(Out("vehicle/odometry", self._odometry))
            if self._truth:
                outs.append(Out("truth/vehicle", self._odometry))
        if sent is not None and (output.sent_thrust is not None or tripped):
            outs.append(Out("vehicle/sent", _with_thrust(sent, output)))
        outs += self._parameters(now_ns, output.phase)
        if output.phase != self._phase or now_ns - self._status_ns >= STATUS_PERIOD_NS:
            self._status_ns, self._phase = now_ns, output.phase
            outs.append(Out("vehicle/status", _status(now_ns, output)))
        return outs

    def _parameters(self, now_ns: int, phase: str) -> list[Out]:
        """What the autopilot holds, once it has been read and set."""
        if phase == self._phase or phase in ("connect", "parameters"):
            return []
        held = self._link.parameters
        if not held or held == self._published:
            return []
        self._published = held
        return [Out("vehicle/parameters", VehicleParameters(now_ns, tuple(held), tuple(held.values())))]

    def _checked(self, now_ns: int, action: Action | None) -> tuple[Rates | None, Sent | None, str]:
        """(what to send, its record, why the gate tripped just now)."""
        if action is None or self._gate.tripped:
            return None, None, ""
        sent = self._gate.check(now_ns, action, self._odometry)
        if sent is not None:
            return Rates(sent.body_rate, sent.thrust), sent, ""
        if self._gate.tripped:
            return None, Sent(now_ns, (0.0, 0.0, 0.0), 0.0, 0.0, False, self._gate.tripped), self._gate.tripped
        return None, None, ""

    def _end(self, contact: Contact) -> None:
        """Perched: motors off. Not perched, or on a board that is not there: back to the autopilot, which lands."""
        if contact.attached and not self._virtual_board:
            self._link.kill()
        else:
            self._link.release()

    @property
    def counters(self) -> dict[str, int]:
        return {
            "bytes of garbage on the vehicle's wire": self._link.garbage,
            "commands too old to send": self._gate.refused,
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
    )


class VehicleDevice(Node):
    """The software PX4 with its airframe; when the magnet holds, the vehicle rides on the board."""

    name = "vehicle_device"
    inputs = ("referee/contact", "truth/board")
    outputs = ("truth/vehicle",)
    period_ns = 4_000_000

    def __init__(self, sim: Px4Sim, wind: Wind | None = None) -> None:
        self._sim, self._wind = sim, wind

    @property
    def safe(self) -> bool:
        """Whether it is disarmed: until then its driver needs it."""
        return not self._sim.truth().armed

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        contact: Contact | None = inbox.latest("referee/contact")
        board: BoardState | None = inbox.latest("truth/board")
        if contact is not None and contact.attached and board is not None:
            self._sim.attach(board.position, board.orientation, board.stamp_ns, board.velocity, board.turn_rate)
        if self._wind is not None:
            self._sim.set_wind(self._wind.at(now_ns))
        self._sim.step(now_ns)
        truth = self._sim.truth()
        state = VehicleState(now_ns, truth.position, truth.velocity, truth.orientation, truth.body_rate)
        return [Out("truth/vehicle", state)]
