"""The ground car: follower, CAN driver, and the simulated car behind the wire."""

from __future__ import annotations

import math

from groundcar.board_pose import board_position, board_quaternion, board_velocity
from groundcar.follower import Follower
from groundcar.motion import HEADING, SPEED, TURN_RATE
from groundcar.scout_link import ScoutLink, WrongProtocolError
from groundcar.scout_sim import ScoutSim
from hil.messages import BoardState, CarCommand, CarFeedback, CarReference, Event, Stage
from hil.node import Inbox, Out

CONTROL_PERIOD_NS = 20_000_000  # the car is commanded at 50 Hz


class CarFollower:
    """Drives the car along the scenario's motion, by motion capture, once the director lets it."""

    name = "car_follower"
    inputs = ("mocap/board", "run/stage")
    outputs = ("car/reference", "car/command")
    wakes = ()
    period_ns = CONTROL_PERIOD_NS

    def __init__(self, follower: Follower) -> None:
        self._follower = follower

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        board: BoardState | None = inbox.latest("mocap/board")
        stage: Stage | None = inbox.latest("run/stage")
        if board is None or stage is None:
            return []
        if stage.car_start_ns:
            self._follower.start(stage.car_start_ns)
        x, y, _ = board.position
        if not all(map(math.isfinite, (x, y, board.heading, board.speed, board.turn_rate))):
            return []
        reference, command = self._follower.step(
            now_ns, x, y, board.heading, board.speed, board.turn_rate, board.stamp_ns
        )
        return [
            Out("car/reference", CarReference(*reference)),
            Out("car/command", CarCommand(command.stamp_ns, command.speed, command.turn_rate)),
        ]

    def close(self) -> None:
        pass


class CarLink:
    """The CAN driver: enables the car, passes fresh commands on, reports what it says."""

    name = "car_link"
    inputs = ("car/command",)
    outputs = ("car/feedback", "event")
    wakes = ("car/command",)
    period_ns = CONTROL_PERIOD_NS

    def __init__(self, link: ScoutLink) -> None:
        self._link = link
        self._fault = ""
        self.rejected = 0
        self._refused = self._aborted = False

    def abort(self, why: str) -> None:
        """Ask for zero speed from now on, whatever is commanded."""
        self._aborted = True

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        commands = [CarCommand(now_ns, 0.0, 0.0)] if self._aborted else inbox.new("car/command")
        if self._refused:
            return []
        try:
            said = self._link.step(now_ns, commands[-1] if commands else None)
        except WrongProtocolError as error:
            self._refused = True
            return [Out("event", Event(now_ns, "error", self.name, str(error)))]
        self.rejected = said.rejected_frames
        outs: list[Out] = []
        if said.fault != self._fault:
            text = f"car: {said.fault}" if said.fault else f"car: fault gone ({self._fault})"
            outs.append(Out("event", Event(now_ns, "warning" if said.fault else "info", self.name, text)))
            self._fault = said.fault
        feedback = CarFeedback(
            said.stamp_ns, said.speed, said.turn_rate, said.mode, said.battery_v, said.fault, said.rejected_frames
        )
        return [*outs, Out("car/feedback", feedback)]

    def close(self) -> None:
        pass


class CarDevice:
    """The simulated Scout Mini and the board it carries."""

    name = "car_device"
    inputs = ()
    outputs = ("truth/board",)
    wakes = ()
    period_ns = 4_000_000

    def __init__(self, sim: ScoutSim, height: float, inclination: float) -> None:
        """`height` of the board's centre in m, `inclination` in rad."""
        self._sim, self._height, self._inclination = sim, height, inclination

    def step(self, now_ns: int, inbox: Inbox) -> list[Out]:
        self._sim.step(now_ns)
        row = self._sim.platform_row(self._height, self._inclination)
        x, y, z = board_position(row)
        state = BoardState(
            stamp_ns=now_ns,
            position=(float(x), float(y), float(z)),
            velocity=board_velocity(row),
            orientation=board_quaternion(row),
            heading=float(row[HEADING]),
            speed=float(row[SPEED]),
            turn_rate=float(row[TURN_RATE]),
        )
        return [Out("truth/board", state)]

    def close(self) -> None:
        pass
