"""The simulated Scout Mini behind its CAN wire: the other end of the bus in place of the car.

Power-on is standby, where only 0x421 is accepted; the remote control has priority; 500 ms without a motion command stop
the car; e-stop, faults and an empty battery stop it too. Physics: groundcar.scout.physics. Time comes from `step`.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Any, NamedTuple

import numpy as np

from groundcar.motion import board_row
from groundcar.motion.kinematics import wrap
from groundcar.scout import car_row
from groundcar.scout import physics as ph
from groundcar.scout.codec import COMMANDS, V1_STATE_ID, Decoder, Frame
from groundcar.scout.feedback import Battery, FeedbackSender
from groundcar.scout.params import ScoutParams, load_scout
from kernel.random import stream

STANDBY, CAN, UART, RC = range(4)
OK, ESTOP, FAULT = range(3)
WHEEL_FAULTS = ("motor_hot", "over_current", "driver_hot", "can_lost", "under_voltage")


class Pose(NamedTuple):
    """Where the car is: m, m, rad in (-pi, pi]."""

    x: float
    y: float
    heading: float


class ScoutSim:
    """One simulated car on `wire` (see groundcar.scout.driver.CanWire). Equal seeds and steps give equal cars."""

    def __init__(
        self,
        wire: Any,
        params: ScoutParams | None = None,
        seed: int = 0,
        *,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        protocol: int = 2,
    ) -> None:
        """Switched off until the first `step`. `pose`: x, y (m), heading (rad). `protocol` 1: an old car, which sends
        0x151 and understands nothing of V2. Raises ValueError for another protocol or a pose that is not finite."""
        if protocol not in (1, 2):
            raise ValueError(f"a Scout speaks protocol 1 or 2, not {protocol}")
        self._wire, self._params, self._protocol = wire, params or load_scout(), protocol
        own = stream(seed, 0x5C0)
        self._row = ph.physics_row(self._params, own)
        self._stream = stream(seed, 0x5C1)
        self._state = np.zeros(car_row.DIM)
        self.battery = Battery(self._params.battery, self._params.spread.battery, own)
        self._watchdog_ns = round(self._params.protocol.watchdog * 1e9)
        self._decoder = Decoder(COMMANDS)
        self._sender = FeedbackSender(self._params.geometry)
        self._time_ns: int | None = None
        self._commanded_ns: int | None = None
        self._pending: deque[tuple[int, float, float]] = deque()
        self._asked = (0.0, 0.0)
        self._rc: tuple[float, float] | None = None
        self._brake = self._estop = False
        self._faults: dict[tuple[str, int], bool] = {}
        self.mode = STANDBY
        self.ignored_commands = 0
        self.place(*pose)

    def place(self, x: float, y: float, heading: float) -> None:
        """Place the car at rest. Raises ValueError unless all are finite."""
        if not all(map(math.isfinite, (x, y, heading))):
            raise ValueError(f"the car cannot be placed at ({x}, {y}, {heading}): give finite numbers")
        self._state[:] = 0.0
        self._state[[car_row.X, car_row.Y, car_row.HEADING]] = x, y, heading
        self._pending.clear()
        self._asked = (0.0, 0.0)

    def carry(self, x: float, y: float, heading: float, speed: float, turn_rate: float) -> None:
        """Put the car where something else moves it: m, rad, m/s, rad/s, as its wheels report too."""
        self._state[[car_row.X, car_row.Y, car_row.HEADING]] = x, y, heading
        self._state[[car_row.SPEED, car_row.TURN_RATE]] = speed, turn_rate

    # truth: for the board, motion capture and tests, never for the driver

    @property
    def pose(self) -> Pose:
        """True pose at the last step."""
        return Pose(
            float(self._state[car_row.X]), float(self._state[car_row.Y]), float(wrap(self._state[car_row.HEADING]))
        )

    @property
    def speed(self) -> float:
        """True forward speed, m/s."""
        return float(self._state[car_row.SPEED])

    @property
    def turn_rate(self) -> float:
        """True turn rate, rad/s."""
        return float(self._state[car_row.TURN_RATE])

    def board_row(self, height: float, inclination: float, out: np.ndarray | None = None) -> np.ndarray:
        """The board that the car carries as a board row (8,) of groundcar.motion.board_motion; u is 0."""
        row = np.zeros(board_row.DIM) if out is None else out
        x, y, heading = self.pose
        row[:] = x, y, height, heading, self.speed, self.turn_rate, inclination, 0.0
        return row

    @property
    def state(self) -> int:
        """OK, ESTOP or FAULT, as reported in 0x211."""
        if self._estop:
            return ESTOP
        return FAULT if self._faults or self.battery.empty else OK

    @property
    def rejected_frames(self) -> int:
        """Frames of wrong length or unknown identifier."""
        return self._decoder.rejected

    # faults and operators' actions

    def press_estop(self, pressed: bool = True) -> None:
        """The red button at the back."""
        self._estop = pressed

    def set_rc(self, sticks: tuple[float, float] | None) -> None:
        """Switch the remote control on with (speed m/s, turn rate rad/s), or off with None: back to standby then."""
        if sticks is not None:
            self.mode = RC
        elif self._rc is not None:
            self.mode = STANDBY
        self._rc = sticks

    def inject(self, fault: str, wheel: int = 1, lasting: bool = False) -> None:
        """A wheel's fault (one of WHEEL_FAULTS), latched; 0x441 clears it unless it is `lasting`. Raises ValueError."""
        if fault not in WHEEL_FAULTS or wheel not in (1, 2, 3, 4):
            raise ValueError(f"wheels 1 to 4 can have {', '.join(WHEEL_FAULTS)}, not {fault} at {wheel}")
        self._faults[fault, wheel] = lasting

    def heal(self, fault: str, wheel: int = 1) -> None:
        """End the cause of a lasting fault; it stays latched until 0x441."""
        if (fault, wheel) in self._faults:
            self._faults[fault, wheel] = False

    def mute(self, *names: str) -> None:
        """Feedback messages that the car stops sending; without names it sends all again."""
        self._sender.muted = frozenset(names)

    # the bus

    def step(self, now_ns: int) -> None:
        """Advance to `now_ns`, read the bus, send what is due. Raises ValueError if time runs backward."""
        if self._time_ns is None:
            self._time_ns = now_ns
        if now_ns < self._time_ns - ph.STEP_NS:
            raise ValueError(f"time of the car runs backward: {now_ns} after {self._time_ns} ns")
        while self._time_ns + ph.STEP_NS <= now_ns:
            self._time_ns += ph.STEP_NS
            self._move(self._time_ns)
        for frame in self._wire.receive():
            self._receive(frame, now_ns)
        if self._protocol == 1:
            if self._sender.due("SystemState", now_ns):
                self._wire.send(Frame(V1_STATE_ID, bytes(8)))
            return
        self._sender.send(self._wire, now_ns, self._state, self.state, self.mode, self._faults, self.battery)

    def _move(self, time_ns: int) -> None:
        while self._pending and self._pending[0][0] <= time_ns:
            self._asked = self._pending.popleft()[1:]
        if self._commanded_ns is None or time_ns - self._commanded_ns > self._watchdog_ns:
            self._asked = (0.0, 0.0)
            self._pending.clear()
        asked = self._asked if self.mode == CAN else (self._rc or (0.0, 0.0))
        stopping = self._brake or self.state != OK
        dt = ph.STEP_NS * 1e-9
        ph.physics_step(self._state, self._row, asked[0], asked[1], stopping, dt, self._stream)
        self.battery.use(float(self._state[car_row.WHEEL_ACCEL]), float(self._state[car_row.WHEEL_SPEED]), dt)

    def _receive(self, frame: tuple[int, bytes], now_ns: int) -> None:
        decoded = self._decoder.decode(frame) if self._protocol == 2 else None
        if decoded is None:
            return
        name, values = decoded
        if name == "ControlMode" and self._rc is None and values["mode"] <= UART:
            self.mode = int(values["mode"])
        elif self.mode != CAN:
            self.ignored_commands += 1
        elif name == "MotionCommand":
            limits = self._params.limits
            speed = min(max(values["speed"], -limits.speed), limits.speed)
            turn = min(max(values["turn_rate"], -limits.turn_rate), limits.turn_rate)
            self._commanded_ns = now_ns
            self._pending.append((now_ns + round(self._params.response.delay * 1e9), speed, turn))
        elif name == "BrakeCommand":
            self._brake = bool(values["lock"])
        elif name == "ClearErrors":
            wheel = int(values["motor"])
            self._faults = {k: lasting for k, lasting in self._faults.items() if lasting or wheel not in (0, k[1])}
        elif name == "LightCommand":
            self._sender.light = {k: v for k, v in values.items() if k != "count"}
