"""The ground car: follower, CAN driver with its gate, and the simulated car behind the wire."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Protocol

import numpy as np

from groundcar.motion import board_row
from groundcar.motion.pose import board_quaternion, board_velocity
from groundcar.scout.dead_reckoning import DeadReckoning
from groundcar.scout.driver import ScoutLink, WrongProtocolError
from groundcar.scout.follower import Follower, RecordedFollower
from groundcar.scout.sim import ScoutSim
from hil.contract.messages import BoardState, CarCommand, CarFeedback, CarReference, Event, Stage, VehicleStatus
from hil.contract.node import Inbox, Node, Out
from hil.safety.car_gate import CarGate
from hil.safety.limits import CarGateLimits
from kernel.clip import usable
from kernel.stamps import later_than_now
from vehicle.mocap.continuity import Continuity, Repetition

CONTROL_PERIOD_NS = 20_000_000  # the car is commanded at 50 Hz
_BRAKING = 1.5  # m/s^2, to rest after the run, with a vehicle on the board
_STANDING = 0.05  # m/s
_BLIND_NS = 1_000_000_000  # the car is not driven by an older measurement
_FASTEST = CarGateLimits().measured_speed  # m/s, that no car reaches


class CarFollower(Node):
    """Drives the car along the scenario's motion, by motion capture, once the director starts it; brings it to rest
    when the run has ended or the vehicle has been given up: one that lands beside the board must not be met by it.
    Once the car is under way, it is not driven by a pose that has jumped, until it has jumped back, nor by one that
    comes again and again while the wheels turn."""

    name = "car_follower"
    inputs = ("mocap/board", "run/stage", "car/feedback", "vehicle/status")
    outputs = ("car/reference", "car/command", "event")
    period_ns = CONTROL_PERIOD_NS

    def __init__(self, follower: Follower | RecordedFollower) -> None:
        self._follower, self._continuity, self._repetition = follower, Continuity(_FASTEST), Repetition()
        self._asked = (0.0, 0.0)
        self._refused = 0
        self._told: set[str] = set()

    @property
    def counters(self) -> dict[str, int]:
        return {"periods without a usable measurement of the car": self._refused}

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        board: BoardState | None = inbox.latest("mocap/board")
        stage: Stage | None = inbox.latest("run/stage")
        if stage is not None and stage.name == "ended":
            return [self._command(now_ns, *self._slower())]
        if board is None or stage is None:
            return []
        if stage.car_start_ns:
            self._follower.start(stage.car_start_ns)
        x, y, _ = board.position
        if not _can_be_followed(now_ns, board):
            self._refused += 1
            return []
        if not 0 < stage.car_start_ns <= now_ns:  # the car stands, wherever it is
            self._continuity.reset()
        jump = self._continuity.add(board.stamp_ns, board.position)
        if jump:
            return self._refuse(now_ns, "jump", f"has jumped by {jump:.2f} m", "it has jumped back")
        wheels: CarFeedback | None = inbox.latest("car/feedback")
        turning = wheels is not None and abs(wheels.speed) > _STANDING
        if self._repetition.add(board.stamp_ns, board.position, turning):
            return self._refuse(now_ns, "repetition", "does not change while the car's wheels turn", "it changes")
        reference, command = self._follower.step(
            now_ns, x, y, board.heading, board.speed, board.turn_rate, board.stamp_ns
        )
        vehicle: VehicleStatus | None = inbox.latest("vehicle/status")
        given_up = vehicle is not None and vehicle.given_up
        speed, turn_rate = self._slower() if given_up else (command.speed, command.turn_rate)
        return [Out("car/reference", CarReference(*reference)), self._command(command.stamp_ns, speed, turn_rate)]

    def _refuse(self, now_ns: int, kind: str, what: str, until: str) -> list[Out]:
        """The event for the first pose that is not followed, of each kind."""
        self._refused += 1
        if kind in self._told:
            return []
        self._told.add(kind)
        text = f"the board's pose {what}: the car is not driven by it until {until}"
        return [Out("event", Event(now_ns, "error", self.name, text))]

    def _command(self, stamp_ns: int, speed: float, turn_rate: float) -> Out:
        self._asked = (speed, turn_rate)
        return Out("car/command", CarCommand(stamp_ns, speed, turn_rate))

    def _slower(self) -> tuple[float, float]:
        """The last command a period later: on the same curve to rest, no faster than the car is driven otherwise."""
        speed, turn_rate = self._asked
        left = max(0.0, abs(speed) - _BRAKING * CONTROL_PERIOD_NS * 1e-9)
        share = left / abs(speed) if left else 0.0
        return math.copysign(left, speed), share * turn_rate


def _can_be_followed(now_ns: int, board: BoardState) -> bool:
    """Whether the car can be driven by this measurement. Without commands its own watchdog stops it."""
    if later_than_now(board.stamp_ns, now_ns) or now_ns - board.stamp_ns > _BLIND_NS:
        return False
    return usable((*board.position, board.heading, board.speed, board.turn_rate))


class CarLink(Node):
    """The CAN driver with its gate: enables the car, passes fresh commands on, reports feedback and what was sent."""

    name = "car_link"
    inputs = ("car/command",)
    outputs = ("car/feedback", "car/sent", "event")
    wakes = ("car/command",)
    period_ns = CONTROL_PERIOD_NS

    def __init__(
        self, link: ScoutLink, gate: CarGate | None = None, stands_for_truth: DeadReckoning | None = None
    ) -> None:
        """`stands_for_truth`: a real car with simulated sensors, which use the pose from its wheel odometry."""
        self._link, self._gate, self._truth = link, gate or CarGate(CarGateLimits()), stands_for_truth
        if stands_for_truth is not None:
            self.outputs = (*CarLink.outputs, "truth/board")
        self._fault = ""
        self._reported: CarFeedback | None = None
        self._sent = 0
        self._rejected = 0
        self._protocol_wrong = self._aborted = False

    @property
    def counters(self) -> dict[str, int]:
        return {
            "frames rejected on the car's wire": self._rejected,
            "commands too old to send to the car": self._gate.refused,
        }

    @property
    def safe(self) -> bool:
        """The car stands, or is out of reach: then its own watchdog stops it."""
        return self._reported is None or bool(self._fault) or abs(self._reported.speed) < _STANDING

    def abort(self, why: str) -> None:
        """Command zero speed from now on, whatever is commanded."""
        self._aborted = True

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        commands = [CarCommand(now_ns, 0.0, 0.0)] if self._aborted else inbox.new("car/command")
        if self._protocol_wrong:
            return []
        outs: list[Out] = []
        checked = self._checked(now_ns, commands[-1], outs) if commands else None
        try:
            output = self._link.step(now_ns, checked)
        except WrongProtocolError as error:
            self._protocol_wrong, self._reported = True, None
            return [Out("event", Event(now_ns, "error", self.name, str(error)))]
        self._rejected = output.rejected_frames
        if output.fault != self._fault:
            text = f"car: {output.fault}" if output.fault else f"car: fault gone ({self._fault})"
            outs.append(Out("event", Event(now_ns, "warning" if output.fault else "info", self.name, text)))
            self._fault = output.fault
        if checked is not None and output.sent_commands != self._sent:
            outs.append(Out("car/sent", checked))
        self._sent = output.sent_commands
        self._reported = CarFeedback(
            output.stamp_ns,
            output.speed,
            output.turn_rate,
            output.mode,
            output.battery_v,
            output.fault,
            output.rejected_frames,
        )
        if self._truth is not None:
            self._truth.add(output.stamp_ns, output.speed, output.turn_rate, now_ns)
            outs.append(Out("truth/board", board_of(now_ns, self._truth.board_row(now_ns))))
        return [*outs, Out("car/feedback", self._reported)]

    def _checked(self, now_ns: int, command: CarCommand, outs: list[Out]) -> CarCommand | None:
        """What may be sent of `command`; a trip is reported once."""
        before = self._gate.tripped
        checked = self._gate.check(now_ns, command, self._reported)
        if self._gate.tripped and not before:
            outs.append(Out("event", Event(now_ns, "error", "car_gate", f"gate tripped: {self._gate.tripped}")))
        return checked


class BoardRide(Protocol):
    """How the board moves on its car."""

    def at(self, seconds: float, since_start: float | None, /) -> tuple[float, float, float]:
        """(height m, its rate m/s, inclination rad) at `seconds` of the run, `since_start` s after the car set off."""
        ...


class RecordedBoard(Protocol):
    """A recorded motion; see `groundcar.motion.recorded.RecordedMotion`."""

    def at(self, seconds: float, /) -> np.ndarray: ...


class CarDevice(Node):
    """The simulated Scout Mini and the board it carries. With a recorded motion something else carries the car along
    it, from the moment at which it sets off."""

    name = "car_device"
    inputs = ("run/stage",)
    outputs = ("truth/board",)
    period_ns = 4_000_000

    def __init__(self, sim: ScoutSim, ride: BoardRide, recorded: RecordedBoard | None = None) -> None:
        self.sim, self._ride, self._recorded = sim, ride, recorded
        if recorded is None:
            self.inputs = ()

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        since: float | None = None
        self.sim.step(now_ns)
        if self._recorded is not None:
            stage: Stage | None = inbox.latest("run/stage")
            since = (now_ns - stage.car_start_ns) * 1e-9 if stage is not None and stage.car_start_ns else 0.0
            row = self._recorded.at(since)
            moving = since > 0.0 and (stage is None or stage.name != "ended")
            speed, turn_rate = (float(row[board_row.SPEED]), float(row[board_row.TURN_RATE])) if moving else (0.0, 0.0)
            self.sim.carry(
                float(row[board_row.X]), float(row[board_row.Y]), float(row[board_row.HEADING]), speed, turn_rate
            )
        height, rate, inclination = self._ride.at(now_ns * 1e-9, since)
        board = board_of(now_ns, self.sim.board_row(height, inclination))
        if rate:
            x, y, _ = board.velocity
            board = replace(board, velocity=(x, y, rate))
        return [Out("truth/board", board)]


def board_of(stamp_ns: int, row: np.ndarray) -> BoardState:
    """The board's state from a board row (8,)."""
    numbers = row.tolist()
    return BoardState(
        stamp_ns=stamp_ns,
        position=(numbers[board_row.X], numbers[board_row.Y], numbers[board_row.Z]),
        velocity=board_velocity(row),
        orientation=board_quaternion(row),
        heading=numbers[board_row.HEADING],
        speed=numbers[board_row.SPEED],
        turn_rate=numbers[board_row.TURN_RATE],
    )
